"""What proves the probe alive at night, when nobody is there to touch the stylus: a facet, where the last run has found it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from postprocessors import _base as posts
from postprocessors._base import Post

from ..files import read_readings
from ..gate import proving_touch
from ..nightly import Finding
from ..records import Cell, Plan, Touch
from ..texts import say
from ._common import dialect
from ._proofs import proven

NEAR = 0.3  # mm between where the facet was found and where the plan expects it; the search ends 0.45 mm behind the latter
TURNED = math.radians(0.1)  # of a rotary axis: the same indexation
FAR = 30.0  # mm from the expected contact: not this touch


def proves(cell: Cell, made: Plan) -> Finding:
    """cell, plan of the night → whether its program proves the probe with nobody there. Raises InputError without a post."""
    post = dialect(cell)
    options = cell.controller.options if cell.controller else {}
    which = posts.settings(post, options).get("gate", "none")
    if which == "none":
        return Finding("gate", True, say("preflight.gate.program_asks_for_nobody_nothing"))
    if which == "finger":
        state = "" if _looks(cell, post) else say("preflight.gate.and_state_probe_state")
        advice = say("preflight.gate.state_gate_facet_under_controller", state=state)
        return Finding("gate", False, say("preflight.gate.program_waits_for_finger_at"), advice)
    if not _looks(cell, post):
        found = say("preflight.gate.nothing_tells_stylus_deflected_before")
        advice = say("preflight.gate.state_probe_state_variable_shows")
        return Finding("gate", False, found, advice)
    one = proving_touch(made)
    for file in _runs(cell.folder):
        off = _found(cell, made, one, file)
        if off is not None:
            where = say(
                "preflight.gate.facet_proves_probe_found_mm",
                facet=one.facet,
                name=file.name,
                name2=file.parent.name,
                off=f"{off:+.2f}",
            )
            advice = say("preflight.gate.allowed_mm_run_tango_locate", near=f"{NEAR:g}")
            return Finding("gate", abs(off) <= NEAR, where, "" if abs(off) <= NEAR else advice)
    advice = say("preflight.gate.measure_once_with_person_at")
    return Finding("gate", False, say("preflight.gate.facet_prove_probe_no_run", facet=one.facet), advice)


def _looks(cell: Cell, post: Post) -> bool:
    """cell, its post → whether a deflected probe is noticed: no variable is to be named for it, one is, or it was tried.

    A person at the machine sees a stylus that hangs aside; at night it is driven wherever the program goes.
    """
    options = cell.controller.options if cell.controller else {}
    stated = posts.settings(post, options).get("probe_state", True)
    held = proven(cell, post).get("deflected")
    return bool(stated) or (held is not None and held.verdict == "PASS")


def _runs(folder: Path) -> list[Path]:
    """folder of a cell → readings of its runs, the last one first."""
    files = [*folder.glob("nights/*/readings.csv"), *folder.glob("readings.csv")]
    return sorted(files, key=lambda file: file.stat().st_mtime, reverse=True)


def _found(cell: Cell, made: Plan, one: Touch, file: Path) -> float | None:
    """cell, plan, touch, readings → mm that its facet was met behind (+) the expected contact; None where it was not touched."""
    read, machine = read_readings(file, made.machine, cell.artefact), made.machine
    linear = [machine.column(name) for name in machine.linear]
    rotary = [machine.column(name) for name in machine.rotary]
    contact, way = np.array(one.contact), (np.array(one.end) - np.array(one.standoff))[linear]
    for row in reversed(range(len(read))):
        off = read.position[row] - contact
        same = read.facet[row] == one.facet and read.status[row] == "ok" and (np.abs(off[rotary]) < TURNED).all()
        if same and np.linalg.norm(off[linear]) < FAR:
            return float(off[linear] @ way / np.linalg.norm(way))
    return None
