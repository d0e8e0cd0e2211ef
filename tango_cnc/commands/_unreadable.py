"""A night whose cell or history cannot be read: it moves nothing, is put on record where there is one, and somebody hears of it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from ..files.checked import read_bytes
from ..files.nightly import NAME, SCHEMES, Nightly, read_nightly
from ..history import Decision, Knowledge, Night
from ..nightly import Measured, PreflightPoint
from ..nightly.ports import Past
from ..records import InputError, TangoError

URL = re.compile(rf"(?:{'|'.join(SCHEMES)}):[^\s,'\"\]}}]+")


def settings_of(folder: Path) -> tuple[Nightly, InputError | None]:
    """folder of a cell → settings of its nights, None; where nightly.yaml is wrong, who is to be told of it, and what is wrong."""
    try:
        return read_nightly(folder), None
    except InputError as error:
        return _salvaged(folder / NAME), error


def _salvaged(file: Path) -> Nightly:
    """nightly.yaml with a mistake → the receivers, the owner and the history that its text names."""
    try:
        text = re.sub(r"(?m)(^|\s)#.*$", "", read_bytes(file).decode("utf-8", "replace"))
    except InputError:
        return Nightly()
    given = {key: match[1].strip("'\" ") for key in ("owner", "history") if (match := re.search(rf"(?m)^{key}:\s*(\S.*)$", text))}
    return Nightly(notify=tuple(URL.findall(text)), **given)  # type: ignore[arg-type]


def machine_of(folder: Path, known: Sequence[str]) -> str:
    """folder of a cell that cannot be read, machines of its history → the name of its machine, as well as it can be told."""
    try:
        text = read_bytes(folder / "machine.yaml").decode("utf-8", "replace")
    except InputError:
        text = ""
    match = re.search(r"(?m)^name:\s*['\"]?([^'\"#\n]+?)['\"]?\s*(?:#.*)?$", text)
    if match is not None and (match[1] in known or len(known) != 1):
        return match[1]
    return known[0] if len(known) == 1 else folder.resolve().name


@dataclass(frozen=True)
class Unreadable:
    """The analysis of a cell that cannot be read, and its machine: whatever is asked of them says why."""

    error: TangoError

    def choice(self, past: Any, day: float) -> tuple[str, str, tuple[int, ...]]:
        """Raises what is wrong."""
        raise self.error

    def analysed(
        self, past: Any, day: float, kind: str, measured: Measured
    ) -> tuple[dict[str, Any], Knowledge | None, dict[str, str]]:
        """Raises what is wrong."""
        raise self.error

    def preflight(self, kind: str, touches: Sequence[int]) -> Sequence[PreflightPoint]:
        """Raises what is wrong."""
        raise self.error

    def measure(self, kind: str, touches: Sequence[int]) -> Measured:
        """Raises what is wrong."""
        raise self.error


@dataclass(frozen=True)
class NoHistory:
    """A history that cannot be opened: whatever is asked of it says why."""

    error: TangoError

    def _no(self) -> NoReturn:
        raise self.error

    def machines(self) -> tuple[str, ...]:
        """Raises what is wrong."""
        self._no()

    def nights(self, machine: str | None = None, last: int | None = None) -> tuple[Night, ...]:
        """Raises what is wrong."""
        self._no()

    def of_now(self) -> Past:
        """→ this: it is the same at every moment."""
        return self

    def records(self, machine: str, last: int | None = None) -> tuple[Any, ...]:
        """Raises what is wrong."""
        self._no()

    def ahead(self, machine: str) -> tuple[Night, ...]:
        """Raises what is wrong."""
        self._no()

    def knows(self, machine: str) -> bool:
        """Raises what is wrong."""
        self._no()

    def records_of(self, entries: Sequence[int]) -> dict[int, Any]:
        """Raises what is wrong."""
        self._no()

    def readings_of(self, entries: Sequence[int]) -> dict[int, str]:
        """Raises what is wrong."""
        self._no()

    def latest_knowledge(self, machine: str) -> tuple[Night, Knowledge] | None:
        """Raises what is wrong."""
        self._no()

    def decisions(self, machine: str) -> tuple[Decision, ...]:
        """Raises what is wrong."""
        self._no()

    def alarmed(self, machine: str, last: int | None = None) -> tuple[Any, ...]:
        """Raises what is wrong."""
        self._no()

    def newest_hashes(self) -> dict[str, tuple[int, str]]:
        """Raises what is wrong."""
        self._no()

    def night(self, entry: int) -> Any:
        """Raises what is wrong."""
        self._no()

    def add_night(self, record: Any, readings: str | None = None, knowledge: Knowledge | None = None) -> int:
        """Raises what is wrong."""
        self._no()


class OfAnother:
    """The history of a cell whose name another cell has there: it knows nothing of this one, and nothing of this one is kept."""

    def machines(self) -> tuple[str, ...]:
        """→ none."""
        return ()

    def nights(self, machine: str | None = None, last: int | None = None) -> tuple[Night, ...]:
        """→ none."""
        return ()

    def of_now(self) -> Past:
        """→ this: it is the same at every moment."""
        return self

    def records(self, machine: str, last: int | None = None) -> tuple[Any, ...]:
        """→ none."""
        return ()

    def ahead(self, machine: str) -> tuple[Night, ...]:
        """→ none."""
        return ()

    def knows(self, machine: str) -> bool:
        """→ no."""
        return False

    def records_of(self, entries: Sequence[int]) -> dict[int, Any]:
        """→ none."""
        return {}

    def readings_of(self, entries: Sequence[int]) -> dict[int, str]:
        """→ none."""
        return {}

    def latest_knowledge(self, machine: str) -> tuple[Night, Knowledge] | None:
        """→ nothing."""
        return None

    def decisions(self, machine: str) -> tuple[Decision, ...]:
        """→ none."""
        return ()

    def alarmed(self, machine: str, last: int | None = None) -> tuple[Any, ...]:
        """→ none."""
        return ()

    def newest_hashes(self) -> dict[str, tuple[int, str]]:
        """→ none."""
        return {}

    def night(self, entry: int) -> Any:
        """Raises KeyError: no entry is known."""
        raise KeyError(entry)

    def add_night(self, record: Any, readings: str | None = None, knowledge: Knowledge | None = None) -> int:
        """→ no entry: the chain of the other cell has no night that was not its own."""
        return 0
