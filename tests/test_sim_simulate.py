"""Contacts and readings of the simulated machine."""

from __future__ import annotations

import json
import shutil
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from sim_controller import surfaces
from sim_controller.probing import facet_rows, rig
from sim_controller.simulate import linear_positions, simulate
from sim_controller.world import nominal_machine, tip_in_table
from tango_cnc.cli import guarded, tango
from tango_cnc.files import read_cell, read_readings
from tango_cnc.plan import last_moves, plan
from tango_cnc.records import Approach, Facet, Indexation, InputError, Strategy, Surface, World

EXAMPLE = Path(__file__).parent.parent / "examples" / "hu40t"
CELL = read_cell(EXAMPLE)
BAD = World(
    errors={"EX0C": -0.251, "EA0C": 2.58e-4, "EXXb": 6.08e-3, "EYYb": -4.93e-3, "EBBb": 5.51e-6, "ECCb": -3.61e-5}
    | {"EYX2": 3.24e-8, "EBX3": 4.49e-13, "EXB2": 5.57e-2, "ECZ1": 3.52e-6, "EX0S": -0.252},
    stylus={"EXt": 0.01, "EYt": -0.003, "EZt": -0.07},
    facets={"3": 0.02, "16": -0.03},
)


def one_facet(facet: Facet, **position: float) -> tuple:
    """→ machine, artefact and strategy that touch this facet alone, axes in degrees."""
    at = {name: np.radians(value) for name, value in position.items()}
    strategy = Strategy("one", Approach(10, 5, 180), (Indexation({"B": 0.0, "C": 0.0, "S": 0.0} | at, (facet.id,)),))
    return CELL.machine, replace(CELL.artefact, facets={facet.id: facet}), strategy


def gaps(world: World, readings, artefact=CELL.artefact) -> np.ndarray:
    """Gap of the true ball at the recorded positions, mm."""
    r = rig(CELL.machine, artefact, world)
    tip = tip_in_table(r.true, readings.position, readings.direction)
    return surfaces.gap(r.surfaces, facet_rows(r, readings.facet), tip)


def test_without_errors_the_readings_are_the_nominal_contacts() -> None:
    readings = simulate(CELL.machine, CELL.artefact, CELL.strategy, World())
    point = np.array([CELL.artefact.facets[f].point for f in readings.facet])
    normal = np.array([CELL.artefact.facets[f].normal for f in readings.facet])
    wanted = linear_positions(CELL.machine, readings.position, point + normal * CELL.machine.probe.tip_radius)
    assert set(readings.status) == {"ok"}
    assert np.abs(readings.position - wanted).max() < 1e-11


def test_a_noise_free_contact_satisfies_the_true_equation_to_the_last_digit() -> None:
    readings = simulate(CELL.machine, CELL.artefact, CELL.strategy, BAD)
    assert set(readings.status) == {"ok"}
    assert np.abs(gaps(BAD, readings)).max() < 1e-12


@pytest.mark.parametrize(
    "surface", [None, Surface("sphere", 40.0), Surface("sphere", 40.0, inside=True), Surface("cylinder", 25.0, (0, 1, 0)),
                Surface("cylinder", 25.0, (0, 1, 0), inside=True)]
)  # fmt: skip
def test_curved_facets_are_touched_to_the_last_digit_too(surface: Surface | None) -> None:
    facet = Facet("f", (120.0, 30.0, 0.0), (0.0, 0.0, 1.0), surface=surface)
    machine, artefact, strategy = one_facet(facet, C=50)
    world = replace(BAD, facets={"f": 0.02})
    readings = simulate(machine, artefact, strategy, world)
    assert readings.status == ("ok",)
    assert np.abs(gaps(world, readings, artefact)).max() < 1e-12
    r = rig(machine, artefact, world)
    ball_above = tip_in_table(r.true, readings.position, readings.direction)[0, 2] - machine.probe.tip_radius
    sideways = 0.3  # mm that these errors let the ball land beside the facet's point
    assert ball_above == pytest.approx(0.02, abs=sideways**2 / 20)


def test_a_facet_that_stands_out_is_met_earlier_by_as_much() -> None:
    facet = Facet("f", (120.0, 30.0, 0.0), (0.0, 0.0, 1.0))
    machine, artefact, strategy = one_facet(facet)
    z = machine.column("Z")
    plain = simulate(machine, artefact, strategy, World()).position[0, z]
    assert simulate(machine, artefact, strategy, World(facets={"f": 0.02})).position[0, z] == pytest.approx(plain + 0.02, abs=1e-12)


def test_a_wall_that_is_not_there_is_a_miss_at_the_search_end() -> None:
    facet = Facet("f", (120.0, 30.0, 0.0), (0.0, 0.0, 1.0))
    machine, artefact, strategy = one_facet(facet)
    readings = simulate(machine, artefact, strategy, World(facets={"f": -5.1}))
    assert readings.status == ("miss",)
    assert readings.position[0, machine.column("Z")] == pytest.approx(machine.probe.length + 3.0 - 5.0, abs=1e-9)


def test_a_contact_before_the_search_zone_is_early() -> None:
    facet = Facet("f", (120.0, 30.0, 0.0), (0.0, 0.0, 1.0))
    machine, artefact, strategy = one_facet(facet)
    assert simulate(machine, artefact, strategy, World(facets={"f": 4.9})).status == ("ok",)
    assert simulate(machine, artefact, strategy, World(facets={"f": 5.1})).status == ("early",)
    assert simulate(machine, artefact, strategy, World(facets={"f": 12.0})).status == ("early",)


