"""Probing capability (thesis 4.6 and 7.3): what the simulated machine is given is what the analysis finds."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from sim_controller.simulate import simulate
from tango_cnc import capability
from tango_cnc.capability import KINDS, CapabilitySettings, Kind, program
from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import examples
from tango_cnc.files import read_cell, read_world
from tango_cnc.records import Cell, InputError, World
from tango_cnc.touches import Touches, from_readings
from tango_cnc.uncertainty.inputs import read_budget


@pytest.fixture(scope="module")
def cell() -> Cell:
    return read_cell(examples()["hu40t"])


def measured(cell: Cell, kind: Kind, world: World, **settings: object) -> Touches:
    artefact, strategy = program(kind, cell.machine, cell.artefact, cell.strategy, CapabilitySettings(**settings))  # type: ignore[arg-type]
    return from_readings(cell.machine, artefact, simulate(cell.machine, artefact, strategy, world))


WALK = {"cause": "random_walk", "amplitude": 0.004}


def test_programs_probe_in_every_direction_that_the_strategy_offers(cell: Cell) -> None:
    touches = measured(cell, "repeatability", World(), repetitions=2)
    assert capability.directions(touches) == ["X", "X", "Y", "Y", "Z", "Z", "2D", "2D", "3D", "3D"]
    assert np.abs(capability.heights(touches)).max() < 1e-9
    chosen = measured(cell, "repeatability", World(), repetitions=3, facets=("5", "3"))
    assert chosen.facet == ("5",) * 3 + ("3",) * 3
    with pytest.raises(InputError, match="--facets: found '99'"):
        program("repeatability", cell.machine, cell.artefact, cell.strategy, CapabilitySettings(("99",)))


def test_pooling_in_windows_keeps_repeatability_and_loses_drift(cell: Cell) -> None:
    """Table 7-1 against Table 7-2: the whole spread is drift, the pooled one the probe."""
    touches = measured(cell, "repeatability", World({}, {}, {}, 0.0006, (WALK,), 2), facets=("3",), repetitions=300)
    found = capability.repeatability(capability.heights(touches), 10)
    assert found.pooled == pytest.approx(0.0006, rel=0.15) and found.dof == 270
    assert found.std > 1.3 * found.pooled


def test_pooled_standard_deviation_by_hand() -> None:
    found = capability.repeatability(np.array([0.0, 2.0, 10.0, 14.0]), 2)
    assert found.pooled == pytest.approx(np.sqrt((2 + 8) / 2)) and found.range == 14.0
    with pytest.raises(InputError):
        capability.repeatability(np.array([1.0]))


def wetted(seed: int, film: float, warming: float = 0.012) -> np.ndarray:
    """600 touches, wet and dry in turn every 100, on a machine that warms up and wanders."""
    rng, n = np.random.default_rng(seed), np.arange(600)
    wander = np.cumsum(0.0001 * rng.standard_normal(600)) + warming * (1 - np.exp(-n / 150))
    return np.asarray(film * (n // 100 % 2) + 0.0006 * rng.standard_normal(600) + wander)


def test_a_film_is_found_through_a_warm_up_and_nothing_where_there_is_none() -> None:
    wet = capability.wetness(wetted(3, 0.001), 100)
    assert wet.effect == pytest.approx(0.001, abs=2.5 * wet.effect_std) and wet.p_value < 0.01
    assert len(wet.edges) == 5 and wet.detectable < 0.001
    assert capability.wetness(wetted(3, 0.0), 100).p_value > 0.01
    with pytest.raises(InputError, match="three or more"):
        capability.wetness(wetted(3, 0.001)[:200], 100)


def test_the_last_touches_alone_know_what_state_they_are_in() -> None:
    """Touches 301 to 400 are wet: the first block of the last 300 is no dry one."""
    late = capability.wetness(wetted(4, 0.002), 100, last=300)
    assert len(late.means) == 3
    assert late.effect == pytest.approx(0.002, abs=3 * late.effect_std) and late.p_value < 0.01
    for wrong in (250, 700):
        with pytest.raises(InputError, match="whole blocks"):
            capability.wetness(wetted(4, 0.002), 100, last=wrong)


def test_a_drift_inside_a_window_is_no_repeatability() -> None:
    values = 0.0006 * np.random.default_rng(5).standard_normal(300) + np.linspace(0, 0.06, 300)
    found = capability.repeatability(values, 25)
    assert found.pooled > 1.7 * 0.0006
    assert found.detrended == pytest.approx(0.0006, rel=0.1) and found.detrended_dof == 12 * 23


def test_grid_tells_surface_from_drift_and_repeatability() -> None:
    """Eq. 4-9 … 4-16 on a surface, a drift and a probe that are known."""
    rng = np.random.default_rng(4)
    surface, wander = 0.0012 * rng.standard_normal(25), np.cumsum(0.0008 * rng.standard_normal(20))
    values = surface + wander[:, None] + 0.0006 * rng.standard_normal((20, 25))
    found = capability.grid(values)
    assert found.surface == pytest.approx(np.std(surface, ddof=1), rel=0.05)
    assert found.drift_std == pytest.approx(np.std(wander, ddof=1), rel=0.1)
    assert found.rest == pytest.approx(0.0006, rel=0.1)
    assert found.total_std == pytest.approx(np.std(values, ddof=1))
    assert capability.grid(values - surface).surface < 0.2 * found.surface


def test_grid_program_of_25_points_stays_on_the_facet(cell: Cell) -> None:
    artefact, strategy = program("grid", cell.machine, cell.artefact, cell.strategy, CapabilitySettings(("3",), 2))
    own = [artefact.facets[f] for f in strategy.indexations[0].facets]
    centre = cell.artefact.facets["3"]
    away = np.array([f.point for f in own]) - np.array(centre.point)
    assert len(own) == 25 and np.abs(away @ np.array(centre.normal)).max() < 1e-9
    assert np.linalg.norm(away, axis=1).max() == pytest.approx(np.hypot(1, 1))
    assert len(strategy.indexations) == 2


@pytest.mark.long
def test_drift_series_give_back_the_random_walk(cell: Cell) -> None:
    walks = []
    for seed in range(4):
        touches = measured(cell, "drift", World({}, {}, {}, 0.0006, (WALK,), seed))
        along, height = np.array(capability.directions(touches)), capability.heights(touches)
        walks += [capability.drift(touches.time[along == d], height[along == d]).random_walk for d in ("X", "Y", "Z")]
    assert np.sqrt(np.mean(np.square(walks))) == pytest.approx(0.004, rel=0.25)


def test_warm_up_is_found_with_its_time_constant() -> None:
    t = np.arange(0, 7200, 60.0)
    values = 0.012 * (1 - np.exp(-t / 1500)) + 0.0006 * np.random.default_rng(5).standard_normal(len(t))
    found = capability.drift(t, values)
    assert (found.amplitude, found.tau) == pytest.approx((0.012, 1500), rel=0.1) and found.explained > 0.95


def test_lobes_are_found_with_amplitude_and_phase(cell: Cell) -> None:
    lobing = {"cause": "probe_lobing", "amplitude": 0.0035, "order": 2, "phase": 50.0}
    touches = measured(cell, "lobing", World({}, {"EXt": 0.02, "EYt": -0.01}, {}, 0.0005, (lobing,), 6))
    found = capability.lobing(touches)
    two, three = found.lobes
    assert (two.amplitude, two.phase) == (pytest.approx(0.0035, rel=0.1), pytest.approx(50.0, abs=5))
    assert three.amplitude < 4 * three.amplitude_std
    assert found.out_of_sphericity > 0.006 and found.std_after == pytest.approx(0.0005, rel=0.2)


def test_lobing_needs_a_ball(cell: Cell) -> None:
    plane = [i for i in cell.strategy.indexations if all(cell.artefact.facets[f].ball is None for f in i.facets)]
    with pytest.raises(InputError, match="no touch on a ball"):
        program("lobing", cell.machine, cell.artefact, replace(cell.strategy, indexations=tuple(plane[:2])))


@pytest.mark.long
def test_a_probe_with_three_lobes_has_a_form_of_twice_their_amplitude_and_a_round_one_none(cell: Cell) -> None:
    """Lobes are √(n_x² + n_y²) · amplitude · cos: whole at the equator, and 36 points see their peaks."""
    quiet = capability.probing(measured(cell, "probe", World()))
    assert quiet.form_2d < 2e-5 and quiet.form_3d < 2e-5 and abs(quiet.size_3d) < 2e-5
    lobes = {"cause": "probe_lobing", "amplitude": 0.003, "order": 3, "phase": 10.0}
    found = capability.probing(measured(cell, "probe", World({}, {}, {}, 0.0, (lobes,), 1)))
    assert found.form_2d == pytest.approx(0.006, rel=0.03)
    assert found.form_3d > 0.004
    assert set(capability.changed(found, quiet).values()) == {"better"}
    assert set(capability.changed(quiet, found).values()) == {"worse"}


@pytest.mark.long
def test_repeatability_alone_is_no_change_of_a_probe(cell: Cell) -> None:
    """In 97.5 of 100 tests the form stays below what is printed beside it; 12 tests, 24 forms."""
    noise = cell.machine.probe.repeatability
    found = [capability.probing(measured(cell, "probe", World({}, {}, {}, noise, (), seed))) for seed in range(12)]
    above = sum(f.form_2d > f.noise_2d for f in found) + sum(f.form_3d > f.noise_3d for f in found)
    assert above <= 3
    assert np.mean([f.form_3d for f in found]) > 0.6 * found[0].noise_3d


def test_a_probe_test_with_a_touch_missing_is_refused(cell: Cell) -> None:
    touches = measured(cell, "probe", World())
    with pytest.raises(InputError, match="24 good touches of the sphere"):
        capability.probing(touches.rows(np.arange(len(touches) - 1)))


@pytest.mark.few(0)
@pytest.mark.parametrize(("draws", "least"), [(8, 6), pytest.param(40, 34, marks=pytest.mark.long)])
def test_a_thermometer_has_no_more_of_a_walk_than_chance_gives_it(draws: int, least: int) -> None:
    """A walk of the machine and one of the air that know nothing of each other, and 2 µm/K beside such a walk."""
    t, inside = np.arange(240) * 4.0, {0.0: 0, 0.002: 0}
    for effect in inside:
        for seed in range(draws):
            rng = np.random.default_rng([9, seed])
            air = 20 + np.cumsum(rng.normal(0, 0.05, len(t)))
            values = effect * air + np.cumsum(rng.normal(0, 2e-4, len(t))) + rng.normal(0, 7e-4, len(t))
            found = capability.environment(t, values, [air], 0.0007)
            inside[effect] += abs(found.per_kelvin - effect) < 2 * found.per_kelvin_std
    assert min(inside.values()) >= least  # of 40 a straight line holds 8 of both


@pytest.mark.long
def test_the_surroundings_move_a_facet_with_the_air() -> None:
    """ISO 230-3: the range of one facet, and how much of it a thermometer explains."""
    rng = np.random.default_rng(2)
    t = np.linspace(0.0, 4 * 3600.0, 240)
    air = 20 + 1.5 * np.sin(t / 3600)
    values = 0.004 * (air - 20) + 0.0007 * rng.standard_normal(len(t))
    found = capability.environment(t, values, [rng.standard_normal(240), air], 0.0007)
    assert abs(found.per_kelvin - 0.004) < 3 * found.per_kelvin_std
    assert found.temperature == pytest.approx(np.ptp(air)) and found.explained > 0.9
    assert found.etve > 1.5 * found.noise
    still = capability.environment(t, 0.0007 * rng.standard_normal(240), [], 0.0007)
    assert still.etve < still.noise and still.temperature == 0


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", KINDS)
def test_from_cell_to_budget_and_world_on_the_command_line(kind: Kind, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = examples()["hu40t"]
    world = tmp_path / "machine.yaml"
    lobing = {"cause": "probe_lobing", "amplitude": 0.003, "order": 3}
    world.write_text(yaml.safe_dump({"noise": 0.0006, "effects": [WALK, lobing], "seed": 3}), encoding="utf-8")

    def call(*args: object) -> int:
        return guarded(tango.main, [str(a) for a in args], standalone_mode=False)

    few = [] if kind in ("lobing", "probe") else ["--facets", "3", "--repetitions", 20 if kind != "wetness" else 80]
    target = tmp_path / kind
    assert call("capability", kind, "-C", source, "--cell", target, *few) == 0
    assert call("capability", kind, "-C", source, "--cell", target, *few) == 2  # nothing is ever overwritten
    assert call("simulate", "-C", target, "--world", world) == 0
    capsys.readouterr()
    budget, out = tmp_path / "uncertainty.yaml", tmp_path / "world.yaml"
    out.write_text("noise: 0.001\nerrors: {EX0C: 0.01}\n", encoding="utf-8")
    block = ["--block", 10] if kind == "wetness" else []
    options = [*block, "--budget", budget, "--world", out, "--json", "-"]
    assert call("capability", kind, "-C", target, *options) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["kind"] == kind and data["results"]
    lines = read_budget(budget)
    assert [line.source for line in lines] == [b["source"] for b in data["budget"]]
    assert read_world(out).errors == {"EX0C": 0.01}
    assert len(read_world(out).effects) == len(data["world"]["effects"])
    assert call("capability", kind, "-C", target, *block) == 0
    assert "µm" in capsys.readouterr().out
