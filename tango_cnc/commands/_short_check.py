"""`tango compensate --short-check` and `--measured` after one: a few touches, resting on the run a compensation was made from."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import click
import numpy as np
import yaml

from ..compensate import Proposal, as_json, loop, targets
from ..compensate import turned as turn
from ..compensate.look import Look, look
from ..compensate.outcome import Outcome, asked_otherwise, promises, switched
from ..compensate.shares import Before
from ..compensate.short import FEW, Short, by_part, not_all, short_outcome
from ..compensate.space import Held
from ..duration import spoken
from ..estimate import Estimate, estimate
from ..files import read_cell, read_readings, strategy_text, write_text
from ..files.checked import read_text
from ..files.origin import look_up
from ..files.write import dump
from ..judgement import Judgement
from ..noise import honest
from ..records import Cell, InputError, Readings
from ..touches import from_readings
from . import _compensate
from ._common import write_json
from ._present import ended, rows
from ._trust import told, traced
from .check import positioning_feed
from .design import gate_of

DAY = 86_400.0  # s
UNSURE = 0.3  # standard deviation of a share from which the check hardly decides


def is_short(kept: loop.Kept, file: Path) -> bool:
    """compensation, readings → whether they are too few to judge it alone, and the run before it is known."""
    return "made_from" in kept.record and len(rows(file)) < FEW * len(kept.record["readings_rows"])


def made_from(text: str, terms: tuple[Any, ...], degree: int, *, tcp: bool) -> dict[str, Any]:
    """text of the readings, terms, degree, whether with tool center point control → what a short check will rest on."""
    plain = [dict(term) if isinstance(term, Mapping) else term for term in terms]
    return {"readings": text, "terms": plain, "degree": degree, "tcp": tcp}


def _asked(cell: Cell, kept: loop.Kept, days: float, tcp: bool | None) -> Short:
    """cell, compensation, days since the run it was made from, --tcp → short check made ready. Raises InputError."""
    known = kept.record.get("made_from")
    if known is None:
        raise InputError(
            f"--short-check: found compensation {kept.number}, which an older version proposed: it does not have the readings "
            "that it was made from; allowed: the whole strategy ('tango run'), or propose anew"
        )
    readings = read_readings(kept.folder / loop.MADE_FROM, cell.machine, cell.artefact)
    result = honest(estimate(cell.machine, cell.artefact, readings, tuple(known["terms"]), known["degree"]))
    return Short(kept, Before(result, days), held_of(cell, kept, result.model.coefficients), bool(tcp), bool(known["tcp"]))


def held_of(cell: Cell, kept: loop.Kept, coefficients: tuple[Any, ...]) -> list[Held]:
    """cell, compensation, coefficients of the estimate → what its target holds."""
    module = targets.load(kept.record["target"])
    limits = _compensate.volume_of(_compensate.volume_text(kept.record), cell.machine)
    request = targets.Request(cell.machine, limits, targets.options(module, _compensate.settings_of(kept.record)), coefficients)
    found: list[Held] = module.held(request)
    return found


def _days(kept: loop.Kept, until: str | None) -> float:
    """compensation, UTC of the check (None: now) → days since it was proposed."""
    begin = datetime.fromisoformat(str(kept.record["created_utc"]))
    end = datetime.now(begin.tzinfo) if until is None else datetime.fromisoformat(until)
    return (end - begin).total_seconds() / DAY


def judged(cell: Cell, kept: loop.Kept, file: Path, tcp: bool | None) -> tuple[Outcome, list[str]]:
    """cell, compensation, readings of a short check, --tcp → outcome, places that act with tool center point control only."""
    few = read_readings(file, cell.machine, cell.artefact)
    own = file.parent if (file.parent / loop.CELL).exists() else cell.folder
    for line in told(traced(Judgement("trustworthy"), look_up(file), own)):
        click.echo(line, err=True)
    asked = _asked(cell, kept, _days(kept, ended(file)), tcp)
    places = switched(kept.record, asked.held)
    if places and tcp is None:
        raise InputError(neither(kept.number, places))
    touches = from_readings(cell.machine, cell.artefact, few)
    found = short_outcome(asked, touches)
    if places and found.verdict != "kept":
        other = Short(kept, asked.before, asked.held, not asked.tcp, asked.first_tcp)
        found = asked_otherwise(found, short_outcome(other, touches), tcp=asked.tcp)
    return found, places


def by_place(found: Outcome, cell: Cell, kept: loop.Kept, readings: Readings, tcp: bool) -> Outcome:
    """outcome of a run that determines everything, cell, compensation, readings, --tcp → the same, unless a part does not act."""
    if found.verdict != "kept" or "made_from" not in kept.record:
        return found
    asked = _asked(cell, kept, _days(kept, None), tcp)
    return not_all(found, by_part(asked, from_readings(cell.machine, cell.artefact, readings)), kept)


def neither(number: int, places: list[str]) -> str:
    """compensation, places that act with tool center point control only → the sentence that asks how the run was made."""
    more = f" and {len(places) - 1} more" if len(places) > 1 else ""
    return (
        f"--measured: found neither --tcp nor --no-tcp, and compensation {number} changes {places[0]}{more}, which act with tool "
        "center point control only; allowed: --no-tcp when the second run was made without it, as the probing programs of this "
        "project are; --tcp when with it"
    )


def choose(cell: Cell, number: int, options: dict[str, Any]) -> int:
    """cell, compensation, options → writes the cell of a short check, and says what to do with it."""
    kept = loop.one(cell.folder, number)
    loop.check(kept.folder)
    asked = _asked(cell, kept, _days(kept, None), options["tcp"])
    before, _ = promises(kept.record)
    found = look(asked, cell, before, positioning_feed(cell), gate_of(cell), options["minutes"])
    place = options["out"] or cell.folder / loop.FOLDER / f"{loop.CHECK}{number:03d}"
    _write(cell, found, place)
    data = {
        "format": "tango-short-check/1",
        "compensation": number,
        "folder": str(place),
        "touches": len(found.plan.touches),
        "indexations": len(found.cell.strategy.indexations),
        "time_s": round(found.seconds, 1),
        "std_of_share": {name: round(std, 3) for name, std in zip(found.names, found.std, strict=True)},
        "too_small": list(found.small),
    }
    if not write_json(options["json_file"], data):
        click.echo(_text(cell, kept, asked, found, place))
    return 0


def turned(cell: Cell, kept: loop.Kept, text: str) -> tuple[Outcome, list[str]]:
    """cell, compensation, --turned → outcome, places that act with tool center point control only. Raises InputError."""
    asked = _asked(cell, kept, _days(kept, None), tcp=True)
    if not turn.alone(asked):
        raise InputError(
            f"--turned: found compensation {kept.number}, which changes tables as well; allowed: one of kinematics alone. For the "
            f"others: 'tango compensate --short-check {kept.number}'"
        )
    axis, angle, values = turn.of_text(text)
    expected = turn.turn(asked, axis, angle, fixture=_fixture(kept.record))
    if set(values) != set(expected.letters):
        raise InputError(f"--turned: found {', '.join(values)}; allowed: {' and '.join(expected.letters)}, across the axis {axis}")
    found = turn.judged(asked, expected, np.array([values[letter] for letter in expected.letters]))
    return found, switched(kept.record, asked.held)


def _fixture(record: Mapping[str, Any]) -> bool:
    """record → whether a work offset alone holds the center: its axes keep their directions while the table turns (G54.2)."""
    options = record["options"]
    return options.get("vectors") == "no" and str(options.get("fixture_offset", "unused")).startswith("G")


def by_hand(cell: Cell, proposal: Proposal, result: Estimate, *, tcp: bool) -> list[str]:
    """cell, proposal, its estimate, --tcp → steps by which a person sees whether kinematics alone act; none where tables change."""
    record = as_json(proposal)
    asked = Short(loop.Kept(0, cell.folder, record), Before(result, 0.0), proposal.held, tcp=True, first_tcp=tcp)
    if not turn.alone(asked):
        return []
    fixture = _fixture(record)
    found = turn.usual(asked, fixture=fixture)
    if found is None:
        return [
            "No touch without tool center point control sees these numbers, and no table turns that could show them by hand: "
            "run the probing program with it on, and state --tcp with --measured"
        ]
    angle, here = f"{np.degrees(found.angle):g}", f"tango compensate -C {shlex.quote(str(cell.folder))}"
    first, second = (
        " ".join(f"{a} {v:+.4f}" for a, v in zip(found.letters, at, strict=True)) for at in (found.without, found.within)
    )
    mode = (
        f"with G54.2 on, in {proposal.request.options['fixture_offset']}, a boss or bore that is the zero of the part"
        if fixture
        else "with tool center point control on, in coordinates that turn with the table, a boss or bore on the table"
    )
    return [
        "Programs of this project touch without tool center point control: 'tango run' does not see these numbers. "
        f"Look by hand: {mode}. Find its center by the control's own cycle at {found.axis} 0, and again at {found.axis} {angle}. "
        f"The second center minus the first is {second} mm where the numbers act, and {first} mm where they do not.",
        f"Judge it: {here} --measured {loop.NUMBER} --turned {found.axis}={angle}:"
        + ",".join(f"{letter}=MM" for letter in found.letters)
        + " (the second minus the first)",
    ]


def _write(cell: Cell, found: Look, place: Path) -> None:
    """Writes a cell with the files of this one, and the touches of the check as its strategy."""
    if place.exists() and (place / "readings.csv").exists():
        raise InputError(f"-o: found {place}, which has readings already; allowed: another folder (-o DIR), or take it away")
    place.mkdir(parents=True, exist_ok=True)
    for file in sorted((*cell.folder.glob("*.yaml"), *cell.folder.glob("*.py"))):
        shutil.copyfile(file, place / file.name)
    data = yaml.safe_load(read_text(cell.folder / loop.CELL))
    for key in ("machine", "artefact"):
        shutil.copyfile(cell.folder / data[key], place / f"{key}.yaml")
    data |= {key: f"{key}.yaml" for key in ("machine", "artefact", "strategy")}
    write_text(place / loop.CELL, dump(data))
    write_text(place / "strategy.yaml", strategy_text(found.cell.strategy))
    read_cell(place)


def _text(cell: Cell, kept: loop.Kept, asked: Short, found: Look, place: Path) -> str:
    how = ""
    if switched(kept.record, asked.held):
        how = " --tcp" if asked.tcp else " --no-tcp"
    known = ", ".join(f"{name} to ± {200 * std:.0f} %" for name, std in zip(found.names, found.std, strict=True))
    lines = [
        f"→ {place}: {len(found.plan.touches)} touches at {len(found.cell.strategy.indexations)} indexations, "
        f"predicted time {spoken(found.seconds)}",
        f"by these it will be known how much of each part acts: {known} (95 %)",
    ]
    if max(found.std) > UNSURE:
        lines.append("that decides nothing of a part that is known to less than ± 60 %: allow more time with --minutes")
    if found.small:
        listed = ", ".join(found.small[:4]) + (f" and {len(found.small) - 4} more" if len(found.small) > 4 else "")
        lines.append(f"not asked for, as each takes little of the error away: {listed}")
    return "\n".join(
        [
            *lines,
            f"  tango run -C {place}",
            f"  tango compensate -C {cell.folder} --measured {kept.number} --readings {place / 'readings.csv'}{how}",
        ]
    )
