"""`tango compensate --short-check` and `--measured` after one: a few touches, resting on the run a compensation was made from."""

from __future__ import annotations

import itertools
import shutil
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import click
import numpy as np
import yaml

from ..compensate import Proposal, as_json, loop, targets
from ..compensate import turned as turn
from ..compensate.loads import files_of
from ..compensate.look import DECIDES, Look, look
from ..compensate.outcome import Outcome, asked_otherwise, promises, switched
from ..compensate.rows import added, lines_of, not_met, rows_of
from ..compensate.seen import WITHIN
from ..compensate.shares import Before
from ..compensate.short import FEW, WHOLE, Short, changes, short_outcome, whole_outcome
from ..compensate.space import Held
from ..compensate.stray import without_strays
from ..duration import spoken
from ..estimate import Estimate, estimate
from ..files import read_cell, read_readings, strategy_text, write_text
from ..files.checked import read_text
from ..files.nightly import read_nightly
from ..files.origin import look_up
from ..files.then import at_that_time, machine_and_artefact, moved, with_texts
from ..files.write import dump
from ..judgement import Judgement
from ..judging import traced
from ..loaded import AS_SEEN, BACK, HELPS, KEPT
from ..noise import honest
from ..records import Cell, InputError, Readings
from ..touches import Touches, from_readings
from . import _compensate
from ._common import asks_for_a_finger, write_json
from ._handed import pasted, printed
from ._present import days_between, ended, rows, whose_is
from ._trust import told
from .check import positioning_feed
from .design import gate_of

HOUR = 60.0  # minutes: no short check takes longer


def is_short(cell: Cell, kept: loop.Kept, file: Path) -> bool:
    """cell, compensation, readings → whether the run before it is known, and they are too few to judge it alone, or those of a
    short check of it, however many that has.
    """
    if "made_from" not in kept.record:
        return False
    few = len(rows(file)) < FEW * len(kept.record["readings_rows"])
    return few or _check_of(cell, kept, read_readings(file, cell.machine, cell.artefact)) is not None


def _check_of(cell: Cell, kept: loop.Kept, readings: Readings) -> Path | None:
    """cell, compensation, readings → the folder of the short check whose touches these are; None where none has them."""
    for folder in sorted(kept.folder.parent.glob(f"{loop.CHECK}{kept.number:03d}*")):
        with suppress(InputError):  # one that somebody has changed is no reason not to judge
            planned = [facet for i in read_cell(folder).strategy.indexations for facet in i.facets]
            if all(0 < number <= len(planned) for number in readings.touch):
                same = sum(planned[number - 1] == facet for number, facet in zip(readings.touch, readings.facet, strict=True))
                if same == len(readings):
                    return folder
    return None


def made_from(folder: Path, text: str, terms: tuple[Any, ...], degree: int, *, tcp: bool) -> dict[str, Any]:
    """folder of the cell, text of the readings, terms, degree, whether with tool center point control → what a short check will
    rest on."""
    plain = [dict(term) if isinstance(term, Mapping) else term for term in terms]
    return {"readings": text, "terms": plain, "degree": degree, "tcp": tcp, **machine_and_artefact(folder)}


def _asked(cell: Cell, kept: loop.Kept, days: float, options: Mapping[str, Any]) -> Short:
    """cell, compensation, days since the run it was made from, options → short check made ready. Raises InputError."""
    known = kept.record.get("made_from")
    if known is None:
        raise InputError(
            f"--short-check: found compensation {kept.number}, which an older version proposed: it does not have the readings "
            "that it was made from; allowed: the whole strategy ('tango run'), or propose anew"
        )
    then = as_then(cell, kept)
    if options.get("same_stylus") and then.machine.probe != cell.machine.probe:
        raise InputError(
            "--same-stylus: found another stylus in machine.yaml than in the run that compensation "
            f"{kept.number} was made from ({_probe(then)}, now {_probe(cell)}); allowed: without it, or that stylus in machine.yaml"
        )
    readings = read_readings(kept.folder / loop.MADE_FROM, then.machine, then.artefact)
    result = honest(estimate(then.machine, then.artefact, readings, tuple(known["terms"]), known["degree"]))
    module, request, held = _target_of(then, kept, result.model.coefficients)
    numbers = {h.place: h.base for h in held}
    present, new = (numbers | {v["place"]: float(v[key]) for v in kept.record["values"]} for key in ("present", "new"))
    files = files_of(module, request, held, present, new)
    before = Before(result, days, same_stylus=bool(options.get("same_stylus")))
    sensor = read_nightly(cell.folder).sensor
    return Short(kept, before, held, bool(options["tcp"]), bool(known["tcp"]), files, options.get("warmer"), sensor)


