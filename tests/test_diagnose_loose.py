"""A facet that scatters is called rough only where nothing that its touches did explains them as well."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.diagnosis_parts import EVEN, Factor, Remainder, Rough

from sim_controller.simulate import simulate
from tango_cnc.diagnose import Diagnosis, diagnose
from tango_cnc.diagnose._loose import Loose, parted
from tango_cnc.diagnose.words import as_json
from tango_cnc.diagnose.words import as_text as render
from tango_cnc.files import read_cell
from tango_cnc.records import World
from tango_cnc.touches import from_readings

FACET = "4"


def tips_over(axis: str) -> dict[str, object]:
    """→ the effect of a facet that is 12 µm elsewhere at one end of the tilt than at the other."""
    side = {"covariate": f"facet {FACET}", "kind": "side", "low": 0.0, "high": 1.0, "count": 1}
    tilt = {"covariate": axis, "kind": "polynomial", "low": -1.6, "high": 1.6, "count": 1}
    return {
        "cause": "learned",
        "name": "loose",
        "factors": [side, tilt],
        "weight": "none",
        "values": [0.0, 1.0],
        "amplitude": 0.006,
    }


def rough(root: Path, seed: int) -> Diagnosis:
    """→ what is found where every touch of the facet is elsewhere by chance (4 µm), each anew."""
    cell = read_cell(root / "examples" / "trunnion")
    read = simulate(cell.machine, cell.artefact, cell.strategy, World(noise=0.0007), seed=seed)
    on = np.array(read.facet) == FACET
    by = np.where(on, np.random.default_rng(seed).normal(scale=0.004, size=len(on)), 0.0)
    position = read.position.copy()
    columns = [cell.machine.column(axis) for axis in "XYZ"]
    position[:, columns] += by[:, None] * from_readings(cell.machine, cell.artefact, read).machine_normal
    return diagnose(cell.machine, cell.artefact, replace(read, position=position), cell.terms)


def found(root: Path, effect: dict[str, object], seed: int) -> Diagnosis:
    cell = read_cell(root / "examples" / "trunnion")
    read = simulate(cell.machine, cell.artefact, cell.strategy, World(noise=0.0007, effects=(effect,)), seed=seed)
    return diagnose(cell.machine, cell.artefact, read, cell.terms)


def test_evidence_decides_which_facets_are_loose_and_which_may_be_rough() -> None:
    rough = [Rough(facet, 0.004, 1e-6, 0.2) for facet in ("4", "9", "12")]
    shape = [Remainder(f"facet {r.key} × A", "none", "polynomial", 0.005, 0.5, np.zeros(3)) for r in rough]
    follows = [Loose("4", 30.0, shape[0]), Loose("9", -2.0, shape[1])]
    left, loose = parted(rough, follows)
    assert [r.key for r in left] == ["9", "12"] and loose == [shape[0]]


def test_what_a_load_does_is_the_same_on_both_sides_of_zero() -> None:
    tilts = np.linspace(-1.5, 1.5, 31)
    both = Factor("A", EVEN, 0.0, 1.5, 2).functions(tilts)
    assert both.shape == (31, 2)
    np.testing.assert_allclose(both, both[::-1], atol=1e-12)
    basis = np.column_stack([np.ones(31), both])
    for load in (np.abs(tilts), np.abs(np.sin(tilts))):
        missed = load - basis @ np.linalg.lstsq(basis, load, rcond=None)[0]
        assert np.abs(missed).max() < 0.025 * load.max(), "|x| and x² meet |sin x| up to 86° to 2.2 % of its size"
        level = np.column_stack([np.ones(31), tilts, tilts**2])  # what does not know of the sides misses four times as much
        missed = load - level @ np.linalg.lstsq(level, load, rcond=None)[0]
        assert np.abs(missed).max() > 0.08 * load.max()


@pytest.mark.long
@pytest.mark.parametrize("seed", [3, 4])
def test_a_facet_that_tips_over_is_not_called_rough(root: Path, seed: int) -> None:
    told = found(root, tips_over("A"), seed)
    assert told.verdict == "unexplained"
    assert [f.cause for f in told.findings] == []
    assert told.unexplained[0].covariate.startswith(f"facet {FACET} × ")
    # 6 µm either way, less the mean that the offset of the facet takes
    assert 0.003 < told.unexplained[0].amplitude < 0.009
    assert np.isfinite(told.unexplained[0].std) and told.unexplained[0].heldout_r2 > 0.5


@pytest.mark.long
@pytest.mark.parametrize("seed", [3, 4])
def test_a_rough_facet_is_called_rough(root: Path, seed: int) -> None:
    told = rough(root, seed)
    assert [f.cause for f in told.findings] == ["surface_form"]
    assert told.findings[0].setting["facets"] == (FACET,)
    assert not [r for r in told.unexplained if r.form is not None]


@pytest.mark.long
def test_where_both_do_as_well_touches_that_would_tell_are_named(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a margin that no touches reach, every facet that scatters may be either."""
    monkeypatch.setattr("tango_cnc.diagnose._loose.MARGIN", 1e3)
    monkeypatch.setattr("tango_cnc.diagnose._remaining.ALONE", 1e3)
    told = rough(root, 3)
    assert told.verdict == "unexplained" and [r.shape for r in told.unexplained] == ["near"]
    item = as_json(told)["findings"][0]
    assert item["nearest_shape"]["covariate"].startswith(f"facet {FACET} × ")
    assert any(f"touch facet {FACET} five times in one pose" in line for line in item["separate_with"])
    assert f"touch facet {FACET} five times in one pose" in " ".join(render(told).split())


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_lost_motion_under_a_load_that_tilts_is_no_radial_motion(root: Path, seed: int) -> None:
    """The lost motion of Y grows with the tilt to either side; at few angles waves of A follow it."""
    cell = read_cell(root / "examples" / "trunnion")
    read = simulate(cell.machine, cell.artefact, cell.strategy, World(noise=0.0007), seed=seed)
    y, a = cell.machine.column("Y"), cell.machine.column("A")
    position = read.position.copy()
    position[:, y] += 0.005 * read.direction[:, y] * np.abs(np.sin(position[:, a]))
    told = diagnose(cell.machine, cell.artefact, replace(read, position=position), cell.terms)
    assert told.verdict == "unexplained"
    assert any("dY × A" in r.covariate for r in told.unexplained)
