"""Mistakes that people make are never trusted, and named: a catalogue written without reading how the program looks for them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from support.estimated import judged, measured
from support.few import every
from support.slips import SLIPS, Slip
from support.slips_more import MORE

from tango_cnc.judgement import Judgement
from tango_cnc.records import Cell, Readings

FIVE_AXES = ("hu40t", "trunnion", "huron", "split", "fork_head")
CELLS = (*FIVE_AXES, "three_axis", "three_axis_calibrated")


@dataclass(frozen=True)
class Case:
    slip: str
    judgement: Judgement
    rank: int  # of the right answer among the suspicions, 0: not there


def case(cell: Cell, readings: Readings, slip: str, seed: int, kinds: Mapping[str, Slip] = SLIPS) -> Case | None:
    spoilt = kinds[slip](cell, readings, np.random.default_rng([seed, sum(map(ord, slip))]))
    if spoilt is None:
        return None
    changed, given, answer = spoilt
    judgement = judged(changed, given)
    right = (s.kind in answer.kinds and (answer.word in s.text or answer.word in s.key) for s in judgement.suspicions)
    return Case(slip, judgement, next((i + 1 for i, fits in enumerate(right) if fits), 0))


def test_the_catalogue_is_large_enough() -> None:
    assert len(SLIPS) >= 40


@pytest.mark.long
@pytest.mark.parametrize("slip", every(["one_normal_inward", "half_of_the_rows_missing", "normal_along_another_axis"], 3))
def test_a_slip_is_named(slip: str, root: Path) -> None:
    found = case(*measured(root, "trunnion", 101), slip, 1)
    assert found is not None and found.judgement.verdict != "trustworthy" and found.rank == 1


@pytest.mark.long
@pytest.mark.parametrize(
    "slip",
    ["facets_measured_from_another_datum_than_the_balls", "another_set_of_balls", "terms_of_the_first_try_left_standing"],
)
@pytest.mark.parametrize("example", ["trunnion", "fork_head"])
def test_what_is_wrong_of_all_facets_or_balls_or_terms_is_named_first(example: str, slip: str, root: Path) -> None:
    found = case(*measured(root, example, 704), slip, 704)
    assert found is not None and found.judgement.verdict != "trustworthy" and found.rank == 1


@pytest.mark.long
@pytest.mark.parametrize(("slip", "seed"), [("a_slip_in_one_number", 0), ("two_facets_exchanged", 1)])
def test_what_moves_touches_within_their_plane_leaves_no_gap_and_is_named(slip: str, seed: int, root: Path) -> None:
    found = case(*measured(root, "hu40t", seed), slip, seed)
    assert found is not None and found.judgement.verdict == "implausible" and found.rank == 1


@pytest.mark.long
def test_an_axis_the_wrong_way_that_leaves_no_covariance_is_named(root: Path) -> None:
    found = case(*measured(root, "trunnion", 211), "sense of second rotary axis", 211)
    assert found is not None and found.judgement.verdict == "implausible" and found.rank == 1


@pytest.mark.long
@pytest.mark.parametrize(
    ("example", "slip", "seed"),
    [
        ("three_axis", "normal_along_another_axis", 1),  # the facet had lost all its touches, and nothing was said of it
        ("three_axis", "a_column_that_never_changes", 211),
        ("huron", "work_coordinates", 5),
        ("huron", "tool_length_still_active", 5),
        ("fork_head", "tool_length_still_active", 211),  # the table may be shifted by just that length, which is no likely shift
        ("huron", "one_indexation_turned_by_hand", 318),
    ],
)
def test_mistakes_that_were_not_named_are_named_first(example: str, slip: str, seed: int, root: Path) -> None:
    found = case(*measured(root, example, seed), slip, seed)
    assert found is not None and found.judgement.verdict != "trustworthy" and found.rank == 1


@pytest.mark.long
def test_a_suspicion_says_where_and_what_to_change(root: Path) -> None:
    found = case(*measured(root, "trunnion", 101), "sense of first rotary axis", 1)
    assert found is not None
    first = found.judgement.suspicions[0]
    assert first.text == "the readings fit if A turns the other way"
    assert (first.file, first.key, first.line) == ("machine.yaml", "axes.A.direction", 8)
    assert first.change.startswith("write [1, 0, 0]") and first.after < 1e-3 < 1 < first.before


@pytest.mark.long
@pytest.mark.parametrize("slip", ["positions_shuffled_among_all_rows", "one_column_sorted_alone", "a_table_five_per_cent_larger"])
def test_sorted_columns_and_tables_of_another_size_are_named_first(slip: str, root: Path) -> None:
    found = case(*measured(root, "trunnion", 41), slip, 41, MORE)
    assert found is not None and found.judgement.verdict == "implausible" and found.rank == 1


@pytest.mark.campaign
def test_more_mistakes_on_three_machines(root: Path) -> None:
    tried = [(e, s, case(*measured(root, e, s), slip, s, MORE)) for e in FIVE_AXES[:2] for s in (51, 52, 53) for slip in MORE]
    found = [c for _, _, c in tried if c is not None]
    assert not [c.slip for c in found if c.judgement.verdict == "trustworthy"]
    assert np.mean([c.rank == 1 for c in found]) >= 0.9


@pytest.mark.campaign
def test_the_whole_catalogue_on_one_machine(root: Path) -> None:
    found = [c for slip in SLIPS if (c := case(*measured(root, "trunnion", 102), slip, 2)) is not None]
    assert len(found) >= 40
    assert not [c.slip for c in found if c.judgement.verdict == "trustworthy"]
    assert np.mean([c.rank == 1 for c in found]) >= 0.9
    assert np.mean([1 <= c.rank <= 3 for c in found]) >= 0.95


@pytest.mark.campaign
def test_the_whole_catalogue_on_all_machines(root: Path) -> None:
    rows = [
        (e, c) for e in CELLS for seed in range(20) for s in SLIPS if (c := case(*measured(root, e, seed), s, seed)) is not None
    ]
    assert not [(e, c.slip) for e, c in rows if c.judgement.verdict == "trustworthy"]
    assert np.mean([c.rank == 1 for _, c in rows]) >= 0.9
    assert np.mean([1 <= c.rank <= 3 for _, c in rows]) >= 0.98


@pytest.mark.long
@pytest.mark.parametrize("example", CELLS)
def test_unspoilt_cells_are_trusted(example: str, root: Path) -> None:
    assert judged(*measured(root, example, 7)).verdict == "trustworthy"