def as_then(cell: Cell, kept: loop.Kept) -> Cell:
    """cell, compensation → the cell with machine and artefact of the run that it was made from; another stylus is nothing to it.

    Raises InputError where what errors are counted from has changed: then nothing of both runs can be compared.
    """
    texts = {role: text for role, text in kept.record.get("made_from", {}).items() if role in ("machine", "artefact")}
    then = with_texts(cell, texts, kept.folder / loop.MADE_FROM)
    whose_is(kept, cell)
    if changed := moved(then, cell):
        listed = ", ".join(changed[:4]) + (f" and {len(changed) - 4} more" if len(changed) > 4 else "")
        raise InputError(
            f"{cell.folder}: found {listed}, which has changed since the run that compensation {kept.number} was made from: errors "
            "are counted from it, and its change would look like help or harm; allowed: machine.yaml and artefact.yaml as they "
            f"were then (made_from in {kept.folder / loop.RECORD}). A stylus, travels and feeds may change"
        )
    return then


def _probe(cell: Cell) -> str:
    probe = cell.machine.probe
    return f"length {probe.length:g}, tip radius {probe.tip_radius:g}"


def held_of(cell: Cell, kept: loop.Kept, coefficients: tuple[Any, ...]) -> list[Held]:
    """cell, compensation, coefficients of the estimate → what its target holds."""
    return _target_of(cell, kept, coefficients)[2]


def _target_of(cell: Cell, kept: loop.Kept, coefficients: tuple[Any, ...]) -> tuple[ModuleType, targets.Request, list[Held]]:
    """cell, compensation, coefficients of the estimate → its target, the job of that, what it holds."""
    module = targets.load(kept.record["target"])
    limits = _compensate.volume_of(_compensate.volume_text(kept.record), cell.machine)
    request = targets.Request(cell.machine, limits, targets.options(module, _compensate.settings_of(kept.record)), coefficients)
    return module, request, module.held(request)


def judged(cell: Cell, kept: loop.Kept, file: Path, options: Mapping[str, Any]) -> tuple[Outcome, list[str]]:
    """cell, compensation, readings of a short check, options → outcome, places that act with TCP only."""
    cell = at_that_time(cell, file)
    few = read_readings(file, cell.machine, cell.artefact)
    own = _check_of(cell, kept, few) or (file.parent if (file.parent / loop.CELL).exists() else cell.folder)
    for line in told(traced(Judgement("trustworthy"), look_up(file), own)):
        printed(line, err=True)
    asked = _asked(cell, kept, days_between(kept, ended(file)), options)
    places = switched(kept.record, asked.held)
    if places and options["tcp"] is None:
        raise InputError(neither(kept.number, places))
    touches = from_readings(cell.machine, cell.artefact, few)
    found = short_outcome(asked, touches)
    if places and found.verdict not in HELPS:
        found = asked_otherwise(found, short_outcome(replace(asked, tcp=not asked.tcp), touches), tcp=asked.tcp)
    if found.verdict == "undecided" and found.unsure:
        found = replace(found, text=f"{found.text}. {_mend(cell, asked, touches, found)}")
    found = with_rows(found, asked, touches)
    if found.rows and found.verdict == KEPT:  # a few touches: what they do not meet is most of what is in the tables
        found = replace(found, verdict=AS_SEEN)
    return found, places


def with_rows(found: Outcome, asked: Short, touches: Touches) -> Outcome:
    """outcome, the run made ready, its touches → the same, with the rows of tables that they did not meet, where it was kept."""
    if found.verdict not in HELPS:
        return found
    return replace(found, rows=not_met(rows_of(asked.held, changes(asked.kept), touches, asked.poses)))


