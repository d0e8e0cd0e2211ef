"""Programs read back on machines that have something on their bodies: what meets it is refused, and what keeps off passes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.bodies import SETTER, YOKE, met, random_bodies, trunnion
from support.randomplans import example
from support.readback import lines_of, read_back, refused

from tango_cnc.gate import proving_touch
from tango_cnc.kinematics import chain, tip
from tango_cnc.plan import plan
from tango_cnc.records import Obstacle, Plan

POST = Obstacle("box", low=(-20.0, -20.0, 20.0), high=(20.0, 20.0, 200.0), on="A", title="post")
HOUSING = Obstacle("box", low=(60.0, -100.0, -238.0), high=(100.0, 100.0, 200.0), on="Z", title="housing")


@pytest.fixture(scope="module")
def made() -> Plan:
    return plan(trunnion(*YOKE, SETTER, indexations=2))


@pytest.mark.few(0)
@pytest.mark.parametrize("gate", ["none", "finger", "facet"])
def test_what_keeps_off_passes(made: Plan, gate: str) -> None:
    assert read_back(lines_of("fanuc", made, gate=gate), made, "fanuc", gate=gate)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("obstacle", "words"),
    [
        (
            replace(SETTER, base=(340.0, 100.0, -300.0)),
            "cheek, on A) comes within 0.5 mm of obstacle 4 of machine.yaml (tool setter",
        ),
        (POST, "the tip comes within 0.5 mm of obstacle 4 of machine.yaml (post, on A)"),
        (HOUSING, "of obstacle 4 of machine.yaml (housing, on Z)"),
    ],
)
def test_a_program_that_meets_something_is_refused_with_its_line(made: Plan, obstacle: Obstacle, words: str) -> None:
    changed = replace(made, machine=replace(made.machine, obstacles=(*YOKE, obstacle)))
    said = refused(lines_of("fanuc", changed), made=changed)
    assert said.startswith("program line ") and words in said


def test_the_way_to_the_facet_that_proves_the_probe_is_looked_at() -> None:
    """A block half way from the first touch to the facet that is touched from above: the touches themselves never go there."""
    cell = trunnion(indexations=1)
    facets = ("5", "6", "14", "8", "101")
    cell = replace(cell, strategy=replace(cell.strategy, indexations=(replace(cell.strategy.indexations[0], facets=facets),)))
    free = plan(cell)
    over = np.array([free.touches[0].over, proving_touch(free).over])
    middle = tip(chain(cell.machine), over).mean(axis=0)
    low, high = (tuple((middle + side).tolist()) for side in (-2.0, 2.0))
    block = replace(free, machine=replace(free.machine, obstacles=(Obstacle("box", low=low, high=high, on="A"),)))
    assert not refused(lines_of("fanuc", block, gate="none"), made=block, gate="none")
    assert "the tip comes within 0.5 mm of obstacle 1" in refused(lines_of("fanuc", block, gate="facet"), made=block, gate="facet")


def campaign(seed: int, count: int) -> tuple[int, int, int]:
    """seed, machines → plans made around what is there, blind plans that meet it, and how many of these are refused."""
    planned = meets = seen = 0
    for _, one in zip(range(count), random_bodies(seed), strict=False):
        if one.made is not None:
            planned += 1
            assert not refused(lines_of("fanuc", one.made), made=one.made), "a plan that keeps off is refused"
        blind = replace(one.blind, machine=one.machine)
        if met(one.blind, replace(example("trunnion"), machine=one.machine, artefact=one.blind.artefact)):
            meets += 1
            seen += bool(refused(lines_of("fanuc", blind), made=blind))
    return planned, meets, seen


@pytest.mark.long
def test_random_programs_are_refused_where_the_simulated_machine_meets_something() -> None:
    planned, meets, seen = campaign(7, 10)
    assert planned and meets and seen == meets


@pytest.mark.few(0)
def test_a_door_at_its_place_is_kept_off_and_one_too_near_is_refused() -> None:
    """The closed door of docs/formats.md; half a meter nearer the table would run into it."""
    door = Obstacle("box", low=(-700.0, -760.0, -400.0), high=(700.0, -700.0, 900.0), on="f", title="closed door")
    made = plan(trunnion(door, indexations=1))
    assert read_back(lines_of("fanuc", made), made, "fanuc")
    near = replace(door, low=(-700.0, -260.0, -400.0), high=(700.0, -200.0, 900.0))
    changed = replace(made, machine=replace(made.machine, obstacles=(near,)))
    assert "(closed door, on f)" in refused(lines_of("fanuc", changed), made=changed)
