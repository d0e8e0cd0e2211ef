"""The controls that have a name: one file a control in controls/, `<name>.yaml`, with what it is beyond its language.

Its settings are from the manual of the control, never from the post: what a program assumes and what its control is stay apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from tango_cnc.files.checked import load

from .session import families

FOLDER = Path(__file__).parent / "controls"


@dataclass(frozen=True)
class StandIn:
    """One control: its language, fields of its profile as `--set` takes them, lines of programs that it has stored, the source."""

    language: str
    settings: Mapping[str, str] = field(default_factory=dict)
    stored: tuple[str, ...] = ()
    manual: str = ""  # which manual says so, and where in it; "unconfirmed" where nobody has seen one


def controls(folder: Path = FOLDER) -> tuple[str, ...]:
    """folder → names of the controls that it describes, in the order of the alphabet."""
    return tuple(sorted(file.stem for file in folder.glob("*.yaml")))


def stand_in(name: str, folder: Path = FOLDER) -> StandIn | None:
    """name, folder → that control, None for a name that the folder does not have. Raises InputError for a file that is wrong."""
    if name not in controls(folder):
        return None
    found = load(folder / f"{name}.yaml").fields(["language"], ["settings", "stored", "manual"])
    return StandIn(
        language=found["language"].text(families()),
        settings={key: value.text() for key, value in found["settings"].items()} if "settings" in found else {},
        stored=tuple(line.text() for line in found["stored"].list()) if "stored" in found else (),
        manual=found["manual"].text() if "manual" in found else "",
    )