def _mend(cell: Cell, asked: Short, touches: Touches, found: Outcome) -> str:
    """cell, short check, its touches, outcome that decides nothing → what would decide it."""
    same = replace(asked, before=replace(asked.before, same_stylus=True))
    if not asked.before.same_stylus and short_outcome(same, touches).verdict != "undecided":
        return (
            "A center that moves looks like another stylus. Where the stylus is that of the full run and has not been out of its "
            "holder since, state it: the same command with --same-stylus. That decides it, without another touch"
        )
    whole = "with the whole strategy, which says more ('tango run')"
    minutes, stated = _minutes(cell, asked, found.unsure), ""
    if minutes is not None and minutes[1] <= len(touches):
        return f"Clean the facets and make these touches once more, or measure {whole}"
    if minutes is None and not asked.before.same_stylus:
        minutes, stated = _minutes(cell, same, found.unsure), ", with the stylus of the full run, and state --same-stylus"
    if minutes is None:
        return f"Measure {whole}: no short check of an hour decides it"
    return (
        f"Make the touches that 'tango compensate -C {pasted(cell.folder)} --short-check {asked.kept.number} --minutes "
        f"{minutes[0]:g}' chooses{stated}, or measure {whole}"
    )


def _minutes(cell: Cell, asked: Short, names: Collection[str]) -> tuple[float, int] | None:
    """cell, short check, names of what is to be decided → minutes of a check that does, its touches; None: over an hour."""
    before, _ = promises(asked.kept.record)
    found = look(asked, cell, before, positioning_feed(cell), gate_of(cell), HOUR, DECIDES)
    std = dict.fromkeys(found.small, np.inf) | dict(zip(found.names, found.std, strict=True))
    if any(std.get(name, 0.0) > (DECIDES if name == WHOLE else 1 / WITHIN) for name in (*names, WHOLE)):
        return None
    return float(np.ceil(found.seconds / 60)), len(found.plan.touches)


def by_place(
    found: Outcome, cell: Cell, kept: loop.Kept, readings: Readings, result: Estimate, options: Mapping[str, Any]
) -> Outcome:
    """outcome of a run that determines everything, cell, compensation, readings, their estimate, options → the same, unless a
    part does not act, or may not, or the machine was warmer, or touches do not fit that did."""
    if "made_from" not in kept.record:
        return without_strays(found, None, result, held_of(cell, kept, result.model.coefficients))
    if found.verdict == "undecided":
        return found
    asked = _asked(cell, kept, days_between(kept, None), options)
    touches = from_readings(cell.machine, cell.artefact, readings)
    found = whole_outcome(found, asked, touches)
    return with_rows(without_strays(found, asked.before.result, result, asked.held), asked, touches)


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
    state = loop.state(cell.folder, number)
    if state == BACK:
        raise InputError(
            f"--short-check: found compensation {number}, which is noted as {state}; allowed: one that is in the control. "
            "Propose it anew, where it is to come back"
        )
    asked = _asked(cell, kept, days_between(kept, None), options)
    before, _ = promises(kept.record)
    found = look(asked, cell, before, positioning_feed(cell), gate_of(cell), options["minutes"], rows=bool(options.get("rows")))
    place = options["out"] or _free(cell.folder / loop.FOLDER / f"{loop.CHECK}{number:03d}")
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
        "rows_not_met": {one.table: one.missed(found.made) for one in found.tables},
    }
    if not write_json(options["json_file"], data):
        printed(_text(cell, kept, asked, found, place))
        if state == "proposed":
            click.echo(
                "not yet noted as in the control: before it is measured, "
                f"tango compensate -C {pasted(cell.folder)} --written {number}"
            )
    return 0


def turned(cell: Cell, kept: loop.Kept, text: str) -> tuple[Outcome, list[str]]:
    """cell, compensation, --turned → outcome, places that act with tool center point control only. Raises InputError."""
    asked = _asked(cell, kept, days_between(kept, None), {"tcp": True})
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
    where = " ".join(f"{letter} {v:.0f}" for letter, v in zip("XYZ", turn.feature(asked), strict=True))
    angle, here = f"{np.degrees(found.angle):g}", f"tango compensate -C {pasted(cell.folder)}"
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
        f"Look by hand: {mode}, about {where} in the table, where the facets are. Find its center by the control's "
        f"own cycle at {found.axis} 0, and again at {found.axis} {angle}. The second center "
        f"minus the first is {second} mm where the numbers act, and {first} mm where they do not.",
        f"Judge it: {here} --measured {loop.NUMBER} --turned {found.axis}={angle}:"
        + ",".join(f"{letter}=MM" for letter in found.letters)
        + " (the second minus the first)",
    ]


