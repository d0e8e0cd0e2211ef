"""Pairs of covariates that compete with the names: on the table, of the sides, of the probe, of what was before."""

from __future__ import annotations

import pytest
from support import blind
from support.annex import KINDS
from support.diagnosis_parts import forms
from support.judge import tried

from tango_cnc.diagnose.sentences import covariate
from tango_cnc.touches import from_readings

PAIRS = {
    "dA × A": "side from which A came together with position of A",
    "normal z, table × A": "touch direction Z, table frame together with position of A",
    "normal x, machine × time": "touch direction X, machine frame together with time",
    "place x, table × time": "place on the table along X together with time",
    "place z, table × C": "place on the table along Z together with position of C",
    "probe direction × time": "probe direction together with time",
    "pause × Z": "time since the touch before together with position of Z",
    "since indexation × A": "time since the last indexation together with position of A",
}


@pytest.fixture(scope="module")
def compared() -> set[str]:
    b = blind.bench("trunnion")
    return {form.covariate for form in forms(from_readings(b.cell.machine, b.cell.artefact, b.clean))}


@pytest.mark.parametrize("pair", PAIRS)
def test_a_pair_competes_with_the_names_and_has_words(pair: str, compared: set[str]) -> None:
    assert pair in compared
    assert covariate(pair) == PAIRS[pair]


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "peak", "seed"),
    [("stiff_hose", 0.003, 96_020_030), ("dying_battery", 0.008, 96_028_080), ("second_slab", 0.005, 96_026_050)],
)
def test_a_shape_is_said_to_follow_what_it_was_made_of(kind: str, peak: float, seed: int) -> None:
    """What bends with two things, ends steeply, or begins beyond a place and grows with another one."""
    found = tried("fork_head", kind, peak, seed, kinds=KINDS)
    assert found.right and not found.found, (found.found, found.remains)
