"""Effects that grow, swing or happen: what each does to a touch, by hand. Y is 1 for a facet that looks to +y, and so on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.effectparts import CELL, MACHINE, TOUCHES, X, Y, along, at, measured, read_early, world

from sim_controller import effects
from sim_controller.simulate import simulate
from tango_cnc.records import World

GROWN = 1 - np.exp(-TOUCHES.time / 2400)
ACROSS = TOUCHES.normal_table  # n_w


@pytest.mark.few(0)
def test_thermal_drift_carries_the_table_along_its_direction() -> None:
    assert read_early("thermal_drift") == pytest.approx(0.01 * GROWN * along(Y), abs=1e-9)
    assert read_early("thermal_drift", shape="linear") == pytest.approx(0.01 * TOUCHES.time / 2400 * along(Y), abs=1e-9)


@pytest.mark.long
def test_table_drift_turns_with_the_table() -> None:
    assert read_early("table_drift") == pytest.approx(0.005 * GROWN * ACROSS[:, 1], abs=1e-9)
    linear = 0.005 * TOUCHES.time / 2400
    assert read_early("table_drift", shape="linear", direction=[3, 0, 4]) == pytest.approx(
        linear * (0.6 * ACROSS[:, 0] + 0.8 * ACROSS[:, 2]), abs=1e-9
    )
    assert np.abs(0.005 * GROWN * (along(Y) - ACROSS[:, 1])).max() > 0.003  # the machine's y is another direction


@pytest.mark.long
def test_a_warm_table_grows_out_of_its_middle() -> None:
    growing = 4e-5 * GROWN * np.sum(ACROSS * TOUCHES.point, axis=1)
    assert read_early("table_growth") == pytest.approx(growing, abs=1e-9)
    # one facet looks to −y, one to +y: 40 µm/m make each half of the way between them wider, at every indexation
    facets = CELL.artefact.facets.values()
    front, back = (next(f for f in facets if f.normal[1] * side > 0.999) for side in (-1, 1))
    low, high = front.point[1], back.point[1]
    assert low < -150 and high > 150
    at_front, at_back = (np.array(TOUCHES.facet) == f.id for f in (front, back))
    assert read_early("table_growth")[at_front] == pytest.approx(4e-5 * -low * GROWN[at_front], abs=1e-9)
    # held at one facet, the table grows away from it, and the other one goes the whole way
    held = read_early("table_growth", centre=[0, low, 0])
    assert np.abs(held[at_front]).max() < 1e-9
    assert held[at_back] == pytest.approx(4e-5 * (high - low) * GROWN[at_back], abs=1e-9)


@pytest.mark.few(0)
def test_a_warm_scale_takes_its_axis_further_than_it_reads() -> None:
    # X carries the table: further to +x is early for what looks to +x; Y carries the tool
    early = read_early("scale_drift", amplitude=1e-6)
    assert early == pytest.approx(1e-6 * GROWN * at("X") * along(X), abs=1e-9)
    held = read_early("scale_drift", amplitude=1e-6, axis="Y", zero=100)
    assert held == pytest.approx(-1e-6 * GROWN * (at("Y") - 100) * along(Y), abs=1e-9)
    linear = read_early("scale_drift", amplitude=1e-6, shape="linear")
    assert linear == pytest.approx(1e-6 * TOUCHES.time / 2400 * at("X") * along(X), abs=1e-9)


@pytest.mark.long
def test_the_hall_breathes() -> None:
    swing = 0.003 * np.sin(2 * np.pi * TOUCHES.time / 1200)
    assert read_early("ambient_cycle") == pytest.approx(swing * along(X), abs=1e-9)
    quarter = 0.003 * np.cos(2 * np.pi * TOUCHES.time / 1200)
    assert read_early("ambient_cycle", phase=90, direction=[0, 5, 0]) == pytest.approx(quarter * along(Y), abs=1e-9)


def test_drift_begins_anew_every_day_and_the_hall_does_not() -> None:
    cold = replace(TOUCHES, warm=TOUCHES.time, time=TOUCHES.time + 86_400)
    for cause, anew in (("table_drift", True), ("ambient_cycle", False)):
        chosen = effects.checked(world(cause, **({} if anew else {"period": 7000})).effects)
        one, next_day = (effects.disturbance(chosen, history, 5) for history in (TOUCHES_OF_ONE_DAY, cold))
        part = "table" if anew else "work"
        assert np.allclose(getattr(one, part), getattr(next_day, part)) == anew


TOUCHES_OF_ONE_DAY = replace(TOUCHES, warm=TOUCHES.time)


@pytest.mark.few(0)
def test_a_step_begins_with_its_touch_in_its_frame() -> None:
    after = np.arange(1, len(TOUCHES) + 1) >= 100
    assert read_early("step") == pytest.approx(0.005 * after * TOUCHES.normal[:, 2], abs=1e-12)
    assert read_early("step", frame="table") == pytest.approx(0.005 * after * ACROSS[:, 2], abs=1e-12)


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


def test_a_random_walk_grows_with_the_square_root_of_time() -> None:
    hours = 4.0
    later = replace(TOUCHES, time=np.linspace(0, hours * 3600, len(TOUCHES)))
    chosen = effects.checked(world("random_walk").effects)
    ends = [effects.disturbance(chosen, later, seed).work[-1] for seed in range(200)]  # type: ignore[index]
    assert np.std(ends) == pytest.approx(0.003 * np.sqrt(hours), rel=0.12)  # 600 values: one standard deviation is 3 %


def test_a_second_day_of_the_simulation_is_cold_again() -> None:
    two = simulate(MACHINE, CELL.artefact, CELL.strategy, world("table_drift"), days=2)
    one, other = two.position[: len(TOUCHES)], two.position[len(TOUCHES) :]
    assert one == pytest.approx(other, abs=1e-9)
    assert np.array_equal(measured(CELL, World()).day, TOUCHES.day)