def _measured(place: Path) -> bool:
    """folder of a check → whether readings lie there."""
    return place.is_dir() and any(place.glob("*.csv"))


def _free(place: Path) -> Path:
    """folder for a check → it, or the first beside it, 'check-001-2', without readings."""
    beside = (place.with_name(f"{place.name}-{i}") for i in itertools.count(2))
    return next(folder for folder in itertools.chain((place,), beside) if not _measured(folder))


def _write(cell: Cell, found: Look, place: Path) -> None:
    """Writes a cell with the files of this one, and the touches of the check as its strategy."""
    if _measured(place):
        raise InputError(f"-o: found {place}, which has readings already; allowed: another folder (-o DIR), or take it away")
    place.mkdir(parents=True, exist_ok=True)
    for file in sorted((*cell.folder.glob("*.yaml"), *cell.folder.glob("*.py"))):
        shutil.copyfile(file, place / file.name)
    data = yaml.safe_load(read_text(cell.folder / loop.CELL))
    for key in ("machine", "artefact"):
        shutil.copyfile(cell.folder / data[key], place / f"{key}.yaml")
    data |= {key: f"{key}.yaml" for key in ("machine", "artefact", "strategy")}
    if data.get("controller"):  # a fresh folder: no run in it has proven a facet
        data["controller"] = asks_for_a_finger(data["controller"])
    write_text(place / loop.CELL, dump(data))
    write_text(place / "strategy.yaml", strategy_text(found.cell.strategy))
    read_cell(place)


def _text(cell: Cell, kept: loop.Kept, asked: Short, found: Look, place: Path) -> str:
    how = ""
    if switched(kept.record, asked.held):
        how = " --tcp" if asked.tcp else " --no-tcp"
    how += " --same-stylus" if asked.before.same_stylus else ""
    known = ", ".join(f"{name} to ± {200 * std:.0f} %" for name, std in zip(found.names, found.std, strict=True))
    lines = [
        f"→ {place}: {len(found.plan.touches)} touches at {len(found.cell.strategy.indexations)} indexations, "
        f"predicted time {spoken(found.seconds)}",
        f"by these it will be known how much of each part acts: {known} (95 %)",
    ]
    if found.grown is None:
        lines.append(
            "no touch of this cell tells what all axes have grown alike, as those of a warmer machine: state --warmer then"
        )
    else:
        lines.append(f"by how much warmer than its table the machine has become since the full run: to ± {2 * found.grown:.1f} K")
    if found.undecided:
        minutes = _minutes(cell, asked, found.names)
        more = "the whole strategy says more" if minutes is None else f"--minutes {minutes[0]:g} would tell all of it"
        lines.append(f"of these it will hardly tell whether they act: {', '.join(found.undecided)}; {more}")
        if not asked.before.same_stylus:
            lines.append("a stylus that stays in its holder since the full run makes it better known: state --same-stylus")
    if found.small:
        lines.append(f"not asked for, as each takes little of the error away, or no touch tells it: {', '.join(found.small)}")
    lines += lines_of(found.tables, found.made)
    if others := added(found.tables, found.made):
        beyond = f" and {len(others) - 12} more" if others[12:] else ""
        numbers = ", ".join(str(found.numbers[i]) for i in sorted(others)[:12]) + beyond
        lines.append(f"touches {numbers} of the strategy would meet what it meets of the others: --rows makes them as well")
    if (controller := read_cell(place).controller) is not None and controller.options.get("gate") == "finger":
        lines.append("the program asks for a finger at the stylus before its first touch: be at the machine")
    return "\n".join(
        [
            *lines,
            f"  tango run -C {pasted(place)}",
            f"  tango compensate -C {pasted(cell.folder)} --measured {kept.number} --readings "
            f"{pasted(place / 'readings.csv')}{how}",
        ]
    )