def test_the_approach_is_the_last_motion_of_the_axes_that_take_part_in_it() -> None:
    readings = simulate(CELL.machine, CELL.artefact, CELL.strategy, World())
    row = {name: readings.direction[0, CELL.machine.column(name)] for name in CELL.machine.names}
    # facet 3 at B 30 C -90 looks towards -x +y +z of the machine; X carries the table
    assert (row["X"], row["Y"], row["Z"]) == (-1, -1, -1)
    assert (row["B"], row["C"]) == (1, -1)  # from home at 0 and 0
    assert set(np.unique(readings.direction)) == {-1.0, 1.0}


def test_rotary_directions_come_from_the_indexations() -> None:
    readings = simulate(CELL.machine, CELL.artefact, CELL.strategy, World())
    for name in ("B", "C", "S"):
        column = CELL.machine.column(name)
        angle, sign = readings.position[:, column], readings.direction[:, column]
        change = np.sign(np.diff(angle))
        assert np.array_equal(sign[1:][change != 0], change[change != 0])
        assert np.array_equal(sign[1:][change == 0], sign[:-1][change == 0])


@pytest.mark.long
def test_noise_is_what_the_world_says() -> None:
    world = replace(BAD, noise=0.0006, seed=3)
    r = gaps(world, simulate(CELL.machine, CELL.artefact, CELL.strategy, world, cycles=5))
    assert r.std() == pytest.approx(0.0006, rel=0.1)  # 1965 touches: one standard deviation is 1.6 %
    assert abs(r.mean()) < 4 * 0.0006 / np.sqrt(len(r))


def test_the_seed_decides_and_more_cycles_leave_the_first_ones_alone() -> None:
    world = World(noise=0.001, seed=7)
    once = simulate(CELL.machine, CELL.artefact, CELL.strategy, world)
    again = simulate(CELL.machine, CELL.artefact, CELL.strategy, world, cycles=2, days=2)
    other = simulate(CELL.machine, CELL.artefact, CELL.strategy, world, seed=8)
    assert np.array_equal(again.position[: len(once)], once.position)
    assert not np.array_equal(other.position, once.position)
    assert len(again) == 4 * len(once)
    assert again.cycle.tolist() == ([1] * len(once) + [2] * len(once)) * 2
    assert (np.diff(again.time) > 0).all()
    assert again.time[2 * len(once)] > 86_400


def test_positions_beyond_the_travel_are_refused() -> None:
    with pytest.raises(InputError, match=r"touch 1 \(facet f\) needs X = -500\.000 mm; allowed: -400 to 400.*tango check"):
        simulate(*one_facet(Facet("f", (500.0, 0.0, 0.0), (0.0, 0.0, 1.0))), World())


def test_a_facet_that_the_artefact_lacks_is_refused() -> None:
    with pytest.raises(InputError, match="facets: found '77'; allowed: facets of artefact"):
        simulate(CELL.machine, CELL.artefact, CELL.strategy, World(facets={"77": 0.1}))


def test_inverse_kinematics_put_the_nominal_tip_where_it_is_wanted() -> None:
    rng = np.random.default_rng(1)
    positions, targets = rng.uniform(-1, 1, (50, 6)), rng.uniform(-300, 300, (50, 3))
    found = linear_positions(CELL.machine, positions, targets)
    assert np.abs(tip_in_table(nominal_machine(CELL.machine), found, np.zeros_like(found)) - targets).max() < 1e-11
    assert np.array_equal(found[:, 3:], positions[:, 3:])


def test_all_touches_of_the_example_take_less_than_a_second() -> None:
    world = replace(BAD, noise=0.0006)
    began = time.process_time()
    simulate(CELL.machine, CELL.artefact, CELL.strategy, world)
    assert time.process_time() - began < 1.0


@pytest.mark.long
def test_the_command_writes_readings_that_can_be_read_back(tmp_path: Path) -> None:
    cell = shutil.copytree(EXAMPLE, tmp_path / "cell")
    world = {"errors": {"EX0C": -0.1}, "noise": 0.0005, "seed": 7}
    (cell / "world.yaml").write_text(yaml.safe_dump(world))
    result = CliRunner().invoke(tango, ["simulate", "-C", str(cell), "--exact", "--json", "-"])
    assert result.exit_code == 0, result.output
    told = json.loads(result.output)
    readings = read_readings(cell / "simulated.csv", CELL.machine, CELL.artefact)
    assert told["touches"] == told["ok"] == len(readings)
    moved = last_moves(plan(CELL))
    expected = simulate(CELL.machine, CELL.artefact, CELL.strategy, World({"EX0C": -0.1}, noise=0.0005, seed=7), moved=moved)
    assert np.abs(readings.position - expected.position).max() < 1e-15 * 400
    assert np.array_equal(readings.direction, expected.direction)


def test_a_wrong_world_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = shutil.copytree(EXAMPLE, tmp_path / "cell")
    (cell / "simulated.csv").unlink(missing_ok=True)
    (cell / "world.yaml").write_text("effects: [{cause: thermal_drfit, amplitude: 0.01}]\n")
    arguments = ["simulate", "-C", str(cell)]
    assert guarded(tango.main, arguments, standalone_mode=False) == 2
    assert "Did you mean 'thermal_drift'?" in capsys.readouterr().err
    assert not (cell / "simulated.csv").exists()
