"""compensations/history.jsonl of a cell → the history of its machine."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from ..compensate import loop
from ..files import read_cell
from ..files.nightly import history_of, read_nightly
from ..records import TangoError
from ._handed import printed

if TYPE_CHECKING:
    from ..history import History


def recorded(folder: Path, history: History | None = None) -> None:
    """cell, an open history (None: that of the cell, made where there is none) → what happened to its compensations is in it.

    A history that cannot be written stops nothing: the events are in the cell, and the next event or night brings them along.
    """
    from ..history import add_compensations, opened

    try:
        events = loop.history(folder)
        if events:
            place = history_of(folder, read_nightly(folder))
            with nullcontext(history) if history is not None else opened(place) as found:
                add_compensations(found, read_cell(folder).machine.name, str(folder.resolve()), events)
    except TangoError as error:
        printed(
            f"{error}\n{folder / loop.FOLDER / loop.HISTORY} has the events; the next 'tango compensate' or "
            "'tango nightly' adds it to the history.",
            err=True,
        )
