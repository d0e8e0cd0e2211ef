"""Effects of the simulated machine: one file a cause, pure, the same touch by touch and all at once."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from sim_controller import effects
from sim_controller.effects import Disturbance, History
from sim_controller.effects._apply import names
from sim_controller.probing import facet_rows, history, rig
from sim_controller.simulate import simulate
from tango_cnc.files import read_cell
from tango_cnc.records import Array, Cell, InputError, World


def flat(cell: Cell) -> Cell:
    """The cell without its balls, on which a displacement across the normal counts in second order."""
    facets = {name: facet for name, facet in cell.artefact.facets.items() if facet.ball is None}
    indexations = tuple(replace(i, facets=tuple(f for f in i.facets if f in facets)) for i in cell.strategy.indexations)
    artefact = replace(cell.artefact, facets=facets, balls={}, scale_bar=None)
    return replace(cell, artefact=artefact, strategy=replace(cell.strategy, indexations=indexations))


CELL = flat(read_cell(Path(__file__).parent.parent / "examples" / "hu40t"))
MACHINE = CELL.machine
# what world.yaml must at least give for each cause
LEAST = {
    "thermal_drift": {"amplitude": 0.01, "tau": 2400, "direction": [0, 1, 0]},
    "backlash": {"amplitude": 0.005, "axis": "X"},
    "probe_lobing": {"amplitude": 0.004},
    "surface_form": {"amplitude": 0.002},
    "step": {"amplitude": 0.005, "direction": [0, 0, 1], "at": 100},
    "indexation_seating": {"amplitude": 0.002},
    "chip": {"amplitude": 0.05, "facet": 16, "at": 30},
    "random_walk": {"amplitude": 0.003},
}


def world(cause: str, **more: object) -> World:
    return World(effects=({"cause": cause, **LEAST[cause], **more},), seed=5)


def known() -> History:
    """The touches of the example on a machine without errors."""
    r = rig(MACHINE, CELL.artefact, World())
    readings = simulate(MACHINE, CELL.artefact, CELL.strategy, World())
    rows = facet_rows(r, readings.facet)
    count = len(readings)
    feed, zero = np.full(count, 180.0), np.zeros(count)
    return history(r, rows, readings.position, readings.direction, readings.direction, readings.time, readings.day, feed, zero)


TOUCHES = known()


def read_early(cause: str, **more: object) -> Array:
    """→ (n,) mm: how much earlier than without the effect each surface is read, along the approach."""
    plain = simulate(MACHINE, CELL.artefact, CELL.strategy, World())
    changed = simulate(MACHINE, CELL.artefact, CELL.strategy, world(cause, **more))
    linear = [MACHINE.column(name) for name in MACHINE.linear]
    # the approach is along the normal: in the machine frame tool against work moves by the axis changes, X carrying the table
    change = (changed.position - plain.position)[:, linear] * np.array([-1.0, 1.0, 1.0])
    return np.einsum("ni,ni->n", change, TOUCHES.normal)


def rows(known: History, count: int) -> History:
    values = {f.name: getattr(known, f.name) for f in fields(known)}
    cut = {name: value[:count] if name not in ("machine", "artefact") else value for name, value in values.items()}
    return History(**cut)


def test_every_cause_has_its_line_above() -> None:
    assert set(LEAST) == set(names())


@pytest.mark.parametrize("cause", sorted(LEAST))
def test_an_effect_does_something_and_it_is_micrometres(cause: str) -> None:
    early = read_early(cause)
    assert 0.0005 < np.abs(early).max() < 0.06


@pytest.mark.parametrize("cause", sorted(LEAST))
@pytest.mark.parametrize("count", [1, 40, 200])
def test_an_effect_knows_nothing_of_later_touches(cause: str, count: int) -> None:
    chosen = effects.checked(world(cause).effects)
    whole = effects.disturbance(chosen, TOUCHES, 5)
    part = effects.disturbance(chosen, rows(TOUCHES, count), 5)
    for name in ("gap", "work", "table"):
        assert np.array_equal(getattr(whole, name)[:count], getattr(part, name))
    assert all(np.array_equal(whole.errors[name][:count], value) for name, value in part.errors.items())


@pytest.mark.parametrize("cause", sorted(LEAST))
def test_an_effect_is_decided_by_the_seed(cause: str) -> None:
    chosen = effects.checked(world(cause).effects)
    one, again, other = (effects.disturbance(chosen, TOUCHES, seed) for seed in (5, 5, 6))
    same = [np.array_equal(getattr(one, name), getattr(again, name)) for name in ("gap", "work", "table")]
    assert all(same)
    random = cause in ("surface_form", "indexation_seating", "random_walk")
    assert random != all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("gap", "work", "table"))


def test_thermal_drift_carries_the_table_along_its_direction() -> None:
    grown = 0.01 * (1 - np.exp(-TOUCHES.time / 2400))
    assert read_early("thermal_drift") == pytest.approx(grown * TOUCHES.normal[:, 1], abs=1e-9)
    linear = 0.01 * TOUCHES.time / 2400
    assert read_early("thermal_drift", shape="linear") == pytest.approx(linear * TOUCHES.normal[:, 1], abs=1e-9)


def test_backlash_is_the_normal_times_the_direction_of_the_axis() -> None:
    x, y = MACHINE.column("X"), MACHINE.column("Y")
    # X carries the table: further forwards means early; Y carries the tool: further forwards means late
    assert read_early("backlash") == pytest.approx(0.005 * TOUCHES.normal[:, 0] * TOUCHES.direction[:, x], abs=1e-9)
    assert read_early("backlash", axis="Y") == pytest.approx(-0.005 * TOUCHES.normal[:, 1] * TOUCHES.direction[:, y], abs=1e-9)


def test_probe_lobing_turns_with_the_spindle() -> None:
    s = TOUCHES.position[:, MACHINE.column("S")]
    azimuth = np.arctan2(TOUCHES.normal[:, 1], TOUCHES.normal[:, 0]) - s
    across = np.hypot(TOUCHES.normal[:, 0], TOUCHES.normal[:, 1])
    assert read_early("probe_lobing", phase=20) == pytest.approx(0.004 * across * np.cos(3 * azimuth + np.radians(20)), abs=1e-12)


def test_surface_form_is_white_and_only_where_it_is_said_to_be() -> None:
    rough = np.isin(TOUCHES.facet, ["16", "17", "18"])
    early = read_early("surface_form", facets=[16, 17, "18"])
    assert np.abs(early[~rough]).max() < 1e-12
    assert early[rough].std() == pytest.approx(0.002, rel=0.35)
    everywhere = read_early("surface_form")
    assert everywhere.std() == pytest.approx(0.002, rel=0.12)


def test_a_step_begins_with_its_touch_in_its_frame() -> None:
    after = np.arange(1, len(TOUCHES) + 1) >= 100
    assert read_early("step") == pytest.approx(0.005 * after * TOUCHES.normal[:, 2], abs=1e-12)
    assert read_early("step", frame="table") == pytest.approx(0.005 * after * TOUCHES.normal_table[:, 2], abs=1e-12)


def test_indexation_seating_is_one_displacement_for_each_indexation() -> None:
    early = read_early("indexation_seating")
    assert TOUCHES.indexation.max() == len(CELL.strategy.indexations) - 1
    seats = []
    for number in np.unique(TOUCHES.indexation):
        mine = TOUCHES.indexation == number
        if mine.sum() > 4:
            seat, *_ = np.linalg.lstsq(TOUCHES.normal[mine], early[mine], rcond=None)
            assert np.abs(TOUCHES.normal[mine] @ seat - early[mine]).max() < 1e-9
            seats.append(seat)
    assert np.std(seats) == pytest.approx(0.002, rel=0.5)


def test_a_chip_makes_one_facet_read_early_for_a_while() -> None:
    number = np.arange(1, len(TOUCHES) + 1)
    there = (np.array(TOUCHES.facet) == "16") & (number >= 30) & (number <= 200)
    assert there.sum() > 2
    assert read_early("chip", until=200) == pytest.approx(0.05 * there, abs=1e-12)


def test_a_random_walk_grows_with_the_square_root_of_time() -> None:
    hours = 4.0
    later = replace(TOUCHES, time=np.linspace(0, hours * 3600, len(TOUCHES)))
    chosen = effects.checked(world("random_walk").effects)
    ends = [effects.disturbance(chosen, later, seed).work[-1] for seed in range(200)]  # type: ignore[index]
    assert np.std(ends) == pytest.approx(0.003 * np.sqrt(hours), rel=0.12)  # 600 values: one standard deviation is 3 %


def test_effects_add_up() -> None:
    both = World(effects=world("step").effects + world("chip").effects, seed=5)
    plain = simulate(MACHINE, CELL.artefact, CELL.strategy, World())
    alone = [simulate(MACHINE, CELL.artefact, CELL.strategy, world(cause)).position - plain.position for cause in ("step", "chip")]
    together = simulate(MACHINE, CELL.artefact, CELL.strategy, both).position - plain.position
    assert together == pytest.approx(alone[0] + alone[1], abs=1e-11)


@pytest.mark.parametrize("letter", ["B", "C"])
def test_the_lever_of_a_rotary_axis_is_what_a_wrong_angle_does(letter: str) -> None:
    wrong = 1e-6
    plain = simulate(MACHINE, CELL.artefact, CELL.strategy, World())
    turned = simulate(MACHINE, CELL.artefact, CELL.strategy, World({f"E{letter}{letter}0": wrong}))
    linear = [MACHINE.column(name) for name in MACHINE.linear]
    change = (turned.position - plain.position)[:, linear] * np.array([-1.0, 1.0, 1.0])
    assert np.einsum("ni,ni->n", change, TOUCHES.normal) == pytest.approx(wrong * effects.lever(TOUCHES, letter), abs=1e-9)


@pytest.mark.parametrize(
    ("effect", "complaint"),
    [
        ({"cause": "thermal_drfit"}, r"effects\[0\]\.cause: found 'thermal_drfit'.*Did you mean 'thermal_drift'"),
        ({"cause": "step", "amplitud": 1}, r"effects\[0\]: found the unknown key 'amplitud'.*Did you mean 'amplitude'"),
        ({"cause": "step", "amplitude": 0.1, "at": 3}, "found no key 'direction'; step requires it"),
        ({"cause": "step", "amplitude": "big", "at": 3, "direction": [0, 0, 1]}, "found 'big'; allowed: a finite number"),
        ({"cause": "step", "amplitude": 0.1, "at": 2.5, "direction": [0, 0, 1]}, "found 2.5; allowed: a whole number"),
        ({"cause": "step", "amplitude": 0.1, "at": 2, "direction": [0, 0, 0]}, "three numbers, not all zero"),
        ({"cause": "backlash", "amplitude": 0.1, "axis": "B"}, "found 'B'; allowed: X, Y, Z"),
        ({"cause": "surface_form", "amplitude": 0.1, "facets": 16}, "found 16; allowed: a list of names"),
    ],
)
def test_a_wrong_effect_is_refused(effect: dict, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        effects.checked([effect])


def test_a_disturbance_without_anything_changes_nothing() -> None:
    nothing = effects.disturbance((), TOUCHES, 5)
    assert isinstance(nothing, Disturbance)
    assert not np.any(nothing.gap) and not np.any(nothing.work) and not np.any(nothing.table) and not nothing.errors
