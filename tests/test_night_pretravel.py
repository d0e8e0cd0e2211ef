"""Another ball, or a probe that triggers later: every touch is off alike. That is one number, and nothing of the machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_controller.simulate import simulate
from tango_cnc import state as s
from tango_cnc.files import read_cell, read_world
from tango_cnc.nightly import parts
from tango_cnc.records import Readings
from tango_cnc.touches import from_readings

EXAMPLES = Path(__file__).parent.parent / "examples"
EARLIER = [{"cause": "tip_wear", "amplitude": 0.01, "tau": 0.001}]  # mm, at once
UP = [{"cause": "step", "amplitude": 0.01, "direction": [0, 0, 1], "at": 1, "frame": "table"}]


@cache
def known(example: str) -> tuple[s.Frame, s.State]:
    """→ what is followed, and what three nights have told."""
    cell = read_cell(EXAMPLES / example)
    followed = s.frame(from_readings(cell.machine, cell.artefact, read(example, 1)), cell.terms)
    begin = after = s.start(followed, 0.0)
    for _ in range(3):
        what = s.seen(followed, read(example, 1), after.mean)
        after = s.updated(begin, what, s.judge(begin, what), quiet=False)
    for night in (2, 3):
        what = s.seen(followed, read(example, night), after.mean)
        after = s.updated(s.predicted(after, after.day + 1), what, s.judge(after, what))
    return followed, after


def read(example: str, seed: int, effects: list[dict[str, Any]] | None = None, every: int = 1, **knock: float) -> Readings:
    cell, truth = read_cell(EXAMPLES / example), read_world(EXAMPLES / example / "world.yaml")
    errors = {n: truth.errors.get(n, 0.0) + knock.get(n, 0.0) for n in {*truth.errors, *knock}}
    strategy = replace(cell.strategy, indexations=cell.strategy.indexations[::every])
    world = replace(truth, errors=errors, effects=tuple(effects or ()))
    return simulate(cell.machine, cell.artefact, strategy, world, seed=seed)


def night(example: str, readings: Readings) -> tuple[s.Named, s.State]:
    """→ what the night is called, and the state after it."""
    followed, state = known(example)
    ahead = s.predicted(state, state.day + 1)
    what = s.seen(followed, readings, ahead.mean)
    tonight = s.judge(ahead, what)
    found = s.name_change(ahead, followed, tonight, s.hypotheses(followed, None))
    assert found is not None
    return found, s.updated(parts.opened(ahead, followed, found), what, tonight, quiet=False)


@pytest.mark.few(1)
@pytest.mark.parametrize("every", [1, 4])
@pytest.mark.parametrize("example", ["trunnion", "fork_head", "hu40t"])
def test_a_larger_ball_is_one_number_and_no_backlash(example: str, every: int) -> None:
    """Balls of the artefact are touched early, too: 10 µm were two backlashes and a table before."""
    found, after = night(example, read(example, 7, EARLIER, every))
    assert [one.hypothesis.cause for one in found.all] == ["pretravel"]
    assert float(found.size[0]) == pytest.approx(-0.010, abs=4 * float(found.std[0]))
    machine = read_cell(EXAMPLES / example).machine
    tip = parts.triggering(machine, known(example)[0], after).probe.tip_radius
    assert tip == pytest.approx(machine.probe.tip_radius + 0.010, abs=1e-3)


CAUSES: list[tuple[dict[str, Any], set[str]]] = [
    ({"EXXb": 0.008, "EYYb": 0.006}, {"backlash"}),
    ({"effects": UP}, {"table"}),
    ({"EXXb": 0.010}, {"backlash"}),
]


@pytest.mark.few(0)
@pytest.mark.parametrize(("more", "causes"), CAUSES)
@pytest.mark.parametrize("example", ["trunnion", "fork_head"])
def test_what_the_machine_does_keeps_its_name(example: str, more: Mapping[str, Any], causes: set[str]) -> None:
    found, after = night(example, read(example, 8, **more))
    assert {one.hypothesis.cause for one in found.all} == causes
    assert np.isclose(after.mean[known(example)[0].place["pretravel"]], 0.0, atol=1e-6)


@pytest.mark.few(0)
@pytest.mark.parametrize("example", ["trunnion", "fork_head"])
def test_backlashes_of_one_size_are_named_in_place_of_a_ball(example: str) -> None:
    found, _ = night(example, read(example, 8, EXXb=0.008, EYYb=0.008))
    assert {one.hypothesis.parameter for one in found.all} == {"EXXb", "EYYb"}


@pytest.mark.few(0)
def test_small_ones_stand_beside_the_ball_that_does_the_same() -> None:
    """On the fork head a ball and a backlash of Z do nearly what these two do."""
    found, _ = night("fork_head", read("fork_head", 8, EXXb=0.0025, EYYb=0.0025))
    assert found.hypothesis.parameter == "probe" and {"EXXb", "EYYb"} <= {*found.instead}
