"""Where the axes turn: what is said where nothing takes the probe clear names the indexation as people count it."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from support.blockcell import block, cell, machine

from tango_cnc import check
from tango_cnc.plan import plan, sweep
from tango_cnc.plan.build import attempt
from tango_cnc.plan.clearance import MARGIN
from tango_cnc.plan.guard import TRAVEL, Guard
from tango_cnc.plan.places import Places, nowhere, scene
from tango_cnc.plan.travel import DROP
from tango_cnc.plan.ways import RISES, lifts
from tango_cnc.records import InputError, Machine


def test_where_no_lift_takes_the_probe_clear_the_indexation_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is lifted at all here, so the probe stays within what the table sweeps."""
    monkeypatch.setattr("tango_cnc.plan.clearance.TRIES", 0)
    with pytest.raises(InputError, match=r"indexation 1 \(.*no lift takes the probe clear of what the rotary axes sweep"):
        plan(cell(machine("wCBXfZY(S)t"), block(), [{}, {"B": 30, "C": 40}]), "leave-out")


def test_where_the_retract_at_the_end_is_not_possible_it_is_a_fault_of_the_turn_after_the_last_touch(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its place is above the last touch, where the probe stands already: who looks for plans has one to look at."""
    monkeypatch.setattr("tango_cnc.plan.clearance.TRIES", 0)
    made, faults = attempt(cell(machine("wCBXfZY(S)t"), block(), [{}, {"B": 30, "C": 40}]), "leave-out")
    assert max(faults) == list(made.touches)[-1].number + 1
    last = list(made.turns)[-1]
    assert last.before == last.after == pytest.approx(list(made.touches)[-1].over)


@pytest.mark.parametrize(("standoff", "obstacle"), [(2.0, False), (25.0, False), (2.0, True)])
def test_the_clear_level_is_above_every_stand_off_and_above_all_that_stands_on_the_table(standoff: float, obstacle: bool) -> None:
    """By the drop above the highest stand-off, by the margin above the highest corner: the higher one of the two, no more."""
    made = cell(machine("wCBXfZY(S)t"), block(obstacle=obstacle), [{}, {"B": 30, "C": 40}], standoff=standoff)
    shared = scene(made.machine, made.artefact, made.strategy)
    facet = np.tile(np.arange(len(shared.facet)), 2)
    at = np.repeat([0, 1], len(shared.facet))
    clear, level = lifts(shared, facet, at)[0][0], lifts(shared, facet, at)[1]
    tip, up = shared.standoff(facet, at)
    height = np.einsum("ij,ij->i", tip, up)
    assert clear == pytest.approx(level[at] - height)
    for index in (0, 1):
        highest = height[at == index].max()
        top = check.solid(made.artefact).top(up[at == index][:1])[0] + made.machine.probe.tip_radius
        assert level[index] == pytest.approx(max(highest + DROP, top + MARGIN))


class InTheWay:
    """A guard of a machine on which one thing stands, its first pair: at these angles of B it is passed so high."""

    def __init__(self, made: Machine, high: dict[int, float]) -> None:
        self.b, self.z, self.high = made.column("B"), made.column("Z"), high

    def meets(self, places: np.ndarray, margin: int) -> np.ndarray:
        assert margin == TRAVEL
        high = [self.high.get(round(angle), -np.inf) for angle in np.degrees(places[:, 0, self.b])]
        return np.where(places[:, :, self.z].min(axis=1) < high, 0, -1)


def test_the_clear_level_of_an_indexation_is_raised_as_far_as_what_is_in_the_way_there_asks_for() -> None:
    """By the first rise that helps; nothing else is raised, and the ways between its touches go at that level."""
    made = cell(machine("wCBXfZY(S)t"), block(), [{}, {"B": 30}, {"B": -40}])
    shared = scene(made.machine, made.artefact, made.strategy)
    facet, at = np.tile(np.arange(3), 3), np.repeat([0, 1, 2], 3)
    free, level = lifts(shared, facet, at)
    standoff, up = shared.standoff(facet, at)
    z = shared.axes(at, (standoff + free[0][:, None] * up)[None])[0][:, made.machine.column("Z")]
    guard = InTheWay(made.machine, {30: z[3] + RISES[1] - 1.0, -40: z[6] + RISES[3] - 1.0})
    raised, higher = lifts(replace(shared, guard=cast(Guard, guard)), facet, at)
    assert higher - level == pytest.approx([0.0, RISES[1], RISES[3]])
    assert raised[0] - free[0] == pytest.approx(np.repeat([0.0, RISES[1], RISES[3]], 3))
    assert raised[:, at == 0] == pytest.approx(free[:, at == 0])
    for first in (3, 4, 6, 7):  # touches that the next one follows at the same angles: up, over and down at that level
        assert raised[2, first] == pytest.approx(raised[0, first]) and raised[1, first + 1] == pytest.approx(raised[0, first + 1])


@pytest.mark.parametrize(
    ("topology", "turns"),
    [("wCBfXYZ(S)t", True), ("wCBXfZY(S)t", True), ("wfXYZBC(S)t", False), ("wXYfZBC(S)t", False)],
)
def test_a_table_sweeps_a_sphere_where_a_rotary_axis_carries_it(topology: str, turns: bool) -> None:
    """It holds every corner of what is on the table."""
    artefact = block(obstacle=True)
    found = sweep.swept(machine(topology), check.solid(artefact))
    assert (found is not None) is turns
    if found is not None:
        centre, radius = found
        corners = np.vstack([body.corner for body in check.solid(artefact).obstacles])
        assert np.linalg.norm(corners - centre, axis=1).max() <= radius


@pytest.mark.parametrize("rows", [[0, 1, 2, 3, 4, 5], [5, 3, 3, 0], [4], [1]])
def test_touches_that_are_left_to_another_place_are_those_alone_whichever_are_asked_for(rows: list[int]) -> None:
    made = cell(machine("wCBXfZY(S)t"), block(), [{}])
    shared = scene(made.machine, made.artefact, made.strategy)
    facet, at, lift = np.arange(6), np.zeros(6, int), np.full((3, 6), 20.0)
    plain = Places(shared, facet, at, lift, nowhere(len(made.machine.names)))
    elsewhere = np.arange(2.0 * len(made.machine.names)).reshape(2, -1)
    found = replace(plain, left=(np.array([1, 3]), elsewhere))(np.array(rows))
    expected = plain(np.array(rows))
    for i, row in enumerate(rows):
        if row in (1, 3):
            expected[i, 5] = elsewhere[[1, 3].index(row)]
    np.testing.assert_array_equal(found, expected)
