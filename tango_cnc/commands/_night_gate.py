"""What proves the probe alive at night, when nobody is there to touch the stylus: a facet, where the last run has found it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import postprocessors as posts
from postprocessors import Post

from ..files import read_readings
from ..files.origin import cell_texts, changes, read_origin
from ..gate import from_above, proving_touch
from ..nightly import PreflightPoint
from ..nightly.edited import changed_in
from ..records import Cell, InputError, Plan, Touch
from ..texts import Said, say
from ._common import dialect
from ._proofs import proven

NEAR = 1.0  # mm between where the facet was found and where the plan expects it: the search ends 0.45 mm behind the former
STEPS = 0.05  # mm in which that is said, towards the probe, so that a program stays the same from day to day
COPIED = 60.0  # s within which files are copied together
TURNED = math.radians(0.1)  # of a rotary axis: the same indexation
RUNS = 3  # of the last ones, as a check does not touch everything
FAR = 30.0  # mm from the expected contact: not this touch
PROBE = "probe."  # keys of machine.yaml about the stylus


def proves(cell: Cell, made: Plan) -> PreflightPoint:
    """cell, plan of the night → whether its program proves the probe with nobody there. Raises InputError without a post."""
    post = dialect(cell)
    options = cell.controller.options if cell.controller else {}
    which = posts.settings(post, options).get("gate", "none")
    if which == "none":
        return PreflightPoint("gate", True, say("preflight.gate.program_asks_for_nobody_nothing"))
    if which == "finger":
        state = "" if _looks(cell, post) else say("preflight.gate.and_state_probe_state")
        advice = say("preflight.gate.state_gate_facet_under_controller", state=state)
        with suppress(InputError):  # no facet could prove it, or its readings cannot be read
            if (last := _last(cell, made)) is not None and abs(last.off) <= NEAR:
                name, folder = last.file.name, last.file.resolve().parent.name
                advice = say("preflight.gate.found_without_gate", state=state, facet=last.facet, name=name, name2=folder)
        return PreflightPoint("gate", False, say("preflight.gate.program_waits_for_finger_at"), advice)
    if not _looks(cell, post):
        found = say("preflight.gate.nothing_tells_stylus_deflected_before")
        advice = say("preflight.gate.state_probe_state_variable_shows")
        return PreflightPoint("gate", False, found, advice)
    last = _last(cell, made)
    if last is not None:
        where = say(
            "preflight.gate.facet_proves_probe_found_mm",
            facet=last.facet,
            name=last.file.name,
            name2=last.file.resolve().parent.name,  # of a cell that is "."
            off=f"{last.off:+.2f}",
        )
        if abs(last.off) <= NEAR:
            return PreflightPoint("gate", True, where, "")
        if (changed := _other_probe(cell, last.file)) is not None:
            found = say("preflight.gate.other_stylus", what=changed, found=where)
            return PreflightPoint("gate", False, found, say("preflight.gate.other_stylus_do", near=f"{NEAR:g}"))
        return PreflightPoint("gate", False, where, say("preflight.gate.allowed_mm_run_tango_locate", near=f"{NEAR:g}"))
    advice = say("preflight.gate.measure_once_with_person_at")
    facet = proving_touch(replace(made, met={})).facet
    return PreflightPoint("gate", False, say("preflight.gate.facet_prove_probe_no_run", facet=facet), advice)


@dataclass(frozen=True)
class _Last:
    """Where the last run has found the facet that proves the probe: mm behind (+) the place in the plan, and in which file."""

    facet: str
    off: float
    file: Path


def _last(cell: Cell, made: Plan) -> _Last | None:
    """cell, plan of the night → the last run that has found the proving facet; None where none has.

    Raises InputError where no facet of the plan proves the probe, and for readings that cannot be read.
    """
    one = proving_touch(replace(made, met={}))
    for file in _runs(cell):
        off = _found(cell, made, [one], file).get(one.number)
        if off is not None:
            return _Last(one.facet, off, file)
    return None


def _other_probe(cell: Cell, file: Path) -> Said | None:
    """cell, readings of a run → what of the probe is stated otherwise today than for that run; None where nothing is, or nobody
    knows. Nobody but a person may try whether that is so: a stylus longer than stated hits what it comes down to.
    """
    then = (read_origin(file) or {}).get("cell")
    found = changes(then, cell_texts(cell.folder)) if isinstance(then, dict) else {}
    own = {name: [one for one in keys if one[0].startswith(PROBE)] for name, keys in found.items()}
    return next((changed_in(name, keys) for name, keys in own.items() if keys), None)


def _looks(cell: Cell, post: Post) -> bool:
    """cell, its post → whether a deflected probe is noticed: no variable is to be named for it, one is, or it was tried.

    A person at the machine sees a stylus that hangs aside; at night it is driven wherever the program goes.
    """
    options = cell.controller.options if cell.controller else {}
    stated = posts.settings(post, options).get("probe_state", True)
    held = proven(cell, post).get("deflected")
    return bool(stated) or (held is not None and held.verdict == "PASS")


def as_found(cell: Cell, made: Plan, post: Post) -> Plan:
    """cell, plan, its post → the plan with where the last run has found the facets that may have to prove the probe.

    The search that proves the probe ends 0.45 mm behind that place. Where no run has found the facet it ends behind the place in
    the plan; so it does where the facet was found farther off than `NEAR`, and `proves` refuses that run.
    """
    options = cell.controller.options if cell.controller else {}
    if posts.settings(post, options).get("gate", "none") != "facet":
        return made
    met: dict[int, float] = {}
    met_in = ""
    for file in _runs(cell)[:RUNS]:
        with suppress(InputError):  # readings that cannot be read: 'tango run' says so
            found = _found(cell, made, [touch for touch in from_above(made) if touch.number not in met], file)
            met = found | met
            met_in = met_in or (str(file.relative_to(cell.folder)) if found else "")
    near = {number: STEPS * math.floor(off / STEPS + 1e-6) for number, off in met.items() if abs(off) <= NEAR}
    return replace(made, met=near, met_in=met_in)


def _runs(cell: Cell) -> list[Path]:
    """cell → readings of its runs since the table was last moved in artefact.yaml, the last one first."""
    files = [*cell.folder.glob("nights/*/readings.csv"), *cell.folder.glob("readings.csv")]
    written = {file: file.stat().st_mtime for file in files}
    moved = (cell.folder / "artefact.yaml").stat().st_mtime if (cell.folder / "artefact.yaml").is_file() else 0.0
    return sorted((file for file in files if written[file] > moved - COPIED), key=lambda file: written[file], reverse=True)


def _found(cell: Cell, made: Plan, touches: Sequence[Touch], file: Path) -> dict[int, float]:
    """cell, plan, touches, readings → {touch: mm that its facet was met behind (+) the expected contact} of those made there."""
    read, machine = read_readings(file, made.machine, cell.artefact), made.machine
    linear = [machine.column(name) for name in machine.linear]
    rotary = [machine.column(name) for name in machine.rotary]
    good = np.array([status == "ok" for status in read.status], dtype=bool)
    facets = np.array(read.facet)
    found = {}
    for touch in touches:
        off = read.position - np.array(touch.contact)
        way = (np.array(touch.end) - np.array(touch.standoff))[linear]
        same = good & (facets == touch.facet) & (np.abs(off[:, rotary]) < TURNED).all(axis=1)
        rows = np.flatnonzero(same & (np.linalg.norm(off[:, linear], axis=1) < FAR))
        if len(rows):
            found[touch.number] = float(off[rows[-1]][linear] @ way / np.linalg.norm(way))
    return found
