"""Names of one thing have to beat one shape together; what a plan saw from one side only may be lost motion."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from support import blind
from support.diagnosis_parts import (
    LEGENDRE,
    SIDE,
    Candidate,
    Chosen,
    Factor,
    Field,
    Form,
    Kernel,
    Outcome,
    Rows,
    akin,
    candidate,
    foreign,
    rows,
    scaled,
)

from tango_cnc.diagnose import _suited
from tango_cnc.records import Array
from tango_cnc.touches import from_readings


@cache
def means() -> Rows:
    b = blind.bench()
    touches = from_readings(b.cell.machine, b.cell.artefact, b.clean)
    return rows(touches, np.zeros(len(touches)))


def field_of(*forms: Form) -> Field:
    """Shapes, as a model that explains nothing leaves them."""
    m = means()
    return Field([scaled(Kernel(f, "shape", f.columns(m.seen))) for f in forms], np.eye(len(m.seen)), np.ones(len(m.seen)), m)


def name(cause: str, **setting: object) -> Chosen:
    """A name that costs what two numbers do."""
    c = candidate(means().seen, cause, setting)
    return Chosen(c, c.columns / np.abs(c.columns).max(), 18.0)


def outcome(*names: Chosen, above: float) -> Outcome:
    """These names stand, each so much above every shape in its place."""
    return Outcome(names, (), (), 0.0, 0.0, 0.0, above={id(c): above for c in names}, nearest={id(c): "B" for c in names})


def noisy(pattern: Array) -> Array:
    """7 of noise where it is largest."""
    return np.asarray(7 * pattern / np.abs(pattern).max() + np.random.default_rng(3).normal(size=len(pattern)))


def angle_of(axis: str) -> Form:
    v = means().seen.axis(axis)
    return Form((Factor(axis, LEGENDRE, float(v.min()), float(v.max()), 3),), "axis X")


@pytest.mark.long
def test_two_waves_of_an_axis_that_one_shape_follows_better_are_lost_together() -> None:
    """Lost motion of X that changes sides with the tilt is two waves of the tilt: none of them alone is worse than a shape."""
    t = means().seen
    y = noisy(t.sign("X") * np.sign(np.round(t.axis("B"), 6)) * t.lever("X"))
    waves = [name("rotary_radial", axis="B", order=k, motion="X") for k in (2, 4)]
    field = field_of(Form((Factor("dX", SIDE, -1.0, 1.0, 1), *angle_of("B").factors), "axis X"), angle_of("B"))
    (first, *_) = _suited.suited(field, y, (), waves, outcome(*waves, above=30.0))
    assert first.names == tuple(waves) and first.lost and first.covariate == "dX × B"


@pytest.mark.long
def test_two_names_that_are_there_are_not_lost_to_one_shape() -> None:
    waves = [name("rotary_radial", axis="B", order=2, motion="X"), name("encoder_harmonic", axis="B", order=1)]
    y = noisy(sum(c.columns[:, 0] / np.abs(c.columns[:, 0]).max() for c in waves))
    field = field_of(angle_of("B"), angle_of("C"))
    assert not any(one.lost for one in _suited.suited(field, y, (), waves, outcome(*waves, above=30.0)))


def test_names_that_are_sure_and_follow_nothing_in_common_are_not_asked() -> None:
    names = [name("rotary_radial", axis="B", order=2, motion="X"), name("encoder_harmonic", axis="C", order=1)]
    assert _suited.suited(field_of(angle_of("B")), np.ones(len(means().seen)), (), names, outcome(*names, above=30.0)) == []


def kinked(both_sides: bool) -> tuple[_suited.Suited, tuple[str, ...], Outcome]:
    """A kink of Z, whether its axis came from both sides → what comes near to it, what would tell, the outcome with it."""
    m, rng = means(), np.random.default_rng(1)
    field = field_of(angle_of("Z"))
    came = rng.choice([-1.0, 1.0], len(m.seen)) if both_sides else -np.ones(len(m.seen))
    touches = m.seen.rows(np.arange(len(m.seen)))
    touches.direction[:, touches.machine.column("Z")] = came
    field.touches = touches
    kink = name("compensation_kink", axis="Z", at=float(np.median(m.seen.axis("Z"))))
    y = noisy(kink.columns[:, 0])
    (one,) = _suited.turned(field, y, (), [kink], ())
    return one, _suited.telling([one], kink), _suited.nearer(outcome(kink, above=40.0), [one])


def test_a_kink_that_was_seen_from_one_side_may_be_lost_motion_that_changes_along_the_axis() -> None:
    one, telling, now = kinked(both_sides=False)
    assert one.above == pytest.approx(0.0, abs=1e-6) and one.covariate == "dZ × Z"
    assert "touch there with Z coming from the other side" in telling[0]
    assert list(now.nearest.values()) == ["dZ × Z"] and max(now.above.values()) < 1e-6


def test_a_kink_that_was_seen_from_both_sides_is_a_kink() -> None:
    one, telling, now = kinked(both_sides=True)
    assert one.above > 40 and not telling and list(now.nearest.values()) == ["B"]


def test_a_shape_is_another_cause_where_it_follows_what_the_name_does_not() -> None:
    radial = Candidate("rotary_radial", {"axis": "A"}, np.zeros((1, 1)))
    assert foreign(radial, "dY × A") and not foreign(radial, "A") and not foreign(radial, "")
    assert not foreign(Candidate("moving_mass", {"name": "EBX", "by": "Y"}, np.zeros((1, 1))), "X × Y")


def test_an_error_motion_follows_its_axis_and_not_its_degree() -> None:
    motion = Candidate("error_motion", {"name": "EYA2"}, np.zeros((1, 1)))
    assert akin(motion, "dY × A") and not akin(motion, "C")
