"""A learned shape among the terms: what the machine does is in maps and promises, and what it shares with parameters is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.diagnosis_parts import form_of

from sim_controller.simulate import simulate
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.model import Model, linearise
from tango_cnc.plausible import judge
from tango_cnc.records import Readings
from tango_cnc.terms import learned
from tango_cnc.verify.apart import apart
from tango_cnc.verify.volume import volume

TWIST = [{"covariate": axis, "kind": "polynomial", "low": -150.0, "high": 150.0, "count": 1} for axis in "XY"]
SIZES = [0.0, 0.0, 0.008]  # mm at the corners, of X, Y, X · Y


def term(weight: str = "machine z", values: list[float] = SIZES) -> dict[str, Any]:
    return {"cause": "learned", "name": "twist", "factors": TWIST, "weight": weight, "values": values}


@pytest.fixture(scope="module")
def twisted(root: Path) -> tuple[Any, Any, Readings]:
    """→ cell, its world and readings: the machine lifts the tool by a product of X and Y."""
    cell, world = read_cell(root / "examples" / "trunnion"), read_world(root / "examples" / "trunnion" / "world.yaml")
    hidden = replace(world, effects=(*world.effects, {**term(), "amplitude": 1.0}))
    return cell, world, simulate(cell.machine, cell.artefact, cell.strategy, hidden, seed=5)


def fitted(case: tuple[Any, Any, Readings], *terms: Any) -> Estimate:
    return estimate(case[0].machine, case[0].artefact, case[2], ("S3", *terms))


def test_what_moves_the_tool_is_in_the_map(twisted: tuple[Any, Any, Readings]) -> None:
    result = fitted(twisted, term())
    assert result.value("learned[twist]") == pytest.approx(1.0, abs=0.15)
    position = np.zeros((40, len(result.model.touches.machine.names)))
    position[:, :3] = np.random.default_rng(2).uniform(-100, 100, (40, 3))
    bare = Estimate(**{**vars(result), "values": result.values.copy()})
    bare.values[result.model.names.index("learned[twist]")] = 0.0
    apart_by = volume(result, position).error - volume(bare, position).error
    assert 1e-3 < np.abs(apart_by).max() < 8.5e-3
    assert apart(result) == ""


@pytest.mark.parametrize("weight", ["machine x", "machine z", "axis Y", "axis C", "tilt B of Z"])
def test_a_shape_that_moves_the_tool_is_felt_as_its_weight_says(weight: str, twisted: tuple[Any, Any, Readings]) -> None:
    touches = fitted(twisted).model.touches
    (moves,) = learned.make(twisted[0].machine, "twist", TWIST, weight, SIZES)
    assert moves.slot.axis
    pattern = form_of({"factors": TWIST, "weight": weight}).columns(touches) @ np.array(SIZES)
    _, jacobian = linearise(Model(touches, (moves,)), np.zeros(1 + len(touches.facets)))
    assert jacobian[:, 0] == pytest.approx(-pattern, abs=1e-9)  # early: the ball stands off less


def test_what_is_felt_by_touches_alone_is_named_beside_the_map(twisted: tuple[Any, Any, Readings]) -> None:
    assert "learned[twist]" in apart(fitted(twisted, term("none")))


def test_a_slope_in_a_shape_makes_the_parameters_it_takes_from_untrusted(twisted: tuple[Any, Any, Readings]) -> None:
    cell, world, readings = twisted
    for values in (SIZES, [0.004, 0.004, 0.008]):
        result = fitted(twisted, term(values=values))
        untrusted = judge(replace(cell, terms=("S3", term(values=values))), readings, result, search=False).untrusted
        off = {
            name: (result.value(name) - world.errors.get(name, 0.0)) / result.std[result.model.names.index(name)]
            for name in result.model.names
            if name in world.errors
        }
        wrong = {name for name, by in off.items() if abs(by) > 4}
        assert wrong <= set(untrusted), (wrong, untrusted)
        assert not wrong or values != SIZES
    assert wrong  # of the shape with slopes
