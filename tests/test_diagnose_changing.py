"""Names that only nearly fit: a size that changes, a rest that is no noise, a rival close behind, too few touches."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from support import annex, blind, judge, trials, workshop
from support.diagnosis_parts import Candidate, Chosen, Field, Kernel, Rows, contest, left_over, rest, scaled, unsteady
from support.diagnosis_parts import Test as Covered

from tango_cnc.diagnose import FREE, Diagnosis, diagnose
from tango_cnc.diagnose.words import as_text
from tango_cnc.records import Array

TOUCHES = 300


def field_of(shapes: list[Array]) -> Field:
    """shapes (n, k) → them as rivals, each following what its number says."""
    kernels = [scaled(Kernel(None, "shape", x, setting={"covariate": f"shape {i}"})) for i, x in enumerate(shapes)]
    return Field(kernels, np.eye(TOUCHES), np.ones(TOUCHES), cast(Rows, SimpleNamespace(seen=None)))


def left(y: Array, shapes: list[Array], name: Array) -> list[str]:
    """data (n,), shapes (n, k), pattern of a name (n,) → what the rest beside the name follows."""
    one = Chosen(Candidate("chip", {}, name[:, None]), name[:, None], 12.0)
    field = field_of(shapes)
    return [r.covariate for r in rest(field, contest(field, y, [], [one]), y, [one], True, 0)]


@pytest.mark.few(0)
def test_what_is_left_beside_a_name_is_asked_once_more_against_what_chance_does() -> None:
    """The shape is too weak for its price among many that are alike, and the name stands; but noise hardly does as much."""
    rng = np.random.default_rng(8)
    name, weak, *others = rng.normal(size=(12, TOUCHES))
    shapes = [(one + 0.02 * rng.normal(size=TOUCHES))[:, None] for one in (weak, *others) for _ in range(20)]
    by_chance = [left(3 * name + rng.normal(size=TOUCHES), shapes, name) for _ in range(5)]
    assert sum(map(bool, by_chance)) <= 1
    heavy = [left(3 * name + rng.standard_t(3, size=TOUCHES), shapes, name) for _ in range(5)]
    assert sum(map(bool, heavy)) <= 1
    y = 3 * name + 0.2 * weak + rng.normal(size=TOUCHES)
    assert 0 <= int(left(y, shapes, name)[0].split()[1]) < 20


def test_the_covariate_of_a_name_is_asked_alone() -> None:
    """A chance of 1 in 250 proves nothing of twenty covariates, and something of the one axis that the name is about."""

    def test(covariate: str, p: float) -> Covered:
        return Covered(covariate, 0.1, p, np.zeros(1), np.full(1, 0.001), np.zeros(1))

    tests = [test("time", 0.003), test("B", 0.004), *(test(f"T_{i}", 0.5) for i in range(18))]
    assert not left_over(tests, True) and not left_over(tests, True, {"X"})
    assert [r.covariate for r in left_over(tests, True, {"B"})] == ["B"]
    assert not left_over(tests, True, {"B", "X", "Y"})


@pytest.mark.parametrize(("apart", "above"), [(0.05, None), (0.2, 14.2), (0.4, 44.4)])
def test_a_name_says_by_how_much_it_beats_the_shapes(apart: float, above: float | None) -> None:
    rng = np.random.default_rng(10)
    name, other = rng.normal(size=(2, TOUCHES))
    one = Chosen(Candidate("chip", {}, name[:, None]), name[:, None], 12.0)
    outcome = contest(field_of([(name + apart * other)[:, None]]), name + rng.normal(size=TOUCHES), [], [one])
    assert bool(outcome.named) == (above is not None)
    assert outcome.above == ({} if above is None else {id(one): pytest.approx(above, abs=0.05)})


@pytest.mark.parametrize(("grows", "named", "told"), [(0.0, True, False), (0.75, True, True), (2.0, False, True)])
def test_a_name_whose_size_may_change_stays_and_does_not_explain_everything(grows: float, named: bool, told: bool) -> None:
    """The name is taken away only where a size that changes is likelier than one size by 20 and more."""
    rng = np.random.default_rng(11)
    pattern, u = rng.normal(size=TOUCHES), np.linspace(-1, 1, TOUCHES)
    one = Chosen(Candidate("chip", {}, pattern[:, None]), pattern[:, None], 12.0)
    setting = {"like": "chip", "name": one.candidate, "covariate": "facet × time"}
    own = scaled(Kernel(None, "shape", pattern[:, None] * np.column_stack([np.ones(TOUCHES), u, u**2]), setting=setting))
    field = Field([own], np.eye(TOUCHES), np.ones(TOUCHES), cast(Rows, SimpleNamespace(seen=None)))
    y = 0.7 * pattern * (1 + grows * u) + rng.normal(size=TOUCHES)
    assert bool(contest(field, y, [], [one]).named) == named
    assert unsteady(field, y, [], [one], []) == [(one, "facet × time")] * told


def found(machine: str, kind: str, peak: float, seed: int) -> Diagnosis:
    """machine, kind of the workshop, visible peak mm, seed → diagnosis."""
    s = trials.stage(machine)
    _, early, _ = judge.hidden(machine, kind, peak, seed, workshop.HELD)
    return diagnose(s.bench.cell.machine, s.bench.cell.artefact, s.readings(early), s.bench.cell.terms)


@pytest.mark.long
def test_waves_that_grow_along_their_axis_only_resemble_waves() -> None:
    d = found("trunnion", "wobbling_screw", 0.005, 33204050)
    assert d.verdict == "unexplained" and not d.findings
    assert [(r.covariate, r.shape, r.confirm) for r in d.unexplained] == [("Y", "changing", "cyclic_error")]
    assert "looks like cyclic_error, but not with one size: with position of Y it changes" in " ".join(as_text(d).split())


@pytest.mark.long
def test_what_the_tilt_loads_follows_the_tilt_and_not_the_path_to_it() -> None:
    """The plan goes through the angles of A in their order, so its path is nearly as large as the load."""
    s = trials.stage("trunnion")
    _, early, _ = judge.hidden("trunnion", "loaded_bearing", 0.005, 98009050, annex.KINDS)
    d = diagnose(s.bench.cell.machine, s.bench.cell.artefact, s.readings(early), s.bench.cell.terms)
    assert d.verdict == "unexplained" and not d.findings
    assert [(r.covariate, r.shape, r.confirm) for r in d.unexplained] == [("C × A", "changing", "rotary_radial")]


@pytest.mark.long
def test_few_touches_name_nothing_and_say_so() -> None:
    """A third of the plan of the example; without a cause and with a large one."""
    s = trials.stage("trunnion")
    noise = blind.NOISE * np.random.default_rng(12).normal(size=len(s.history))
    for pattern in (0.0, 0.02 * np.sin(2 * np.pi * s.history.position[:, 0] / 40)):
        readings = s.readings(pattern * s.history.normal[:, 0] + noise).rows(np.arange(len(noise)) < 70)
        d = diagnose(s.bench.cell.machine, s.bench.cell.artefact, readings, s.bench.cell.terms)
        assert d.few is not None and d.few < FREE and not d.findings and d.verdict != "explained"
        assert f"Only {d.few} touches are left" in as_text(d)
    assert d.verdict == "unexplained"


@pytest.mark.long
def test_a_subset_of_few_touches_that_leaves_none_free_tells_nothing_of_a_name() -> None:
    """Few touches are left beyond the unknowns; without a fifth of the indexations none was left, and the diagnosis broke off."""
    s = trials.stage()
    rng = np.random.default_rng(2)
    of = s.history.indexation
    kept: list[int] = []
    for number in rng.permutation(np.unique(of)):
        kept += np.flatnonzero(of == number).tolist()
        if len(kept) >= 61:
            break
    y = s.history.position[:, s.history.column("Y")]
    early = 0.012 * np.sin(2 * np.pi * y / 16) * s.history.normal[:, 1] + blind.NOISE * rng.normal(size=len(of))
    readings = s.readings(early).rows(np.sort(kept[:61]))
    d = diagnose(s.bench.cell.machine, s.bench.cell.artefact, readings, s.bench.cell.terms)
    assert d.few is not None and not d.findings and d.verdict == "unexplained"
