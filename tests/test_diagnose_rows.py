"""Many nights in one diagnosis: means of touches that were made alike, judged like touches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support import blind, trials
from support.diagnosis_parts import alike, rows

from tango_cnc.diagnose import diagnose
from tango_cnc.diagnose.words import as_text
from tango_cnc.records import Readings
from tango_cnc.terms import causes
from tango_cnc.touches import Touches, from_readings

NIGHTS = 6


def nights(count: int, early: np.ndarray, seed: int, noise: float = blind.NOISE) -> Readings:
    """count nights of the example, every one with the same early touches and noise of its own."""
    s = trials.stage()
    rng = np.random.default_rng(seed)
    parts = [s.readings(early + noise * rng.normal(size=len(early))) for _ in range(count)]
    n = len(early)
    return replace(
        parts[0],
        touch=np.arange(1, count * n + 1),
        time=np.concatenate([p.time + 86400.0 * k for k, p in enumerate(parts)]),
        facet=sum((p.facet for p in parts), ()),
        position=np.concatenate([p.position for p in parts]),
        direction=np.concatenate([p.direction for p in parts]),
        status=sum((p.status for p in parts), ()),
        cycle=np.concatenate([p.cycle for p in parts]),
        day=np.repeat(np.arange(1, count + 1), n),
        feed=None if parts[0].feed is None else np.concatenate([p.feed for p in parts if p.feed is not None]),
        temperatures={},
    )


def touches(count: int) -> Touches:
    cell = trials.stage().bench.cell
    return from_readings(cell.machine, cell.artefact, nights(count, np.zeros(len(trials.stage().history)), 1))


def test_few_touches_are_rows_themselves() -> None:
    t = touches(1)
    found = rows(t, np.zeros(len(t)))
    assert found.all and found.seen is t and found.of(np.arange(3.0)) is not None
    assert np.array_equal(found.of(t.time), t.time)


def test_means_have_the_noise_of_one_touch_and_keep_what_their_members_share() -> None:
    t = touches(NIGHTS)
    noise = np.random.default_rng(2).normal(size=len(t))
    found = rows(t, noise)
    assert len(found.seen) <= 900 and found.left_out == 0
    assert found.count.sum() + len(found.wild) == len(t)
    assert abs(np.std(found.of(noise)) - 1) < 0.1
    kind = alike(t).astype(float)  # the same for all members of a row
    assert np.allclose(found.of(kind) / found.scale, kind[found.first])


def test_a_wild_touch_is_in_no_mean() -> None:
    t = touches(NIGHTS)
    residual = np.random.default_rng(3).normal(size=len(t))
    residual[777] = 60.0
    assert list(rows(t, residual).wild) == [777]


def test_nothing_that_is_repeated_is_thinned_by_whole_indexations() -> None:
    t = touches(NIGHTS)
    own = replace(t, position=t.position + np.outer(np.arange(len(t)), [0, 0, 0, 0, 1e-2, 0]))  # no two poses alike
    found = rows(own, np.zeros(len(t)), most=500)
    assert 300 < len(found.seen) <= 500 and found.left_out == len(t) - len(found.seen)


@pytest.mark.long
def test_many_nights_show_a_shape_as_small_as_the_noise() -> None:
    s = trials.stage()
    pattern, _ = trials.hidden("leaning_ram", 0.0009, 3)
    cell = s.bench.cell
    d = diagnose(cell.machine, cell.artefact, nights(12, pattern, 4), cell.terms)
    assert not d.findings and d.unexplained[0].covariate == "Y × B"
    assert abs(d.unexplained[0].amplitude - 0.0009) < 3 * d.unexplained[0].std < 0.0009
    assert d.richer is None


@pytest.mark.long
def test_a_stale_record_and_a_wrong_name_are_set_aside_before_the_search() -> None:
    s = trials.stage()
    cell, n = s.bench.cell, len(s.history)
    read = s.readings(blind.NOISE * np.random.default_rng(6).normal(size=n))
    position, facet = read.position.copy(), list(read.facet)
    stale = next(i for i in range(40, n) if facet[i] != facet[i - 1] and np.abs(position[i] - position[i - 1]).max() > 30)
    position[stale] = position[stale - 1]
    wrong = next(i for i in range(200, n) if facet[i] != facet[i - 1])
    facet[wrong] = facet[wrong - 1]
    d = diagnose(cell.machine, cell.artefact, replace(read, position=position, facet=tuple(facet)), cell.terms)
    assert [m.number for m in d.misnamed] == [read.touch[stale], read.touch[wrong]]
    assert d.verdict == "adequate" and not d.outliers and "is set aside" in as_text(d)
    many = as_text(replace(d, aside=False))
    assert "2 touches of" in many and "none of them is set aside" in many and "it is set aside" not in many


@pytest.mark.few(0)
def test_only_settings_that_count_touches_are_places_among_all_of_them() -> None:
    """The place of a kink in mm was taken for the number of a touch: all of negative X were one place, and X 25 was X 75."""
    t = touches(NIGHTS)
    found = rows(t, np.zeros(len(t)))
    assert not found.all
    for record in causes().values():
        own, whole = list(record.variants(found.seen)), list(found.settings(record))
        counted = {key for key in ("at", "until") if record.refine.get(key, "touch") == "touch"}
        for before, after in zip(own, whole, strict=True):
            assert {k: v for k, v in after.items() if k not in counted} == {k: v for k, v in before.items() if k not in counted}
            assert all(isinstance(after[key], int) for key in counted & after.keys()), (record.name, after)
    places = [s["at"] for s in found.settings(causes()["compensation_kink"]) if s.get("axis") == "X" and "at" in s]
    assert len(places) > 2 and min(places) < 0 < max(places) and len(set(places)) == len(places)
