"""readings.origin.json beside readings.csv: who made the readings, of which cell and program, and a check value of every row.

It is the index too: `readings` names what is current, `kept` what was measured or simulated there before.

What was changed since is said by key of the cell and by line of the readings; nothing is refused for it.
"""

from __future__ import annotations

import csv
import json
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

from ..records import InputError
from .checked import load, parse
from .readjson import read_json
from .write import write_text

FORMAT = "tango-origin/1"
ROLES = ("machine", "artefact", "strategy")
FEW = 8  # keys or lines that a sentence names
MEASURED, SIMULATED = "readings.csv", "simulated.csv"
RUN = ("program_hash", "plan_hash", "start_utc", "end_utc", "simulated", "left_out_touches")  # of readings.json


def origin_file(readings: Path) -> Path:
    """readings.csv → the file beside it that says where they come from."""
    return readings.with_name(f"{readings.stem}.origin.json")


def current(folder: Path, file: Path | None = None) -> Path:
    """folder of a cell, file that was asked for → readings to take: that file; what was measured; else what was simulated."""
    if file is not None:
        return file
    measured, made = folder / MEASURED, folder / SIMULATED
    waiting = measured.with_name(f"{measured.stem}.partial.csv")
    return made if made.exists() and not measured.exists() and not waiting.exists() else measured


def check_values(text: str) -> list[str]:
    """text of readings.csv → CRC-32 of every row under the header, eight hexadecimal digits each."""
    return [f"{zlib.crc32(line.encode()):08x}" for line in text.splitlines()[1:] if line]


def write_origin(readings: Path, folder: Path, made_by: str, kept: str | None = None, run: Mapping[str, Any] | None = None) -> None:
    """readings as written, folder of their cell, `measured` or `simulated`, where those before are kept, their run → the file
    beside them.
    """
    before = read_origin(readings) or (None if kept is None else read_origin(readings.with_name(kept))) or {}
    text = readings.read_text(encoding="utf-8")
    data = {
        "format": FORMAT,
        "origin": made_by,
        "readings": readings.name,
        "written_utc": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "run": {key: run[key] for key in RUN if key in run} if run is not None else {},
        "header": f"{zlib.crc32(text.splitlines()[0].encode()):08x}",
        "rows": check_values(text),
        "cell": cell_texts(folder),
        "kept": [*before.get("kept", []), *([kept] if kept else [])],
    }
    write_text(origin_file(readings), json.dumps(data, indent=1, ensure_ascii=False) + "\n")


def read_origin(readings: Path) -> dict[str, Any] | None:
    """readings.csv → what is known of them, None when nothing is."""
    with suppress(InputError):
        data = read_json(origin_file(readings), FORMAT)
        if data.get("format") == FORMAT:
            return data
    return None


def by_no_machine(known: Mapping[str, Any]) -> bool:
    """what is known of readings → whether a simulator made them, by itself or as the control of a run."""
    return known.get("origin") == "simulated" or bool((known.get("run") or {}).get("simulated"))


def set_aside(readings: Path) -> str | None:
    """readings.csv about to be written → the name under which those before are kept, by their time; None when there were none."""
    if not readings.exists():
        return None
    stamp = datetime.fromtimestamp(readings.stat().st_mtime, UTC).strftime("%Y%m%dT%H%M%S%f")
    other = readings.with_name(f"{readings.stem}.{stamp}{readings.suffix}")
    if other.exists():
        raise InputError(f"{other}: found a file of that name already; move it away. Nothing was written")
    for beside, moved in ((readings.with_suffix(".json"), other.with_suffix(".json")), (origin_file(readings), origin_file(other))):
        if beside.exists():
            beside.rename(moved)
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


@dataclass(frozen=True)
class Origin:
    """What is on record of readings, and their text as it stands on disk now: each is read once, whoever asks."""

    readings: Path
    known: Mapping[str, Any]  # of the file beside them; empty where nobody knows who made them

    @cached_property
    def lines(self) -> list[str]:
        """→ lines of the readings as they are now. Raises OSError when they cannot be read."""
        return self.readings.read_text(encoding="utf-8-sig").splitlines()


