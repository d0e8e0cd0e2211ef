"""What no move in the air shows: where rotary axes turn, and whether a position is that of the trigger; on a simulated machine."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.dialects import EVERY
from support.gates import ran

from tango_cnc import commission
from tango_cnc.cli import guarded, tango
from tango_cnc.commands.commission import record_of
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell
from tango_cnc.files.commissioning import read_commissioning
from tango_cnc.plan import plan
from tango_cnc.records import Array, Machine, Plan

EXAMPLES = Path(__file__).parent.parent / "examples"


@cache
def slow(example: str = "hu40t") -> Plan:
    return commission.touching(plan(read_cell(EXAMPLES / example)))


def shifted(machine: Machine, name: str, by: tuple[float, float, float]) -> Machine:
    """machine, letter, mm → the one that really stands there: this axis turns about another point."""
    axes = tuple(
        replace(a, point=tuple(float(p + d) for p, d in zip(a.point, by, strict=True))) if a.name == name else a
        for a in machine.axes
    )
    return replace(machine, axes=axes)


def places(made: Plan, truly: Machine | None = None, name: str = "fanuc", **panel: Any) -> dict[int, Array]:
    """plan, the machine that really moves, dialect → {touch: mm rad} as its control recorded it."""
    found = ran(name, made, truly=truly, **panel)
    assert not found.why, found.why
    lines = found.out.decode("ascii").replace("\x12", "").replace("\x14", "").splitlines()
    met = {r[0]: {"S": 0.0, **r[2]} for line in lines if line.lstrip().startswith("P") and (r := record_of(line, made)) and r[1]}
    angle = {axis.name: axis.kind != "linear" for axis in made.machine.axes}
    return {
        number: np.array([math.radians(place[n]) if angle[n] else place[n] for n in made.machine.names])
        for number, place in met.items()
    }


def verdicts(example: str = "hu40t", truly: Machine | None = None, **panel: Any) -> dict[str, commission.Ruling]:
    made = slow(example)
    quick = commission.quicker(made)
    met, again = places(made, truly, **panel), places(quick, truly, **panel)
    late = commission.late(made, met, quick, again)
    seen = commission.Seen(made, {}, True, True, pivots=commission.pivots(made, met), late=late)
    return {j.experiment.belief: j.verdict for j in commission.judge(seen) if j.experiment.touches}


@pytest.mark.long
def test_a_machine_on_which_all_is_right_passes() -> None:
    assert len(slow().touches) <= 10
    found = verdicts()
    assert {belief: verdict.verdict for belief, verdict in found.items()} == {"latched": "PASS", "pivots": "PASS"}
    assert found["pivots"].value is not None and found["pivots"].value < 0.01


LONG = [pytest.param(name, marks=pytest.mark.long) for name in ("trunnion", "split", "fork_head")]


@pytest.mark.long
@pytest.mark.parametrize("example", ["hu40t", *LONG])
def test_a_point_that_is_wrong_is_found_axis_by_axis(example: str) -> None:
    machine = slow(example).machine
    for name in machine.rotary:
        along = np.array(machine.axis(name).direction)
        across = np.linalg.svd(along[None])[2][1:]
        by = 1.0 * across[0] - 0.7 * across[1]
        found = verdicts(example, shifted(machine, name, tuple(float(v) for v in by)))
        pivot = found["pivots"]
        assert pivot.verdict == "FAIL" and pivot.found.startswith(f"{name} turns about a point 1.2"), (name, pivot)
        assert found["latched"].verdict == "PASS"


@pytest.mark.long
@pytest.mark.parametrize("name", [n if n == "fanuc" else pytest.param(n, marks=pytest.mark.long) for n in sorted(EVERY)])
def test_positions_after_the_stop_are_found(name: str) -> None:
    found = verdicts(name=name, latches=False)
    assert found["latched"].verdict == "FAIL" and "after the trigger" in found["latched"].found
    assert found["pivots"].verdict == "PASS"


def test_without_a_touched_table_both_are_open() -> None:
    seen = commission.Seen(slow(), {}, True, True)
    open_ones = {j.experiment.belief for j in commission.judge(seen) if j.experiment.touches and j.verdict.verdict == "OPEN"}
    assert open_ones == {"latched", "pivots"}


def test_a_machine_without_rotary_axes_has_no_points_and_is_touched_at_two_feeds() -> None:
    made = slow("three_axis")
    seen = commission.Seen(made, {}, True, True)
    assert {j.experiment.belief: j.verdict.verdict for j in commission.judge(seen) if j.experiment.touches} == {
        "latched": "OPEN",
        "pivots": "PASS",
    }
    assert verdicts("three_axis")["latched"].verdict == "PASS"


@pytest.mark.long
def test_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = tmp_path / "cell"
    write_example(cell, "hu40t")
    command = [sys.executable, "-m", "sim_controller", "--cell", str(cell), "--tcp", "127.0.0.1:0", "--speed", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            port = process.stdout.readline().strip()
            words = ["commission", "-C", str(cell), "--port", port, "--touch", "--yes"]
            code = guarded(tango.main, words, prog_name="tango", standalone_mode=False)
        finally:
            process.kill()
    out = capsys.readouterr()
    assert code == 0, out
    assert {p.belief: p.verdict for p in read_commissioning(cell)} == {"latched": "PASS", "pivots": "PASS"}
    assert (cell / "commissioning" / "touch" / "quick" / "readings.csv").exists()
