"""Causes that no catalogue holds, and noise as it is: a sample of the trials of `support.trials`; `make blind` runs all of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support import blind, judge, trials
from support.diagnosis_parts import Remainder, recognised
from support.outside import KINDS, NULLS

from tango_cnc.diagnose import Diagnosis, as_term, diagnose
from tango_cnc.diagnose._closed import _formulas as formulas
from tango_cnc.diagnose.sentences import said, unexplained
from tango_cnc.diagnose.words import as_text
from tango_cnc.estimate import estimate
from tango_cnc.files import read_terms
from tango_cnc.files.learned import learned, learned_text
from tango_cnc.records import InputError


def told(kind: str, peak: float, seed: int, **options: object) -> Diagnosis:
    s = trials.stage()
    _, early = trials.hidden(kind, peak, seed)
    cell = s.bench.cell
    return diagnose(cell.machine, cell.artefact, s.readings(early), cell.terms, **options)  # type: ignore[arg-type]


def test_there_are_thirty_kinds_and_eleven_noises() -> None:
    assert (len(KINDS), len(NULLS)) == (30, 11)


@pytest.mark.long
def test_what_no_name_explains_is_a_shape_of_its_two_covariates_that_comes_back(tmp_path: Path) -> None:
    d = told("leaning_ram", 0.005, 1)
    assert d.verdict == "unexplained" and not d.findings
    first = d.unexplained[0]
    assert first.covariate == "Y × B" and first.std < first.amplitude / 2 and first.heldout_r2 > 0.3
    assert "position of Y together with position of B" in as_text(d)
    folder = tmp_path / "learned"
    folder.mkdir()
    (folder / "ram.yaml").write_text(
        learned_text({"text": "Meier saw it lean.", "learned": "2026-11-12", **as_term(first)}), encoding="utf-8"
    )
    shape = learned(tmp_path)[0]
    s = trials.stage()
    # Another night: other noise, half as large.
    pattern, _ = trials.hidden("leaning_ram", 0.005, 1)
    early = 0.5 * pattern + blind.NOISE * np.random.default_rng(5).normal(size=len(pattern))
    cell, again = s.bench.cell, s.readings(early)
    back = diagnose(cell.machine, cell.artefact, again, cell.terms, learned=[shape])
    assert [f.cause for f in back.findings] == ["learned"] and back.verdict == "explained"
    assert abs(back.findings[0].size.values[0] - 0.5) < 0.1
    assert "ram, learned on 2026-11-12, is back, 0.5 times as large" in said(back.findings[0])
    assert said(back.findings[0]).endswith("Its file says: Meier saw it lean")
    item = {"cause": "learned", **{key: shape[key] for key in ("name", "factors", "weight", "values")}}
    with_it = estimate(cell.machine, cell.artefact, again, (*cell.terms, item))
    without = estimate(cell.machine, cell.artefact, again, cell.terms)
    assert with_it.sigma < 0.9 * without.sigma


@pytest.mark.long
def test_a_face_that_cools_is_a_course_of_this_facet_and_neither_roughness_nor_heavy_tails() -> None:
    s = trials.stage()
    cell, history = s.bench.cell, s.history
    part = (history.time - history.time[0]) / np.ptp(history.time)
    cooling = 0.008 * np.exp(-part / 0.25) * (np.array(history.facet) == "13")
    noise = blind.NOISE * np.random.default_rng(11).normal(size=len(part))
    d = diagnose(cell.machine, cell.artefact, s.readings(cooling + noise), cell.terms)
    assert d.verdict == "unexplained" and not d.findings
    assert [r.covariate for r in d.unexplained] == ["facet 13 × time"]
    assert "facet 13 together with time" in as_text(d)


@pytest.mark.long
def test_what_a_rotary_axis_wound_up_is_a_shape_of_its_path() -> None:
    s = trials.stage()
    _, early, _ = judge.hidden("hu40t", "wind_up", 0.005, 1)
    d = diagnose(s.bench.cell.machine, s.bench.cell.artefact, s.readings(early), s.bench.cell.terms)
    assert d.verdict == "unexplained" and not d.findings
    assert [r.covariate for r in d.unexplained] == ["path of C 120"]
    assert "the path of C, how far it has turned since it turned back (up to 120°)" in " ".join(as_text(d).split())


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
def test_a_single_touch_that_only_a_resembling_name_leaves_apart_does_not_speak_for_the_name(seed: int) -> None:
    """A backlash that falls along X looks like an error motion of X but for one touch."""
    s = trials.stage("fork_head")
    _, early, _ = judge.hidden("fork_head", "falling_backlash", 0.005, seed)
    d = diagnose(s.bench.cell.machine, s.bench.cell.artefact, s.readings(early), s.bench.cell.terms)
    assert d.verdict == "unexplained" and not d.findings and not d.outliers
    assert [r.covariate for r in d.unexplained] == ["dX × X"]


@pytest.mark.long
def test_what_rests_elsewhere_beyond_an_angle_is_a_shape_of_this_angle_and_no_knock() -> None:
    """The plan goes beyond it once, so that two knocks would explain the touches nearly as well."""
    d = told("loose_table", 0.005, 31117050)
    assert d.verdict == "unexplained" and not d.findings
    assert [(r.covariate, r.closed) for r in d.unexplained] == [("C", "a step at C = 22.5°")]


def test_formulas_are_in_the_units_of_a_person() -> None:
    turned = np.radians(np.repeat([0.0, 45.0, 90.0], 5))
    told_c = [text for text, *_ in formulas([("C", turned)], {"C": (float(np.degrees(1.0)), "°")})]
    assert "a step at C = 22.5°" in told_c and "a step at C = 45°" not in told_c
    told_x = [text for text, *_ in formulas([("X", np.linspace(-200, 200, 81))], {"X": (1.0, " mm")})]
    assert "a wave over X of period 100 mm" in told_x


@pytest.mark.long
def test_what_a_refused_name_took_is_told_and_nothing_is_explained() -> None:
    """A step of 30 touches fits and is not named; what it took follows the time all the same."""
    s = trials.stage("fork_head")
    _, early, _ = judge.hidden("fork_head", "pumping_counterbalance", 0.008, 725080)
    d = diagnose(s.bench.cell.machine, s.bench.cell.artefact, s.readings(early), s.bench.cell.terms)
    assert d.verdict == "unexplained" and not d.findings and d.dropped
    assert any("time" in r.covariate or r.covariate == "indexation" for r in d.unexplained)
    assert d.unexplained[0].covariate.split(" ")[0] in as_text(d)


@pytest.mark.long
def test_an_indexation_that_was_clamped_elsewhere_is_set_aside_and_feeds_no_name() -> None:
    d = told("moved_clamp", 0.005, 2)
    assert [m.kind for m in d.events] == ["indexation"] and not d.findings
    assert d.verdict == "explained" and "pulse" in d.terms_text
    assert np.sqrt(np.mean(d.after.residuals**2)) < 1.1 * blind.NOISE


@pytest.mark.long
@pytest.mark.parametrize(("peak", "seed"), [(0.008, 41), (0.005, 43), (0.003, 48)])
def test_what_went_away_and_came_back_is_one_window_and_no_two_knocks(peak: float, seed: int) -> None:
    d = told("open_door", peak, seed)
    assert [m.kind for m in d.events] == ["window"] and not d.findings
    assert d.verdict == "explained" and "pulse" in d.terms_text
    assert np.sqrt(np.mean(d.after.residuals**2)) < 1.1 * blind.NOISE


def test_a_learned_shape_that_has_no_file_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="tango diagnose --learn"):
        read_terms("[S3, {cause: learned, name: ram}]", tmp_path)


def test_a_shape_that_agrees_with_a_learned_one_is_recognised_and_another_is_not() -> None:
    """By numbers alone: half of it in each of two shapes, 1.5 times as large, and a third of chance; against chance alone."""
    rng = np.random.default_rng(2)
    before, other = rng.normal(size=(2, 300))
    half = np.where(np.arange(300) < 150, 1.5 * before, 0.0)
    now = [Remainder("time", "machine", "waves", 1.0, 0.5, p) for p in (half + 0.3 * other, 1.5 * before - half + 0.3 * other)]
    found = recognised(now, before, "ram", "2026-11-12")
    assert [r.again is None for r in found] == [False, True]
    again = found[0].again
    assert again is not None and abs(again.times - 1.5) < 0.1 and again.agreement > 0.9
    assert "the shape ram (learned on 2026-11-12), 1.5 times as large" in unexplained(found[0])
    assert all(r.again is None for r in recognised(now, other, "door", None))


def test_readings_without_any_noise_are_refused() -> None:
    b = blind.bench()
    with pytest.raises(InputError, match="nothing to explain, and no noise"):
        diagnose(b.cell.machine, b.cell.artefact, b.clean, b.cell.terms)


@pytest.mark.campaign
def test_hundreds_of_causes_from_outside_keep_to_the_table(tmp_path: Path) -> None:
    trials.run([*trials.outside_trials(760_000), *trials.null_trials(770_000, 20)], tmp_path / "trials.jsonl")
    results = trials.recorded(tmp_path / "trials.jsonl")
    print("\n".join(trials.table(results)))
    causes = [r for r in results if r.kind in KINDS]
    assert np.mean([r.verdict == "explained" and (bool(r.found) or not trials.right(r)) for r in causes]) <= 0.05
    assert np.mean([bool(r.found) for r in causes]) <= 0.15
    assert np.mean([trials.right(r) for r in causes]) >= 0.80
