"""Covariates are compared with the functions that suit each of them, and not with those that happened to be tried."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from support import blind
from support.diagnosis_parts import (
    BEYOND,
    EVEN,
    LEGENDRE,
    SIDE,
    WAVES,
    Factor,
    Field,
    Form,
    Kernel,
    Picked,
    Rows,
    begin,
    plainer,
    rows,
    scaled,
    weights,
)

from tango_cnc.diagnose._adapted import Adapting, factors
from tango_cnc.diagnose._plainer import _levers
from tango_cnc.records import Array
from tango_cnc.terms._shape import values
from tango_cnc.touches import Touches, from_readings


@cache
def means() -> Rows:
    b = blind.bench()
    touches = from_readings(b.cell.machine, b.cell.artefact, b.clean)
    return rows(touches, np.zeros(len(touches)))


def told(
    hidden: Callable[[Touches], Array], felt: str, compared: list[tuple[str, str]], seed: int = 3, peak: float = 7.0
) -> list[tuple[str, str, tuple[str, ...]]]:
    """what is hidden (n,), how a touch feels it, shapes that are compared with their frames, all chosen in this order at first →
    covariates, frame and rivals as they are told; the model explains nothing here.
    """
    m = means()
    known = values(m.seen)

    def factor(name: str) -> Factor:
        v = known[name]
        return Factor(name, SIDE, -1.0, 1.0, 1) if name[0] == "d" else Factor(name, LEGENDRE, float(v.min()), float(v.max()), 2)

    forms = [Form(tuple(factor(x) for x in name.split(" × ")), frame) for name, frame in compared]
    field = Field([scaled(Kernel(f, "shape", f.columns(m.seen))) for f in forms], np.eye(len(m.seen)), np.ones(len(m.seen)), m)
    y = hidden(m.seen) * weights(m.seen, felt)[:, 0]
    y = y / np.abs(y).max() * peak + np.random.default_rng(seed).normal(size=len(y))
    begun = [Picked(k, field.project(k), 1.0, 100.0) for k in field.kernels[:2]]
    found = plainer(field, y, np.empty((len(y), 0)), begun[:1] if len(compared) > 2 else begun)
    return [(p.kernel.covariate, p.kernel.form.weight if p.kernel.form else "", p.rivals) for p in found]


def unit(v: Array) -> Array:
    return np.asarray(2 * (v - v.min()) / np.ptp(v) - 1)


@pytest.mark.few(0)
def test_a_load_that_is_alike_to_both_sides_of_a_tilt_is_no_course_of_time() -> None:
    three = [("time × X", "machine z"), ("X × B", "machine z"), ("time × Z", "machine z")]
    (shape,) = told(lambda t: unit(t.axis("X")) ** 2 * np.abs(np.sin(t.axis("B"))), "machine z", three)
    assert shape[0] == "X × B"


@pytest.mark.long
def test_lost_motion_that_turns_a_carriage_is_told_in_its_own_frame() -> None:
    three = [("X × B", "machine x"), ("dX × Y", "axis X"), ("time × X", "machine x")]
    (shape,) = told(lambda t: t.sign("X") * unit(t.axis("Y")), "tilt C of X", three)
    assert shape[:2] == ("dX × Y", "tilt C of X")


@pytest.mark.long
def test_a_part_of_what_another_shape_follows_is_left_out_once_its_functions_suit_it() -> None:
    """What rests elsewhere beyond an angle of both axes was a wave of one axis and a product of both."""
    two = [("C", "machine y"), ("B × C", "machine y")]
    found = told(lambda t: 1.0 * ((t.axis("B") > -0.1) & (t.axis("C") > -0.1)), "machine y", two)
    assert [covariate for covariate, _, _ in found] == ["B × C"]


def test_a_tilt_that_follows_an_angle_is_listed_as_a_shift_that_follows_a_place_too() -> None:
    two = [("B", "tilt A of X"), ("B × X", "machine y"), ("time × X", "machine y")]
    (shape,) = told(lambda t: 1.0 * (t.axis("B") > 0.1), "tilt A of X", two)
    assert shape == ("B", "tilt A of X", ("Y × B",))
    touches = means().seen
    assert [_levers(Kernel(Form((), f"tilt {c} of X"), "shape", np.zeros((1, 1))), touches) for c in "AC"] == [["Y"], []]


@pytest.mark.long
def test_a_pair_that_no_shape_had_is_told_in_the_place_of_two_that_follow_its_parts() -> None:
    """What grows along Y beyond a tilt was a function of the tilt, and one of the tilt and Z that followed what this left."""
    two = [("B", "machine z"), ("Z × B", "machine y")]
    found = told(lambda t: (t.axis("B") > 0.1) * unit(t.axis("Y")), "machine z", two)
    assert [covariate for covariate, _, _ in found] == ["Y × B"]


@pytest.mark.long
def test_two_shapes_that_are_two_stay_two() -> None:
    m = means()
    forms = [Form((Factor("time", LEGENDRE, float(m.seen.warm.min()), float(m.seen.warm.max()), 2),), "machine x")]
    forms.append(Form((Factor("B", LEGENDRE, float(m.seen.axis("B").min()), float(m.seen.axis("B").max()), 2),), "machine z"))
    field = Field([scaled(Kernel(f, "shape", f.columns(m.seen))) for f in forms], np.eye(len(m.seen)), np.ones(len(m.seen)), m)
    x, z = (weights(m.seen, f"machine {c}")[:, 0] for c in "xz")
    y = 5 * unit(m.seen.warm) * x + 5 * np.cos(m.seen.axis("B")) * z + np.random.default_rng(3).normal(size=len(x))
    begun = [Picked(k, field.project(k), 1.0, 100.0) for k in field.kernels]
    found = plainer(field, y, np.empty((len(y), 0)), begun)
    assert {p.kernel.covariate for p in found} == {"time", "B"}


@pytest.mark.long
def test_of_three_shapes_two_that_are_one_are_told_as_one() -> None:
    m = means()
    time, angle, place = (
        Factor(name, LEGENDRE, float(values(m.seen)[name].min()), float(values(m.seen)[name].max()), 2)
        for name in ("time", "B", "Z")
    )
    forms = [Form((angle,), "machine z"), Form((place, angle), "machine y"), Form((time,), "machine x")]
    field = Field([scaled(Kernel(f, "shape", f.columns(m.seen))) for f in forms], np.eye(len(m.seen)), np.ones(len(m.seen)), m)
    x, z = (weights(m.seen, f"machine {c}")[:, 0] for c in "xz")
    pattern = (m.seen.axis("B") > 0.1) * unit(m.seen.axis("Y")) * z + unit(m.seen.warm) * x
    y = 7 * pattern / np.abs(pattern).max() + np.random.default_rng(3).normal(size=len(x))
    found = plainer(field, y, np.empty((len(y), 0)), [Picked(k, field.project(k), 1.0, 100.0) for k in field.kernels])
    assert {p.kernel.covariate for p in found} == {"Y × B", "time"}


@pytest.mark.long
def test_what_reverses_with_the_side_is_a_rival_where_every_touch_came_from_one_side() -> None:
    three = [("Z", "machine z"), ("dZ × Z", "machine z"), ("time × Z", "machine z")]
    (shape,) = told(lambda t: np.tanh(4 * unit(t.axis("Z"))), "machine z", three)
    assert shape[0] == "Z" and "dZ × Z" in shape[2]


@pytest.mark.few(0)
def test_one_shape_at_least_is_told() -> None:
    found = told(lambda t: np.zeros(len(t)) + 1e-9, "machine y", [("C", "machine y"), ("B × C", "machine y")])
    assert len(found) == 1


def test_functions_are_those_that_a_covariate_can_have() -> None:
    touches = means().seen
    known = values(touches)
    kinds = {
        name: {f.kind for f in factors(touches, name, known[name])} for name in ("X", "B", "dX", "probe direction", "time", "pause")
    }
    assert kinds["dX"] == {SIDE}
    assert EVEN in kinds["B"] and EVEN not in kinds["X"]
    assert BEYOND in kinds["X"] and BEYOND not in kinds["pause"]
    assert kinds["X"] == {LEGENDRE, WAVES, BEYOND}


def test_places_and_periods_pay_for_being_chosen() -> None:
    m = means()
    field = Field([scaled(Kernel(None, "shape", weights(m.seen, "machine z")))], np.eye(len(m.seen)), np.ones(len(m.seen)), m)
    y = (m.seen.axis("X") > 0) * m.seen.machine_normal[:, 2] * 5 + np.random.default_rng(1).normal(size=len(m.seen))
    s = begin(field, y, np.empty((len(y), 0)))
    step = Adapting(field).adapt(s, ("X",), ("machine z",))
    assert step.kernel.form is not None and step.kernel.form.factors[0].kind == BEYOND
    assert step.choice == pytest.approx(2 * np.log(sum(f.kind == BEYOND for f in factors(m.seen, "X", m.seen.axis("X")))))


@pytest.mark.long
@pytest.mark.parametrize(("peak", "first"), [(5.0, "way of Y × Y"), (4.0, "dY × way of Y")])
def test_a_pair_is_told_or_listed_where_few_functions_of_each_follow_it(peak: float, first: str) -> None:
    """A screw that whips with the way that it went, the more the farther out: many functions of both diluted what few say."""
    way = values(means().seen)["way of Y"]
    three = [("way of Y", "machine y"), ("time × X", "machine y"), ("X × B", "machine x")]
    (shape,) = told(lambda t: np.abs(way) * unit(t.axis("Y")), "machine y", three, seed=4, peak=peak)
    assert shape[0] == first and "way of Y × Y" in (shape[0], *shape[2])
