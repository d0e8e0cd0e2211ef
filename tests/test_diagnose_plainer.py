"""A shape is told with as little as does as well, and with what else it may follow; a name with what comes near to it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from support import blind
from support.diagnosis_parts import (
    LEGENDRE,
    Candidate,
    Factor,
    Field,
    Finding,
    Form,
    Kernel,
    Picked,
    Remainder,
    Rows,
    akin,
    grown,
    over,
    plainer,
    rows,
    scaled,
)

from tango_cnc.diagnose import Dropped, _seen
from tango_cnc.diagnose._remaining import _undecided
from tango_cnc.diagnose.sentences import dropped, nearly, unexplained
from tango_cnc.touches import from_readings


def means() -> Rows:
    b = blind.bench()
    touches = from_readings(b.cell.machine, b.cell.artefact, b.clean)
    return rows(touches, np.zeros(len(touches)))


def compared(m: Rows, *named: str) -> Field:
    """Shapes felt along Z of the machine, of one covariate or of two, as a model that explains nothing leaves them."""
    n = len(m.seen)

    def factor(name: str) -> Factor:
        v = m.seen.axis(name) if name != "time" else m.seen.warm
        return Factor(name, LEGENDRE, float(v.min()), float(v.max()), 2)

    forms = [Form(tuple(factor(x) for x in name.split(" × ")), "machine z") for name in named]
    kernels = [scaled(Kernel(f, "shape", f.columns(m.seen))) for f in forms]
    return Field(kernels, np.eye(n), np.ones(n), m)


@pytest.mark.few(0)
@pytest.mark.parametrize(("also", "told"), [(0.0, "time"), (1.0, "time × Z")])
def test_a_pair_is_told_only_where_both_covariates_are_needed(also: float, told: str) -> None:
    m = means()
    field = compared(m, "time × Z", "time", "time × X")
    u, z = (2 * (v - v.min()) / np.ptp(v) - 1 for v in (m.seen.warm, m.seen.axis("Z")))
    y = (u * (1 + also * z)) * m.seen.machine_normal[:, 2] + 0.3 * np.random.default_rng(1).normal(size=len(u))
    pair = field.kernels[0]
    begun = Picked(pair, field.project(pair), 1.0, 100.0)
    (shape,) = plainer(field, y, np.empty((len(y), 0)), [begun])
    assert shape.kernel.covariate == told
    assert ("time × Z" in shape.rivals) == (not also)
    assert told in [p.kernel.covariate for p in plainer(field, y, np.empty((len(y), 0)), grown(field, y, (), ()).picked)]


@pytest.mark.long
def test_a_name_whose_size_changes_is_told_with_what_else_it_may_follow() -> None:
    """Waves that grow with the tilt; on this plan the way there is nearly the tilt itself, and fits a little better by chance."""
    m = means()
    n = len(m.seen)
    rng = np.random.default_rng(3)
    waves, grows, apart = rng.normal(size=(3, n))

    def growing(covariate: str, by: np.ndarray) -> Kernel:
        return scaled(Kernel(None, "shape", (waves * by)[:, None], setting={"like": "cyclic_error", "covariate": covariate}))

    kernels = [growing("X × path of B 60", grows), growing("X × B", grows + 0.05 * apart), growing("X × time", apart)]
    field = Field(kernels, np.eye(n), np.ones(n), m)
    y = 0.5 * waves * grows + rng.normal(size=n)
    begun = Picked(kernels[0], field.project(kernels[0]), 1.0, 30.0)
    (shape,) = plainer(field, y, np.empty((n, 0)), [begun])
    assert (shape.kernel.covariate, shape.rivals) == ("X × B", ("X × path of B 60",))


@pytest.mark.parametrize(
    ("cause", "setting", "covariate"),
    [
        ("probe_hysteresis", {"frame": "spindle"}, "previous touch"),
        ("move_length_memory", {"axis": "X"}, "way of X"),
        ("backlash", {"axis": "Y"}, "dY"),
        ("moving_mass", {"name": "EAX", "by": "Z"}, "Z"),
        ("thermal_drift", {"frame": "machine"}, "time"),
    ],
)
def test_a_name_is_said_to_follow_what_it_follows(cause: str, setting: dict[str, Any], covariate: str) -> None:
    assert over(Candidate(cause, setting, (), np.zeros((1, 1)))) == covariate


@pytest.mark.few(0)
@pytest.mark.parametrize("like", [0.0, 1.0])
def test_what_a_name_changes_its_size_with_is_told_with_what_does_as_well(like: float) -> None:
    """Waves of C that grow with A; on this plan Z goes nearly where A goes, or it does not."""
    m, rng = means(), np.random.default_rng(3)
    tilt, other = rng.normal(size=(2, len(m.seen)))
    near = like * tilt + (0.1 if like else 1.0) * other
    waves = np.cos(2 * m.seen.axis("C"))
    kernels = [
        scaled(
            Kernel(None, "shape", (waves * by)[:, None], setting={"name": None, "like": "rotary_radial", "covariate": f"C × {a}"})
        )
        for a, by in (("Z", near), ("A", tilt), ("time", rng.normal(size=len(tilt))))
    ]
    field = Field(kernels, np.eye(len(tilt)), np.ones(len(tilt)), m)
    y = waves * near + 2 * rng.normal(size=len(tilt))
    (shape,) = plainer(field, y, np.empty((len(y), 0)), [Picked(kernels[0], field.project(kernels[0]), 1.0, 100.0)])
    assert shape.rivals == (("C × A",) if like else ())
    left = Remainder("C × Z", "none", "changing", 0.003, 0.5, np.zeros(1), confirm="rotary_radial", rivals=shape.rivals)
    assert ("or one of these: position of C together with position of A" in unexplained(left)) == bool(like)


def test_what_is_akin_follows_a_thing_in_common() -> None:
    def name(cause: str, **setting: Any) -> Candidate:
        return Candidate(cause, setting, (), np.zeros((1, 1)))

    assert akin(name("thermal_drift", frame="machine"), "time × Z")
    assert not akin(name("thermal_drift", frame="machine"), "probe direction")
    assert akin(name("probe_lobing", order=2), "probe direction × time")
    assert akin(name("cyclic_error", axis="Y"), "dY × time")
    assert akin(name("moving_mass", name="EAX", by="Z"), "Z") and not akin(name("moving_mass", name="EAX", by="Z"), "path of C 60")
    assert akin(name("chip", facet="4"), "normal z, table × time")


def test_a_cause_that_knows_the_touch_before_follows_that_and_not_time() -> None:
    before = {c: over(Candidate(c, {}, (), np.zeros((1, 1)))) for c in ("probe_hysteresis", "first_touch", "thermal_drift")}
    assert list(before.values()) == ["previous touch", "first touch of an indexation", "time"]


@pytest.mark.few(0)
def test_rough_facets_follow_nothing_where_they_have_their_weight() -> None:
    """A third of the facets scatters ten times as much: as if it were even, what goes with these facets has a pattern."""
    m = means()
    facets = list(dict.fromkeys(m.seen.facet))
    rough = np.isin(m.seen.facet, facets[::3])
    least = []
    for seed in (4, 5):
        data = np.random.default_rng(seed).normal(size=len(rough)) * np.where(rough, 10.0, 1.0)
        design, keep = np.ones((len(rough), 1)), np.ones(len(rough), dtype=bool)
        found = [_seen.tests(design, data, m.seen, keep, w) for w in (None, np.where(rough, 0.1, 1.0))]
        least.append([min(t.p_value for t in tests if t.covariate != "indexation") for tests in found])
    assert min(p for p, _ in least) < 1e-3
    assert min(p for _, p in least) > 1e-3


def test_a_name_beside_another_that_does_nearly_as_well_is_undecided() -> None:
    size = cast(Any, type("Size", (), {"amplitude": 0.003}))
    blank: Any = dict.fromkeys(Finding.__dataclass_fields__)
    one = Finding(
        **{**blank, "cause": "gravity_sag", "size": size, "alternatives": (("rotary_radial", {}, 4.0), ("step", {}, 8.0))}
    )
    (left,) = _undecided([one, replace(one, alternatives=(("step", {}, 8.0),))], 393)
    assert (left.shape, left.rivals) == ("undecided", ("rotary_radial",))
    assert "gravity_sag does best, and nearly as well does rotary_radial" in unexplained(left)
    assert "time together with position of Z, with an evidence of 12 less" in nearly(("time × Z", 12.2))


def test_a_name_whose_size_is_not_known_is_refused_with_the_size_and_how_sure_it_is() -> None:
    size = cast(Any, type("Size", (), {"amplitude": 0.0031, "amplitude_std": 0.0017}))
    blank: Any = dict.fromkeys(Finding.__dataclass_fields__)
    said = dropped(Dropped(Finding(**{**blank, "cause": "step", "size": size}), "size"))
    assert said == "it resembles step, which is not named: its size is not known to half of itself: 3.1 ± 1.7 µm"


@pytest.mark.parametrize(("behind", "undecided"), [(3.9, True), (4.1, False), (5.5, False)])
def test_of_two_names_one_is_ahead_by_what_the_wrong_one_hardly_ever_is(behind: float, undecided: bool) -> None:
    size = cast(Any, type("Size", (), {"amplitude": 0.003}))
    blank: Any = dict.fromkeys(Finding.__dataclass_fields__)
    one = Finding(**{**blank, "cause": "thermal_drift", "size": size, "alternatives": (("stylus_creep", {}, behind),)})
    assert [r.rivals for r in _undecided([one], 393)] == [("stylus_creep",)] * undecided


@pytest.mark.parametrize(
    ("less", "several", "told"), [(9.0, False, True), (12.0, False, False), (12.0, True, True), (21.0, True, False)]
)
def test_a_name_that_a_shape_comes_near_is_one_of_both_and_beside_another_name_it_has_to_be_sure(
    less: float, several: bool, told: bool
) -> None:
    size = cast(Any, type("Size", (), {"amplitude": 0.003}))
    blank: Any = dict.fromkeys(Finding.__dataclass_fields__)
    one = Finding(**{**blank, "cause": "step", "size": size, "alternatives": (), "nearest": ("time × Z", less)})
    left = _undecided([one], 393, [several])
    assert [(r.shape, r.covariate, r.confirm) for r in left] == [("near", "time × Z", "step")] * told
    for r in left:
        assert unexplained(r).startswith(
            "step explains these touches, but they cannot distinguish it from a shape without a name, which"
        )
        assert "time together with position of Z" in unexplained(r)
