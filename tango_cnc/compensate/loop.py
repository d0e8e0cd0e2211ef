"""Proposed → written → measured → kept, or rolled back by a person: the folder `compensations/` of a cell.

Every compensation has a folder of its own with the files for the control, `undo/` with the same files as they were before,
`steps.txt` and `compensation.json`, which holds all values and texts once more. What happens to it is added to
`compensations/history.jsonl`, one line an event; no line is ever changed.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..files import write_text
from ..files.cell import read_machine
from ..files.checked import printable, read_bytes, read_text
from ..files.readjson import parse_json
from ..files.shape import misfit
from ..loaded import IN_CONTROL, Happened, Holds, holds
from ..records import InputError, TangoError
from .forms import of_another
from .proposal import FORMAT, Proposal, as_json
from .space import Held
from .targets import SIGN_TRIAL, unconfirmed
from .whose import axes_of, travel_of

FOLDER, HISTORY, RECORD = "compensations", "history.jsonl", "compensation.json"
CHECK = "check-"  # with the number: the cell of a short check, beside the compensation
STEPS, CELL = "steps.txt", "tango.yaml"
NUMBER = "{N}"
MADE_FROM = "made-from.csv"  # the readings of the run that a compensation was made from
ALONG = "Centers, directions and component errors are written along the axes of the control. Jog each axis a little, and see"
REMARK = "SIMULATED.txt"  # in a folder whose readings no machine has made: many files for controls have no comments
SIMULATED = "MADE FROM SIMULATED READINGS: load this into no machine"
TRIED_ON = (
    "Then the same for a center or direction ({place}): these act with tool center point control only, so touch with it on, by a "
    "program of your own, and state --tcp with --sign-of. Touches without it, as those of the probing programs, stay undecided"
)
UNCONFIRMED = "NOT CONFIRMED. CHECK EACH ON YOUR CONTROL BEFORE YOU WRITE:"  # below the steps: the screen is not at the machine
RECORDS = 200  # of other compensations that are looked at, where a file differs
FIGURE = {"value": float, "low?": float, "high?": float}
EVENT = {
    "utc": str,
    "compensation": int,
    "event": str,
    "target": str,
    "text?": str,
    "measured_um?": float,
    "promise?": {},
    "tcp?": bool,
}
SHAPE = {
    **dict.fromkeys(("format", "digest", "target", "created_utc"), str),
    "files": {"*": str},
    "undo": {"*": str},
    "values": [{"place": str, "present": float, "new": float, "uncorrected?": float}],
    "promise": {f"{name}_{when}_um": FIGURE for name in ("rms", "p95") for when in ("before", "after")},
    "options": {},
    "volume": {"*": [float]},
    "steps": [str],
    "on_paper?": [str],
    "simulated?": str,
    "readings_rows?": [str],
    "made_from?": {"readings": str, "terms": list, "degree": int, "tcp": bool, "machine?": str, "artefact?": str},
}


@dataclass(frozen=True)
class Kept:
    """A compensation on disk."""

    number: int
    folder: Path
    record: dict[str, Any]


def store(
    cell: Path,
    proposal: Proposal,
    now: str,
    folder: Path | None = None,
    rows: Sequence[str] = (),
    *,
    simulated: bool = False,
    trial: bool = False,
    made_from: Mapping[str, Any] | None = None,
    by_hand: Sequence[str] = (),
) -> Kept:
    """folder of a cell, proposal, UTC, check values of the rows of its readings → its folder, whole; its first line of history.

    `simulated`: the readings come from no machine. Then steps, record and a file beside them say so first. `trial`: it is a sign
    trial itself. `made_from`: text of the readings, terms, degree, whether with TCP; a short check rests on it.
    `by_hand`: steps by which a person sees whether kinematics act, where touches cannot; `NUMBER` in them becomes its number.
    """
    number = max((k.number for k in found(cell)), default=0) + 1
    place = folder or cell / FOLDER / f"{number:03d}-{proposal.target}"
    if place.exists() and any(place.iterdir()):
        raise InputError(f"-o: found {place}, which is not empty; allowed: a new folder")
    asked = _asked(cell, proposal, trial=trial)
    if folder is None and made_from is not None:
        asked += afterwards(cell, number, proposal, [text.replace(NUMBER, str(number)) for text in by_hand])
    steps = [f"{i}. {text}" for i, text in enumerate(asked, 1)]
    first = {"simulated": SIMULATED} if simulated else {}
    record = first | as_json(proposal) | {"created_utc": now, "steps": steps, "files": proposal.files, "undo": proposal.undo}
    if doubts := unconfirmed(proposal.module):
        record["on_paper"] = [UNCONFIRMED, *(f"- {text}" for text in doubts)]
    record["readings_rows"] = list(rows)
    if made_from is not None:
        record["made_from"] = dict(made_from)
    record["digest"] = digest(record)
    for name, text in proposal.files.items():
        write_text(place / name, text)
    for name, text in proposal.undo.items():
        write_text(place / "undo" / name, text)
    for name, text in _beside(record).items():
        write_text(place / name, text)
    kept = Kept(number, place, record)
    if folder is None:
        note(cell, kept, now, "proposed", promise=record["promise"])
    return kept


def _asked(cell: Path, proposal: Proposal, *, trial: bool) -> list[str]:
    """folder of a cell, proposal → what a person does, in order; for a sign trial without the step that asks for one."""
    always, switched = (_most(proposal, tcp=tcp) for tcp in (False, True))
    place = always or switched or proposal.held[0].table
    given = [(name, value) for name, value in proposal.request.options.items() if value != proposal.module.OPTIONS[name].default]
    said = (
        "No source that was read states the signs, so do the sign trial first: "
        f"tango compensate -C {shlex.quote(str(cell))} --target {proposal.target} --sign-trial {shlex.quote(place)}"
        + "".join(f" --set {shlex.quote(f'{name}={value}')}" for name, value in given)
        + (f". {TRIED_ON.format(place=switched)}" if switched else "")
    )
    steps = [said if text == SIGN_TRIAL else text for text in proposal.module.steps(proposal.request)]
    if said_unit := unit_of(proposal.held):
        steps.insert(0, said_unit)
    if proposal.along:
        steps.insert(0, f"{ALONG} that {proposal.along}. If it is not so, load nothing, and mend machine.yaml.")
    return [text for text in steps if text != said] if trial else steps


def _most(proposal: Proposal, *, tcp: bool) -> str:
    """proposal, whether what acts with tool center point control only is meant → the place or table that changes most; or ''."""
    pairs = [(abs(float(c)), h) for h, c in zip(proposal.held, proposal.fit.change, strict=True) if c and h.tcp is tcp]
    most = max(pairs, key=lambda pair: pair[0])[1] if pairs else None
    return "" if most is None else most.table if most.at is not None else most.place


def unit_of(held: Sequence[Held]) -> str:
    """entries → a sentence with the unit of their lengths; '' where none of them is a length."""
    if not any("mm" in h.unit for h in held):
        return ""
    return (
        "Lengths in these files are in millimeters. A control that is set to inches would take them as inches, 25.4 times as much: "
        "load nothing there."
    )


def afterwards(cell: Path, number: int, proposal: Proposal, by_hand: Sequence[str]) -> list[str]:
    """cell, number, proposal, steps for kinematics alone → what a person does once the files are in the control, in order."""
    here = f"tango compensate -C {shlex.quote(str(cell))}"
    place = cell / FOLDER / f"{CHECK}{number:03d}"
    own, readings = shlex.quote(str(place)), shlex.quote(str(place / "readings.csv"))
    changed = [h for h in proposal.held if proposal.numbers[h.place] != proposal.present[h.place]]
    if by_hand:
        return [f"Note it: {here} --written {number}", *by_hand]
    how = " --no-tcp" if any(h.tcp for h in changed) else ""
    return [
        f"Note it: {here} --written {number}",
        f"Look whether it has helped, by a few touches that it changes most: {here} --short-check {number}, then "
        f"tango run -C {own}, then {here} --measured {number} --readings {readings}{how}",
    ]


def _beside(record: Mapping[str, Any]) -> dict[str, str]:
    """record → {name: text} of the files beside those for the control: for the person at the machine, and the record itself."""
    remark = [record["simulated"]] if "simulated" in record else []
    return {
        STEPS: "".join(f"{line}\n" for line in (*remark, *record["steps"], *record.get("on_paper", ()))),
        **({REMARK: f"{record['simulated']}\n"} if remark else {}),
        **({MADE_FROM: record["made_from"]["readings"]} if "made_from" in record else {}),
        RECORD: json.dumps(record, indent=1, ensure_ascii=False) + "\n",
    }


def digest(record: dict[str, Any]) -> str:
    """record → hash of all that it says, the hash itself left out."""
    rest = {key: value for key, value in record.items() if key != "digest"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True, ensure_ascii=False).encode()).hexdigest()[:16]


def note(cell: Path, kept: Kept, now: str, event: str, **more: Any) -> None:
    """cell, compensation, UTC, what happened → one more line of the history."""
    line = {"utc": now, "compensation": kept.number, "target": kept.record["target"], "event": event, **more}
    file = cell / FOLDER / HISTORY
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a", encoding="utf-8", newline="\n") as out:
        out.write(json.dumps(line, ensure_ascii=False) + "\n")


def history(cell: Path, until: str = "") -> list[dict[str, Any]]:
    """cell, before which moment (UTC; '': any) → events in their order. Raises InputError for a malformed line."""
    file = cell / FOLDER / HISTORY
    if not file.exists():
        return []
    result = []
    for i, line in enumerate(read_text(file).splitlines(), 1):
        try:
            event = parse_json(line)
            wrong = misfit(event, EVENT)
        except ValueError as error:
            wrong = str(error)
        if wrong:
            raise InputError(f"{file}:{i}: {printable(wrong, 200)}; allowed: an event as this program writes it. Mend that line")
        result.append(event)
    return [e for e in result if not until or e["utc"][:19] < until[:19]]


def state(cell: Path, number: int) -> str:
    """cell, number → proposed, written, kept, kept as far as seen, not as promised, undecided, no help, rolled back."""
    return next((e["event"] for e in reversed(history(cell)) if e["compensation"] == number), "proposed")


def found(cell: Path) -> Iterator[Kept]:
    """cell → its compensations in their order."""
    for folder in sorted((cell / FOLDER).glob("[0-9][0-9][0-9]-*")):
        if (folder / RECORD).exists():
            yield Kept(int(folder.name[:3]), folder, load(folder))


def one(cell: Path, number: int) -> Kept:
    """cell, number → that compensation. Raises InputError when there is none."""
    if not (cell / CELL).exists():
        raise InputError(f"{cell}: found no {CELL}; allowed: the folder of a cell, given with -C")
    every = list(found(cell))
    for kept in every:
        if kept.number == number:
            return kept
    listed = ", ".join(str(k.number) for k in every) or "none yet; 'tango compensate --target NAME' makes one"
    raise InputError(f"found no compensation {number} in {cell / FOLDER}; allowed: {listed}")


def load(folder: Path) -> dict[str, Any]:
    """folder of a compensation → its record. Raises InputError when it is not as it was written."""
    file = folder / RECORD
    try:
        record: dict[str, Any] = parse_json(read_text(file))
        whole = not misfit(record, SHAPE) and record["format"] == FORMAT and record["digest"] == digest(record)
        whole = whole and all(len(limits) == 2 for limits in record["volume"].values())
        whole = whole and all(_plain(name) for part in ("files", "undo") for name in record[part])
    except InputError:
        if file.exists():
            raise
        raise InputError(f"{folder}: found no {RECORD}; allowed: a folder that 'tango compensate' has written") from None
    except ValueError:
        whole = False
    if not whole:
        raise InputError(f"{file}: found a record that has been changed or cut off; do not use this folder: propose anew")
    return record


def _plain(name: str) -> bool:
    return re.fullmatch(r"[\w-][\w.-]{0,99}", name) is not None


def check(folder: Path, cell: Path | None = None) -> dict[str, Any]:
    """folder of a compensation, a cell → its record, every file compared with it, ends of lines left aside.

    Raises TangoError that names the first line that differs, and what in the file speaks of another machine or compensation; those
    of the cell and of its neighbours are looked at. A file that differs is not to be loaded into a control.
    """
    record = load(folder)
    for written, base in ((record["files"] | _beside(record), folder), (record["undo"], folder / "undo")):
        for name, text in written.items():
            file = base / name
            if not file.exists():
                raise TangoError(f"{file}: found no such file; do not load this folder: propose anew")
            try:
                _same(file, text)
            except TangoError as error:
                if (why := _whose(file, record, text, cell)) and base != folder / "undo" and name in record["files"]:
                    raise TangoError(f"{error}. {why}") from None
                raise
        known_names = {*written, "undo"}
        there = base.iterdir() if base.is_dir() else ()  # of files without undo nothing is written there
        if strangers := sorted(f.name for f in there if f.name not in known_names):
            raise TangoError(f"{base}: found {', '.join(strangers)}, which this program has not written; take it away first")
    return record


def _whose(file: Path, record: Mapping[str, Any], text: str, cell: Path | None) -> str:
    """file that differs, record, its text as written, a cell → whose it is, as far as it can be recognized; '' where it cannot."""
    there = read_bytes(file).decode("utf-8", "replace")
    plain = there.replace("\r\n", "\n")
    if plain == record["undo"].get(file.name):
        return "It is the file of undo/, with the numbers before: the compensation is not in the control, or was taken out"
    folders = [
        file.parent.parent,
        *((cell / FOLDER, *sorted(cell.resolve().parent.glob(f"*/{FOLDER}"))) if cell is not None else ()),
    ]
    for place in itertools.islice((p for folder in folders for p in sorted(folder.glob(f"*/{RECORD}"))), RECORDS):
        with suppress(TangoError):
            other = load(place.parent)
            if other["digest"] != record["digest"] and plain == other["files"].get(file.name):
                return f"It is the file of {place.parent}, for the machine {other.get('machine')!r}"
    if why := of_another(text, there, travels_of(record)):
        return f"This is no slip of a digit, but a file of another machine or of another compensation: {why}"
    return ""


def travels_of(record: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """record of a compensation → {axis: its travel, mm or degrees} of the machine that it was made for, where that is on record."""
    text = record.get("made_from", {}).get("machine")
    if text is None:
        return {}
    with suppress(TangoError):
        machine = read_machine(Path("machine.yaml"), text)
        found = {axis: travel_of(machine, axis) for axis in axes_of(machine)}
        return {axis: travel for axis, travel in found.items() if travel is not None}
    return {}


def _same(file: Path, text: str) -> None:
    try:
        there = read_bytes(file).decode("utf-8")
    except UnicodeDecodeError:
        raise TangoError(f"{file}: found bytes that are no text; do not load it: propose anew") from None
    found_lines, wanted = re.split("\r\n|\n", there), re.split("\r\n|\n", text)
    for i in range(max(len(found_lines), len(wanted))):
        a = found_lines[i] if i < len(found_lines) else "the end of the file"
        b = wanted[i] if i < len(wanted) else "the end of the file"
        if a != b:
            found, written = printable(repr(a), 200), printable(repr(b), 200)
            raise TangoError(f"{file}:{i + 1}: found {found}; written was {written}; do not load this folder: propose anew")


def in_control(cell: Path) -> Kept | None:
    """cell → the compensation that is noted as in the control, the last one where there are several."""
    there = holding(cell)
    return None if there is None else next(kept for kept in found(cell) if kept.number == there.number)


def happened(cell: Path, until: str = "") -> list[Happened]:
    """cell, before which moment (UTC; '': any) → events of its compensations, oldest first."""
    return [Happened(e["utc"], e["compensation"], e["target"], e["event"]) for e in history(cell, until)]


def holding(cell: Path, until: str = "") -> Holds | None:
    """cell, before which moment (UTC; '': now) → what its control holds then, of the compensations whose folders are there."""
    numbers = {kept.number for kept in found(cell)}
    return holds(e for e in happened(cell, until) if e.number in numbers)


def other_control(cell: Path, kept: Kept) -> Kept | None:
    """cell, compensation → one for another target that is noted as in the control; what both hold would be taken away twice."""
    for one_more in found(cell):
        if one_more.record["target"] != kept.record["target"] and state(cell, one_more.number) in IN_CONTROL:
            return one_more
    return None


def ignored(cell: Path, rows: Sequence[str], ended: str | None) -> tuple[Kept, str] | None:
    """cell, check values of rows of readings, when they ended (UTC) → compensation in the control that they do not contain, why."""
    kept = in_control(cell)
    why = "" if kept is None else older(kept.record, rows, ended)
    return (kept, why) if kept is not None and why else None


def before(cell: Path, record: Mapping[str, Any], rows: Sequence[str], ended: str | None) -> str:
    """cell, record of the compensation that its control holds, check values of rows of readings, when they ended (UTC) → why the
    readings cannot contain it; '' if they can.

    Readings that an earlier compensation of this cell was made from are from before this one, too.
    """
    made = str(record["created_utc"])
    if why := older(record, rows, ended):
        return why
    for kept in found(cell):
        if str(kept.record["created_utc"]) < made and (why := older(kept.record, rows, None)):
            return f"{why}, in this case compensation {kept.number}, which is older than the one in the control"
    return ""


def older(record: Mapping[str, Any], rows: Sequence[str], ended: str | None) -> str:
    """record, check values of rows of readings, when they ended (UTC) → why they cannot be of a second run; '' if they can."""
    same = len(set(rows) & set(record.get("readings_rows", ())))
    if rows and 2 * same >= len(rows):
        return f"{same} of {len(rows)} rows are those that the compensation was made from"
    if ended is not None and ended[:19] < str(record["created_utc"])[:19]:
        return f"they ended at {ended}, before the compensation was proposed ({record['created_utc']})"
    return ""