def look_up(readings: Path) -> Origin:
    """readings.csv → their origin."""
    return Origin(readings, read_origin(readings) or {})


def edited_rows(origin: Origin) -> tuple[list[int], int]:
    """origin → lines that are not as they were written (1: the header), and how many rows are gone.

    Nothing where the origin is unknown. A row that stands there once more than it was written is not as it was written.
    """
    known = origin.known
    if not isinstance(known.get("rows"), list):
        return [], 0
    left = Counter(known["rows"])
    strange = []
    for i, line in enumerate(origin.lines):
        value = f"{zlib.crc32(line.encode()):08x}"
        if i == 0:
            if value != known.get("header", value):
                strange.append(1)
        elif line and left[value]:
            left[value] -= 1
        elif line:
            strange.append(i + 1)
    return strange, max(left.total() - sum(line > 1 for line in strange), 0)


def hurried(origin: Origin) -> str:
    """origin → a sentence where the clock of the readings cannot be that of the run; else nothing."""
    run = origin.known.get("run", {})
    with suppress(KeyError, TypeError, ValueError, OSError, StopIteration, csv.Error):
        begun, ended = (datetime.fromisoformat(run[key]) for key in ("start_utc", "end_utc"))
        rows = list(csv.DictReader(origin.lines))
        span, wall = float(rows[-1]["time_s"]) - float(rows[0]["time_s"]), (ended - begun).total_seconds()
        if len({row.get("day", "1") for row in rows}) == 1 and span > 2 * wall + 60:
            return f"time_s spans {span:.0f} s, but the run took {wall:.0f} s: the times are simulated"
    return ""


def changed_keys(origin: Origin, folder: Path) -> dict[str, list[str]]:
    """origin, folder of the cell → by file of the cell the keys that have changed since the readings were made."""
    then = origin.known.get("cell")
    if not isinstance(then, dict):
        return {}
    return {name: [key for key, _, _ in keys] for name, keys in changes(then, cell_texts(folder)).items()}


def changes(then: Mapping[str, str], now: Mapping[str, str]) -> dict[str, list[tuple[str, Any, Any]]]:
    """{file of a cell: its text} before and after → by file that both have the keys that differ, with what they were and are."""
    found: dict[str, list[tuple[str, Any, Any]]] = {}
    for name, text in then.items():
        if name in now and now[name] != text:
            with suppress(InputError):
                before, after = (dict(_flat(parse(Path(name), t).plain())) for t in (text, now[name]))
                keys = [(key, before.get(key), after.get(key)) for key in {**before, **after} if before.get(key) != after.get(key)]
                found |= {name: keys} if keys else {}
    return found


def other_machine(origin: Origin, folder: Path) -> tuple[str, str] | None:
    """origin, folder of a cell → the names of the machine of the readings and of that of the cell; None where they are one.

    None, too, where nobody knows of which machine the readings are.
    """
    texts = origin.known.get("cell")
    then, now = (_machine(each) for each in (texts if isinstance(texts, dict) else {}, cell_texts(folder)))
    then = then or _measured_on(origin.readings)
    return (then, now) if then and now and then != now else None


def _measured_on(readings: Path) -> str:
    with suppress(InputError):
        name = read_json(readings.with_suffix(".json"), "what 'tango run' wrote").get("machine")
        return name if isinstance(name, str) else ""
    return ""


def made_utc(origin: Origin) -> datetime | None:
    """origin of readings → when their run began, or where no run did, when they were written; None: nobody knows."""
    run = origin.known.get("run")
    stamp = run.get("start_utc") if isinstance(run, dict) else None
    with suppress(TypeError, ValueError):
        made = datetime.fromisoformat(stamp or origin.known.get("written_utc"))  # type: ignore[arg-type]
        return made if made.tzinfo else made.replace(tzinfo=UTC)
    return None


def _machine(texts: Mapping[str, str]) -> str:
    for name, text in texts.items():
        with suppress(InputError):
            data = parse(Path(name), text).plain()
            if isinstance(data, dict) and "topology" in data:
                return str(data.get("name", ""))
    return ""


def cell_texts(folder: Path) -> dict[str, str]:
    """folder of a cell, or of readings within it → texts of machine, artefact and strategy by name; {} where it is no cell."""
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
