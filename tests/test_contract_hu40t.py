"""Readings from an independent program, the truth known: the estimate has to find it, within its own uncertainty."""

from __future__ import annotations

import json

import pytest
import yaml

from tango_cnc.commands.estimate import as_json, as_text
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import read_cell, read_readings
from tango_cnc.records import Cell, Readings


@pytest.fixture(scope="module")
def folder(shared):
    return shared / "contract" / "hu40t"


@pytest.fixture(scope="module")
def cell(folder) -> Cell:
    return read_cell(folder)


@pytest.fixture(scope="module")
def readings(folder, cell) -> Readings:
    return read_readings(folder / "readings.csv", cell.machine, cell.artefact)


@pytest.fixture(scope="module")
def truth(folder) -> dict[str, float]:
    return json.loads((folder / "truth.json").read_text())


@pytest.fixture(scope="module")
def subsets(shared) -> dict[str, list[str]]:
    return yaml.safe_load((shared / "contract" / "thesis" / "subsets.yaml").read_text())


@pytest.fixture(scope="module")
def scale_enriched(cell, readings) -> Estimate:
    return estimate(cell.machine, cell.artefact, readings, ["S3"])


@pytest.fixture(scope="module")
def pure(cell, readings) -> Estimate:
    """S3 without the ball rows: nothing is left that knows how long a millimetre is."""
    facets = cell.artefact.facets
    keep = [facets[f].ball is None for f in readings.facet]
    return estimate(cell.machine, cell.artefact, readings.rows(keep), ["S3"])


def test_all_twenty_parameters_lie_within_four_of_their_standard_deviations(scale_enriched, truth):
    found = {**scale_enriched.parameters, **scale_enriched.setup}
    assert set(found) == set(truth)
    assert len(scale_enriched.parameters) == 17
    assert {n: (p.value, truth[n], p.std) for n, p in found.items() if abs(p.value - truth[n]) > 4 * p.std} == {}
    assert not scale_enriched.selection.unseen


def test_standard_deviations_are_those_of_a_good_calibration(scale_enriched):
    """A wide enough standard deviation would always hold the truth: these are tight."""
    std = {name: p.std for name, p in scale_enriched.parameters.items()}
    assert std["EX0C"] < 0.3e-3
    assert max(std[name] for name in ("EA0B", "EC0B", "EA0C", "EB0C", "EB0Z", "EA0Y", "EC0Y")) < 4e-6


def test_residual_is_the_noise_of_the_probe(scale_enriched):
    rms = float((scale_enriched.residuals**2).mean() ** 0.5) * 1e3
    assert 0.6 < rms < 0.8
    assert scale_enriched.dof == 393 + 1 - 17 - 3 - 26 - 6
    assert len(scale_enriched.outliers) == 0


def test_raw_condition_number_is_that_of_the_design(scale_enriched):
    assert scale_enriched.condition_number == pytest.approx(1.7e4, rel=0.03)


def test_without_the_bar_scale_mismatches_are_named_as_such(cell, pure, truth):
    assert "EXX1" not in pure.parameters
    assert {"EYY1-EXX1", "EZZ1-EXX1"} <= set(pure.parameters)
    expected = {**truth, "EYY1-EXX1": truth["EYY1"] - truth["EXX1"], "EZZ1-EXX1": truth["EZZ1"] - truth["EXX1"]}
    # Lengths are now told in units of an X axis that is out by 14 µm/m; the only long one is the stylus.
    expected["EZt"] += truth["EXX1"] * cell.machine.probe.length
    found = {**pure.parameters, **pure.setup}
    assert len(found) == 19
    assert {n: (p.value, expected[n], p.std) for n, p in found.items() if abs(p.value - expected[n]) > 4 * p.std} == {}
    assert [c.names[0] for c in pure.selection.unseen] == ["EXX1"]
    assert "scale bar" in pure.selection.unseen[0].text


def test_subsets_of_this_topology_are_those_of_the_thesis(cell, readings, subsets):
    s2, s3, s4 = (estimate(cell.machine, cell.artefact, readings, [s]).parameters for s in ("S2", "S3", "S4"))
    assert set(s2) == set(subsets["S2"])
    assert set(s3) == {*subsets["S2"], *subsets["S3_adds"]}
    assert set(s4) == {*subsets["S2"], *subsets["S3_adds"], *subsets["S4_adds"]}
    assert len(s4) == 86


def test_of_the_whole_model_only_the_isotropic_scale_needs_the_bar(cell, readings, subsets):
    """86 + 3 + 26 unknowns on the octagon have exactly one direction that no touch sees."""
    touched = [cell.artefact.facets[f].ball is None for f in readings.facet]
    result = estimate(cell.machine, cell.artefact, readings.rows(touched), ["S4"])
    assert [c.names[0] for c in result.selection.unseen] == ["EXX1"]
    wanted = {*subsets["S2"], *subsets["S3_adds"], *subsets["S4_adds"]} - {"EXX1"}
    assert {name.removesuffix("-EXX1") for name in result.parameters} == wanted
    assert len(result.values) == 85 + 3 + 26


def test_what_cannot_be_seen_is_on_the_terminal_too(cell, readings):
    text = as_text(estimate(cell.machine, cell.artefact, readings, ["S3", "EYY0", "EC0X"]), ())
    assert "cannot be seen: EYY0 and EY0S cannot be separated: only their sum is known" in text
    assert "cannot be seen: EC0X and EC0Y cannot be separated: only their difference is known" in text


def test_setup_alone_is_subset_one(cell, readings):
    result = estimate(cell.machine, cell.artefact, readings, ["S1"])
    assert not result.parameters
    assert list(result.setup) == ["EXt", "EYt", "EZt"]
    assert len(result.facets) == 26


def test_json_has_every_key_of_the_contract(scale_enriched):
    data = json.loads(json.dumps(as_json(scale_enriched, ())))
    assert data["format"] == "tango-estimate/1"
    assert data["touches"] == 393
    assert set(data["parameters"]["EX0C"]) == {"value", "unit", "std"}
    assert set(data["stylus"]) == {"EXt", "EYt", "EZt"}
    assert set(data["facets"]["3"]) == {"offset", "std"}
    assert len(data["balls"]["1"]["centre"]) == 3
    assert {"max_um", "mean_abs_um", "rms_um", "dof"} <= set(data["residual"])
    assert {"terms", "condition_number", "not_identifiable", "outliers"} <= set(data)
