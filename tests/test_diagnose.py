"""`tango diagnose` on readings of the simulated machine: what is hidden is named, what is not there is not."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from support import blind
from support.diagnosis_parts import Beside, add, best_noise, held_out, level, residual_maker, richer, space, values

from sim_controller.simulate import simulate
from tango_cnc.cli import tango
from tango_cnc.diagnose import Diagnosis, _gain, diagnose
from tango_cnc.diagnose.words import as_json, as_text
from tango_cnc.diagnose.world import world
from tango_cnc.estimate import estimate
from tango_cnc.files import read_terms, readings_text
from tango_cnc.records import Readings, TangoError
from tango_cnc.terms import causes


@pytest.fixture(scope="module")
def bench() -> blind.Bench:
    return blind.bench()


def readings(bench: blind.Bench, effects: list[dict[str, Any]], seed: int = 3) -> Readings:
    world = replace(bench.world, effects=tuple(effects), noise=blind.NOISE)
    return simulate(bench.cell.machine, bench.cell.artefact, bench.cell.strategy, world, seed=seed)


def told(bench: blind.Bench, effects: list[dict[str, Any]], seed: int = 3, excluded: tuple[str, ...] = ()) -> Diagnosis:
    return diagnose(bench.cell.machine, bench.cell.artefact, readings(bench, effects, seed), bench.cell.terms, excluded)


DRIFT = {"cause": "thermal_drift", "amplitude": 0.009, "tau": 900, "direction": [0, 1, 0]}
LOBES = {"cause": "probe_lobing", "amplitude": 0.002, "order": 3, "phase": 20}


@pytest.fixture(scope="module")
def two(bench: blind.Bench) -> Diagnosis:
    return told(bench, [DRIFT, LOBES], excluded=("stylus_creep",))  # a drift across the spindle reads like a tip that creeps


@pytest.mark.long
def test_a_sound_machine_is_adequate_and_nothing_is_named(bench: blind.Bench) -> None:
    d = told(bench, [])
    assert (d.verdict, d.findings, d.unexplained) == ("adequate", (), ())
    assert d.terms == bench.cell.terms
    assert d.noise == pytest.approx(blind.NOISE, rel=0.15)


@pytest.mark.long
def test_two_hidden_causes_are_named_with_their_sizes(two: Diagnosis) -> None:
    assert two.verdict == "explained"
    found = {f.cause: f for f in two.findings}
    assert set(found) == {"thermal_drift", "probe_lobing"}
    drift, lobes = found["thermal_drift"], found["probe_lobing"]
    assert abs(drift.size.amplitude - 0.009) < 3 * drift.size.amplitude_std
    assert abs(lobes.size.amplitude - 0.002) < 3 * lobes.size.amplitude_std
    assert np.dot(drift.detail["direction"], [0, 1, 0]) > 0.98
    assert lobes.detail["order"] == 3
    for f in two.findings:
        assert f.p_value < 1e-3 and f.gain is not None and f.gain.real
        assert f.gain.heldout_after < f.gain.heldout_before


@pytest.mark.long
def test_before_any_cause_the_residuals_are_shown_to_depend_on_something(two: Diagnosis) -> None:
    assert two.tests[0].p_value < 1e-4 and two.tests[0].variance_share > 0.05
    covariates = {t.covariate for t in two.tests}
    assert {"time", "order", "indexation", "facet", "X", "Y", "Z", "B", "C"} <= covariates
    assert {"normal x, machine", "normal x, table", "normal x, spindle", "dX", "way of X"} <= covariates
    assert two.tests_after[0].p_value > 1e-4


@pytest.mark.long
def test_the_extended_model_is_a_list_of_terms_that_an_estimate_takes(bench: blind.Bench, two: Diagnosis) -> None:
    again = estimate(bench.cell.machine, bench.cell.artefact, readings(bench, [DRIFT, LOBES]), read_terms(two.terms_text, None))
    assert again.sigma == pytest.approx(two.after.sigma, rel=1e-3)
    assert two.after.sigma < 0.75 * two.before.sigma
    truth = bench.world.errors["EX0C"]
    assert abs(two.after.value("EX0C") - truth) < 4 * two.after.std[two.after.model.names.index("EX0C")]


@pytest.mark.long
def test_the_effects_that_were_found_are_effects_of_the_simulated_machine(bench: blind.Bench, two: Diagnosis) -> None:
    effects = json.loads(json.dumps(as_json(two)["effects"]))
    read = readings(bench, effects)
    d = diagnose(bench.cell.machine, bench.cell.artefact, read, two.terms)
    assert d.verdict == "adequate"


@pytest.mark.long
def test_the_world_that_was_found_gives_the_same_touches(bench: blind.Bench, two: Diagnosis) -> None:
    found, missing = world(two)
    exact = simulate(bench.cell.machine, bench.cell.artefact, bench.cell.strategy, replace(found, noise=0.0))
    columns = [bench.cell.machine.column(a) for a in "XYZ"]
    apart = np.linalg.norm((exact.position - readings(bench, [DRIFT, LOBES]).position)[:, columns], axis=1)
    assert missing == ()
    assert np.sqrt(np.mean(apart**2)) == pytest.approx(np.sqrt(np.mean(two.after.residuals**2)), rel=0.05)


@pytest.mark.long
def test_the_answer_is_the_public_format_and_plain_words(two: Diagnosis) -> None:
    data = json.loads(json.dumps(as_json(two), allow_nan=False))
    assert data["format"] == "tango-diagnosis/1" and data["verdict"] == "explained"
    first = data["findings"][0]
    assert {"cause", "detail", "amplitude_um", "amplitude_std_um", "p_value", "gain", "parameter_shift", "alternatives"} <= set(
        first
    )
    assert {"rms_before_um", "rms_after_um", "heldout_before_um", "heldout_after_um"} <= set(first["gain"])
    assert 0 < data["visibility"]["thermal_drift"] <= 1
    text = as_text(two)
    assert "towards +Y" in text and "held-out" in text and "What to do" in text


@pytest.mark.long
def test_a_cause_that_the_catalogue_lacks_is_admitted_with_its_covariate(bench: blind.Bench) -> None:
    d = told(bench, [LOBES], excluded=("probe_lobing",))
    assert d.verdict == "unexplained" and not d.findings
    assert d.unexplained[0].covariate == "probe direction"
    assert d.unexplained[0].heldout_r2 > 0.3


@pytest.mark.long
def test_a_wandering_machine_gets_no_false_name(bench: blind.Bench) -> None:
    d = told(bench, [{"cause": "random_walk", "amplitude": 0.003}])
    assert not d.findings
    assert [r.shape for r in d.unexplained] == ["random walk"]


@pytest.mark.long
def test_a_size_knows_what_its_time_constant_leaves_open(bench: blind.Bench) -> None:
    slow = {"cause": "thermal_drift", "amplitude": 0.009, "tau": 1650, "direction": [0.3, 0.87, 0.33]}  # as long as the test
    (drift,) = told(bench, [slow], seed=4).findings
    assert abs(drift.size.amplitude - 0.009) < 2 * drift.size.amplitude_std
    assert drift.size.amplitude_std > 2 * np.linalg.norm(drift.size.std) / np.sqrt(3) > 0.0005


@pytest.mark.long
def test_the_unit_of_a_shape_parameter_does_not_change_what_is_known_of_a_size(two: Diagnosis) -> None:
    e = two.explanation
    count = sum(c.columns.shape[1] for c in e.chosen)
    slope = np.random.default_rng(1).normal(size=(e.place.m, 1))
    spread = [values(e, {0: unit * slope})[1][:count, :count] for unit in (1.0, 1e-9)]
    assert spread[0] == pytest.approx(spread[1], rel=1e-6)


@pytest.mark.long
def test_a_cause_beside_something_larger_without_a_name_is_told_and_not_named(bench: blind.Bench) -> None:
    d = told(bench, [LOBES | {"amplitude": 0.006}, DRIFT | {"amplitude": 0.005}], excluded=("probe_lobing",))
    assert (d.verdict, d.findings) == ("unexplained", ())
    assert [(x.finding.cause, x.why) for x in d.dropped] == [("thermal_drift", "beside a shape")]
    assert [(x["cause"], x["why"]) for x in as_json(d)["not_named"]] == [("thermal_drift", "beside a shape")]
    text = " ".join(as_text(d).split())
    assert "it resembles thermal_drift, which is not named" in text and "may only follow what that leaves" in text


@pytest.mark.long
def test_a_cause_that_brings_nothing_to_held_out_touches_is_told_and_not_named(
    bench: blind.Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    measure = _gain.measure
    monkeypatch.setattr(_gain, "measure", lambda *given: replace(measure(*given), real=False))
    d = told(bench, [DRIFT])
    assert (d.findings, d.terms) == ((), bench.cell.terms)
    assert [(x.finding.cause, x.why) for x in d.dropped] == [("thermal_drift", "no gain")]
    text = " ".join(as_text(d).split())
    assert "not named: touches that were not fitted do not gain" in text


@pytest.mark.long
def test_a_chip_is_no_heap_of_outliers(bench: blind.Bench) -> None:
    d = told(bench, [{"cause": "chip", "facet": "9", "amplitude": 0.006, "at": 200}])
    assert [f.cause for f in d.findings] == ["chip"]
    assert d.findings[0].detail["facet"] == "9" and not d.outliers


@pytest.mark.long
def test_facets_that_are_exchanged_in_one_indexation_are_named_though_the_others_cannot_know_of_it(bench: blind.Bench) -> None:
    d = told(bench, [{"cause": "swapped_facets", "facets": ["19", "23"], "at": 62, "until": 79}])
    assert [f.cause for f in d.findings] == ["swapped_facets"] and d.verdict == "explained"
    stability = d.findings[0].stability
    assert stability is not None and stability.times == stability.of < 5  # the subset without that indexation is no trial
    assert f"it came back in {stability.times} of {stability.of} subsets" in " ".join(as_text(d).split())


@pytest.mark.long
def test_facets_that_are_exchanged_in_two_indexations_are_one_exchange_and_no_tilt(bench: blind.Bench) -> None:
    d = told(bench, [{"cause": "swapped_facets", "facets": ["21", "25"], "at": 62, "until": 104}])  # 3 µm, four touches
    assert [f.cause for f in d.findings] == ["swapped_facets"]
    found = d.findings[0].detail
    assert (found["facets"], found["at"], found["until"]) == (("21", "25"), 62, 104)
    assert "facets 21, 25 are exchanged in the readings from touch 62 to 104" in " ".join(as_text(d).split())


@pytest.mark.long
def test_seating_shows_in_the_spread_of_the_indexations(bench: blind.Bench) -> None:
    d = told(bench, [{"cause": "indexation_seating", "amplitude": 0.002}])
    assert [f.cause for f in d.findings] == ["indexation_seating"]
    assert d.findings[0].size.amplitude == pytest.approx(0.002, rel=0.3)


@pytest.mark.long
def test_rough_facets_are_named_one_by_one(bench: blind.Bench) -> None:
    d = told(bench, [{"cause": "surface_form", "amplitude": 0.003, "facets": ["16", "22", "28"]}])
    assert [f.cause for f in d.findings] == ["surface_form"]
    assert set(d.findings[0].detail["facets"]) <= {"16", "22", "28"}


@pytest.mark.long
def test_the_whole_model_is_advised_where_error_motions_are_missing_and_not_for_what_only_looks_like_them(
    bench: blind.Bench,
) -> None:
    def advised(effects: list[dict[str, Any]]) -> Any:
        read = readings(bench, effects)
        after = estimate(bench.cell.machine, bench.cell.artefact, read, ("S3",))
        return richer(after, read, ("S3",), ("S3",))

    motions = [{"cause": "error_motion", "name": name, "amplitude": 0.01} for name in ("EYX", "EZX", "EXY", "EZC", "EXC")]
    found = advised(motions)
    assert found.terms == ("S4",) and found.rms == pytest.approx(blind.NOISE, rel=0.25)
    assert advised([]) is None
    assert advised([DRIFT]) is None
    assert advised([{"cause": "random_walk", "amplitude": 0.003}]) is None


@pytest.mark.few(0)
def test_an_estimate_that_finds_no_fit_says_which_touches_were_made_elsewhere(bench: blind.Bench) -> None:
    exchanged = [{"cause": "swapped_facets", "facets": [5, 6], "at": 100, "until": 130}]  # far apart: millimetres, not micrometres
    with pytest.raises(TangoError, match=r"did not settle.*touch 126 is called facet 6, but was made .* facet 5 is touched"):
        estimate(bench.cell.machine, bench.cell.artefact, readings(bench, exchanged), bench.cell.terms)


@pytest.mark.long
def test_kinks_are_not_heaped_up_to_follow_a_wave_that_the_catalogue_lacks(bench: blind.Bench) -> None:
    d = told(bench, [{"cause": "cyclic_error", "axis": "X", "amplitude": 0.004, "period": 90}])  # longer than any in the catalogue
    chosen = [c.candidate for c in d.explanation.chosen if c.candidate.cause != "outlier"]
    assert sum(c.cause == "compensation_kink" for c in chosen) <= 2
    periods = sorted(c.setting["period"] for c in chosen if c.cause == "cyclic_error")
    assert all(long - short > 1 for short, long in pairwise(periods))
    assert (d.verdict, [r.covariate for r in d.unexplained]) == ("unexplained", ["X"])


@pytest.mark.long
def test_millimetres_that_the_model_swallows_are_no_cause(bench: blind.Bench) -> None:
    rough = {"cause": "surface_form", "amplitude": 0.004, "facets": [7, 12]}
    d = told(bench, [{"cause": "trigger_latency", "delay": 0.003}, rough], seed=7)
    assert [f.cause for f in d.findings] == ["surface_form"]


def test_held_out_errors_are_those_of_fits_without_the_group() -> None:
    rng = np.random.default_rng(1)
    design, data = rng.normal(size=(60, 5)), rng.normal(size=60)
    groups = np.arange(60) // 10
    fast = held_out(residual_maker(design), data, groups, 60)
    for g in range(6):
        rest = groups != g
        slow = data[~rest] - design[~rest] @ np.linalg.lstsq(design[rest], data[rest], rcond=None)[0]
        assert fast[~rest] == pytest.approx(slow)


def test_held_out_errors_beside_other_columns_are_those_of_each_alone() -> None:
    """Ordinary columns, and such as no touch outside one group, or hardly any, knows: a chip at two touches."""
    rng = np.random.default_rng(4)
    design, data = rng.normal(size=(60, 5)), rng.normal(size=60)
    groups = np.arange(60) // 10
    alone = np.zeros((60, 1))
    alone[[21, 24]] = 1.0
    hardly = alone + 1e-3 * rng.normal(size=(60, 1))
    more = [rng.normal(size=(60, 2)), alone, hardly, np.hstack([alone, rng.normal(size=(60, 1))])]
    maker = residual_maker(design)
    for columns, quick in zip(more, _gain._beside(maker, data, groups, 60, more), strict=True):
        assert quick == pytest.approx(held_out(add(maker, columns), data, groups, 60), abs=1e-9)


def test_adding_columns_to_a_fit_is_the_fit_with_them() -> None:
    rng = np.random.default_rng(2)
    design, more = rng.normal(size=(40, 4)), rng.normal(size=(40, 2))
    assert add(residual_maker(design), more) == pytest.approx(residual_maker(np.hstack([design, more])))


def test_what_the_model_reaches_is_not_in_the_space() -> None:
    rng = np.random.default_rng(3)
    design = rng.normal(size=(50, 6))
    place = space(rng.normal(size=50), design, 50, [np.eye(50)])
    assert place.m == 44
    assert np.abs(place.project(design)).max() < 1e-12
    assert np.trace(place.kernels[0]) == pytest.approx(44)


@pytest.mark.long
def test_quicker_ways_to_a_likelihood_lead_to_the_same(two: Diagnosis) -> None:
    e = two.explanation
    first, second = e.chosen[0].columns, e.chosen[1].columns
    every = e.place.grid()
    plain = [float(level(e.place, ratios, e.place.y, np.hstack([first, second]))[2][0]) for ratios in every]
    assert Beside(e.place, first, every).likelihood(second) == pytest.approx(max(plain), abs=1e-6)
    for selected in (first, first[:, :0], np.hstack([first, second])):
        assert best_noise(e.place, selected)[1] == max(float(level(e.place, r, e.place.y, selected)[2][0]) for r in every)


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory, bench: blind.Bench) -> Path:
    folder = tmp_path_factory.mktemp("cell")
    for file in blind.EXAMPLE.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    (folder / "readings.csv").write_text(readings_text(readings(bench, [DRIFT])), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def answered(cell: Path) -> Path:
    """→ the cell with all that the command writes: page, JSON and world, of one diagnosis."""
    pytest.importorskip("matplotlib")
    files = ["--html", cell / "d.html", "--json", cell / "d.json", "--world", cell / "found.yaml"]
    run = CliRunner().invoke(tango, ["diagnose", "-C", str(cell), *map(str, files)])
    assert run.exit_code == 0, run.output
    return cell


@pytest.mark.long
def test_the_command_writes_json_words_and_a_page_with_pictures(answered: Path) -> None:
    assert json.loads((answered / "d.json").read_text())["findings"][0]["cause"] == "thermal_drift"
    page = (answered / "d.html").read_text()
    assert page.count("data:image/png;base64,") == 4 and "warms up" in page


@pytest.mark.long
def test_the_command_writes_a_world_that_the_simulator_takes_and_overwrites_none(answered: Path) -> None:
    target = answered / "found.yaml"
    again = ["simulate", "-C", str(answered), "--world", str(target), "-o", str(answered / "again.csv")]
    assert CliRunner().invoke(tango, again).exit_code == 0
    refused = CliRunner().invoke(tango, ["diagnose", "-C", str(answered), "--world", str(target)])
    assert refused.exit_code != 0 and "which exists" in str(refused.exception)


@pytest.mark.long
def test_design_tells_which_touches_would_separate_two_causes(cell: Path) -> None:
    run = CliRunner().invoke(tango, ["design", "-C", str(cell), "--separate", "thermal_drift", "table_drift", "--json", "-"])
    assert run.exit_code == 0, run.output
    data = json.loads(run.output)
    assert data["together"] >= data["append"][0]["evidence"] > data["evidence"] + 3  # the command offers nothing below 1
    assert data["append"][0]["facets"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--exclude", "gremlins"], f"allowed: {min(causes())}"),
        (["--response", "r"], "only together with --table"),
        (["--table", "none.csv"], "--response"),
        (["--html", "nowhere/d.html"], "there is no folder nowhere"),
        (["--json", "."], "which is a folder"),
    ],
)
def test_wrong_options_are_named(cell: Path, options: list[str], said: str) -> None:
    run = CliRunner().invoke(tango, ["diagnose", "-C", str(cell), *options])
    assert run.exit_code != 0 and said in str(run.exception)
