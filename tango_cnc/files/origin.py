"""readings.origin.json beside readings.csv: who made the readings, of which cell, and a check value of every row.

What was changed since is said by key of the cell and by line of the readings; nothing is refused for it.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ..records import InputError
from .checked import load, parse
from .write import write_text

FORMAT = "tango-origin/1"
ROLES = ("machine", "artefact", "strategy")
FEW = 8  # keys or lines that a sentence names


def origin_file(readings: Path) -> Path:
    """readings.csv → the file beside it that says where they come from."""
    return readings.with_name(f"{readings.stem}.origin.json")


def check_values(text: str) -> list[str]:
    """text of readings.csv → CRC-32 of every row under the header, eight hexadecimal digits each."""
    return [f"{zlib.crc32(line.encode()):08x}" for line in text.splitlines()[1:] if line]


def write_origin(readings: Path, folder: Path, made_by: str, kept: str | None = None) -> None:
    """readings as written, folder of their cell, `measured` or `simulated`, where those before are kept → the file beside them."""
    before = read_origin(readings) or {}
    data = {
        "format": FORMAT,
        "origin": made_by,
        "readings": readings.name,
        "rows": check_values(readings.read_text(encoding="utf-8")),
        "cell": _texts(folder),
        "kept": [*before.get("kept", []), *([kept] if kept else [])],
    }
    write_text(origin_file(readings), json.dumps(data, indent=1, ensure_ascii=False) + "\n")


def read_origin(readings: Path) -> dict[str, Any] | None:
    """readings.csv → what is known of them, None when nothing is."""
    with suppress(OSError, ValueError):
        data = json.loads(origin_file(readings).read_text(encoding="utf-8"))
        if isinstance(data, dict) and data.get("format") == FORMAT:
            return data
    return None


def set_aside(readings: Path) -> str | None:
    """readings.csv about to be written → the name under which those before are kept, by their time; None when there were none."""
    if not readings.exists():
        return None
    stamp = datetime.fromtimestamp(readings.stat().st_mtime, UTC).strftime("%Y%m%dT%H%M%S%f")
    other = readings.with_name(f"{readings.stem}.{stamp}{readings.suffix}")
    if other.exists():
        raise InputError(f"{other}: found a file of that name already; move it away. Nothing was written")
    beside = readings.with_suffix(".json")
    if beside.exists():
        beside.rename(other.with_suffix(".json"))
    readings.rename(other)
    return other.name


def simulated(readings: Path) -> bool:
    """readings.csv → whether it is certainly what the simulator wrote, so that nothing is lost with it."""
    known = read_origin(readings)
    if known is None or known.get("origin") != "simulated":
        return False
    with suppress(OSError, UnicodeDecodeError):
        return known.get("rows") == check_values(readings.read_text(encoding="utf-8"))
    return False


def edited_rows(readings: Path) -> tuple[list[int], int]:
    """readings.csv → lines that are not as they were written, and how many rows are gone; nothing where the origin is unknown."""
    known = read_origin(readings)
    if known is None or not isinstance(known.get("rows"), list):
        return [], 0
    was = set(known["rows"])
    lines = readings.read_text(encoding="utf-8-sig").splitlines()
    now = [(i + 1, f"{zlib.crc32(line.encode()):08x}") for i, line in enumerate(lines) if i and line]
    strange = [line for line, value in now if value not in was]
    gone = len(was - {value for _, value in now})
    return strange, max(gone - len(strange), 0)


def changed_keys(readings: Path, folder: Path) -> dict[str, list[str]]:
    """readings.csv, folder of its cell → by file of the cell the keys that have changed since the readings were made."""
    known = read_origin(readings)
    found: dict[str, list[str]] = {}
    if known is None or not isinstance(known.get("cell"), dict):
        return found
    now = _texts(folder)
    for name, text in known["cell"].items():
        if name in now and now[name] != text:
            with suppress(InputError):
                before, after = (dict(_flat(parse(Path(name), t).plain())) for t in (text, now[name]))
                keys = [key for key in {**before, **after} if before.get(key) != after.get(key)]
                if keys:
                    found[name] = keys
    return found


def _texts(folder: Path) -> dict[str, str]:
    found = {}
    with suppress(InputError, OSError, KeyError):
        fields = dict(load(folder / "tango.yaml").items())
        for role in ROLES:
            name = fields[role].text()
            found[name] = (folder / name).read_text(encoding="utf-8")
    return found


def _flat(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        for key, child in value.items():
            yield from _flat(child, f"{path}.{key}" if path else str(key))
    else:
        yield path, value
