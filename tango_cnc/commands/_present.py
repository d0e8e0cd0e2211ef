"""What the control holds while it is measured, and whether readings can contain it: what they lack would be corrected twice."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import click

from ..compensate import loop, whose
from ..compensate.frame import along_the_drawing
from ..compensate.hidden import Present, of_record, uncorrected
from ..files.checked import load, read_text
from ..files.origin import check_values, current, read_origin
from ..files.then import with_texts
from ..records import Cell, InputError
from ._handed import pasted

OWNER = re.compile(r"^\s*#\s*machine\s*[:=]\s*(\S.*)$", re.MULTILINE | re.IGNORECASE)
DAY = 86_400.0  # s
WANTED = (
    "a folder that 'tango compensate' has written, or a YAML file with a line `place: number` for every number of the "
    "control (--dry-run --json - lists places of a target)"
)


def present(cell: Cell, options: dict[str, Any]) -> tuple[Present | None, Mapping[str, Any]]:
    """cell, options → what the control holds, record of the compensation that was given (empty without one).

    Raises InputError where it is not stated though a compensation is in the control, for numbers of another machine, and where the
    readings cannot contain it. A sign trial changes one place, whatever the readings contain.
    """
    folder = cell.folder
    source: Path | None = options["present"]
    last = loop.in_control(folder)
    none = source is None or str(source) == "none"
    if none and last is not None and last.record["target"] != options["target"] and not options["dry_run"]:
        raise InputError(
            f"--present: found none, and compensation {last.number} ({last.record['target']}) is in the control: together "
            f"with one for {options['target']} the same errors would be corrected twice. Nothing was written; allowed: when "
            f"{last.number} has been taken out, 'tango compensate --rolled-back {last.number} --reason TEXT' "
            "first; --dry-run to see what it would be"
        )
    if source is None:
        if last is not None:
            raise InputError(
                f"--present: found nothing, and compensation {last.number} ({last.record['target']}) is in the control; "
                f"allowed: --present {pasted(last.folder)} when the readings were made with it, --present none when without"
            )
        return None, {}
    if str(source) == "none":
        if last is not None and not options["despite"]:
            _without(folder, last, current(folder, options["file"]))
        return Present({}, {}), {}
    readings, judged = current(folder, options["file"]), options["trial_of"] is None
    if source.is_dir():
        record = loop.check(source)
        whose_is(loop.Kept(0, source, record), cell, "--present: ")
        if record["target"] != options["target"]:
            raise InputError(f"--present: found a compensation for {record['target']}; allowed: one for {options['target']}")
        if last is not None and last.record["digest"] != record["digest"]:
            raise InputError(
                f"--present: found {source}, and compensation {last.number} ({last.record['target']}) is in the control; allowed: "
                f"--present {pasted(last.folder)}, or 'tango compensate --rolled-back {last.number} --reason TEXT' when it is "
                "not in it any more"
            )
        if judged and readings.exists() and (why := loop.before(folder, record, rows(readings), ended(readings))):
            raise InputError(_lacking(folder, source, record, readings, why))
        return of_record(record), record
    numbers = values_of(source, cell.machine.name)
    if judged:
        contained(folder, options, "What they find would be added to numbers that take it away already")
        click.echo(
            f"note: nobody knows whether {readings} was made with the numbers of {source} in the control. If it was not, the same "
            "errors are corrected twice",
            err=True,
        )
    cut = not read_text(source).endswith(("\n", "\r"))
    if last is None or last.record["target"] != options["target"]:
        return Present(numbers, {}, cut), {}
    return Present(numbers, uncorrected(last.record), cut), {}


def _without(folder: Path, last: loop.Kept, readings: Path) -> None:
    """cell, compensation in its control, readings that somebody says were made without it → nothing. Raises InputError where they
    ended after it had been noted as written, and where nothing says when they were made.
    """
    since = next(
        (e["utc"] for e in reversed(loop.history(folder)) if (e["compensation"], e["event"]) == (last.number, "written")), ""
    )
    if not since or not readings.exists():
        return
    when = ended(readings)
    known = when is not None or loop.before(folder, last.record, rows(readings), None)
    if not known or (when is not None and when[:19] > since[:19]):
        made = f"which ended at {when}, after" if when is not None else "and nothing beside it says when it was made;"
        raise InputError(
            f"--present: found none, and {readings}, {made} compensation {last.number} had been noted as in "
            f"the control ({since}); allowed: --present {pasted(last.folder)} where it was in the control while they were made; "
            f"'tango compensate --rolled-back {last.number} --reason TEXT' where it had been taken out; --despite where it was "
            "switched off for this run"
        )


def contained(folder: Path, options: dict[str, Any], twice: str = "The program would correct the same errors once more") -> None:
    """cell, options → nothing. Raises InputError where readings lack what is in the control: it would be corrected again."""
    source = current(folder, options["file"])
    if source.exists() and (missed := loop.ignored(folder, rows(source), ended(source))):
        kept, why = missed
        raise InputError(
            f"--readings: found {source}: {why}, and compensation {kept.number} ({kept.record['target']}) is in the control. "
            f"{twice}. Nothing was written; allowed: readings made with the compensation in the control (--readings FILE), or "
            f"'tango compensate --rolled-back {kept.number} --reason TEXT' when it has been taken out"
        )


def days_between(kept: loop.Kept, until: str | None) -> float:
    """compensation, UTC of later readings (None: now) → days since it was proposed."""
    begin = datetime.fromisoformat(str(kept.record["created_utc"]))
    end = datetime.now(begin.tzinfo) if until is None else datetime.fromisoformat(until)
    return (end - begin).total_seconds() / DAY


def ended(readings: Path) -> str | None:
    """readings → UTC at which their run ended, or at which they were written; None where nobody knows."""
    known = read_origin(readings) or {}
    return (known.get("run") or {}).get("end_utc") or known.get("written_utc")


def rows(readings: Path) -> list[str]:
    """readings → check value of every row."""
    return check_values(readings.read_text(encoding="utf-8-sig"))


def _lacking(folder: Path, source: Path, record: Mapping[str, Any], readings: Path, why: str) -> str:
    """cell, folder of the compensation in the control, its record, readings that lack it, why → what to do."""
    later = [
        file.name
        for file in sorted(folder.glob("*.csv"))
        if (when := ended(file)) is not None
        and when[:19] >= str(record["created_utc"])[:19]
        and not loop.before(folder, record, rows(file), when)
    ]
    those = f"; made after it in the folder '{folder}' are {', '.join(later)}" if later else ""
    return (
        f"--present: found {source} and {readings}: {why}. These readings were made without it: what it takes away would be taken "
        f"away twice. Nothing was written; allowed: readings made with it in the control, with --readings FILE{those}. "
        f"'tango run --readings after.csv' measures again"
    )


def whose_is(kept: loop.Kept, cell: Cell, where: str = "") -> None:
    """compensation, cell, what a person gave → nothing. Raises InputError where it was made for another machine."""
    texts = {role: text for role, text in kept.record.get("made_from", {}).items() if role == "machine"}
    then = with_texts(cell, texts, kept.folder / loop.MADE_FROM).machine if texts else None
    if why := whose.of_record(kept.record, cell.machine, then):
        name = cell.machine.name
        raise InputError(
            f"{where}{kept.folder}: found {why}; allowed: one that was proposed for {name!r}. Where its files are in the "
            f"control of {name!r}, load there what it had before"
        )
    if why := along_the_drawing(kept.record, cell.machine):
        raise InputError(
            f"{where}{kept.folder}: found centers, directions or component errors that an earlier version wrote along the axes of "
            f"machine.yaml; allowed: those along the axes of the control: {why}. In the control they act the wrong way "
            "round. If they are in it, enter there what it held before the first of them, and note it: 'tango compensate "
            "--rolled-back N --reason TEXT'. Then propose anew, with readings made after that"
        )


def values_of(source: Path, machine: str) -> dict[str, float]:
    """YAML file of {place: number}, name of the machine of the cell → the control's numbers.

    A key `machine`, or a comment `# machine: NAME`, states whose they are. Raises InputError for those of another one, and for what
    is no number.
    """
    try:
        nodes = dict(load(source).items())
        own = nodes.pop("machine").text() if "machine" in nodes else None
        numbers = {key: node.position() for key, node in nodes.items()}
    except InputError as error:
        raise InputError(
            f"--present: found {source}, which is no file of numbers of a control ({error}); allowed: {WANTED}"
        ) from None
    stated = OWNER.search(read_text(source))
    own = own or (stated[1].strip() if stated is not None else None)
    if own is not None and own != machine:
        raise InputError(
            f"--present: {source}: found numbers of the machine {own!r}, and the cell is of {machine!r}; allowed: those of "
            f"{machine!r}, read back from its control"
        )
    if own is None:
        click.echo(
            f"note: {source} does not say of which machine its numbers are; a line 'machine: {machine}' would, and those of "
            "another machine would be refused",
            err=True,
        )
    return numbers
