"""Effects of the probe and of what it touches, by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.effectparts import CELL, MACHINE, PLAIN, STYLUS, TOUCHES, at, read_early, world

from sim_controller import effects
from sim_controller.simulate import simulate
from tango_cnc.records import Array, InputError, Surface, World

SPINDLE = np.column_stack(  # n_s: the normals turned back by S
    [
        np.cos(at("S")) * TOUCHES.normal[:, 0] + np.sin(at("S")) * TOUCHES.normal[:, 1],
        -np.sin(at("S")) * TOUCHES.normal[:, 0] + np.cos(at("S")) * TOUCHES.normal[:, 1],
        TOUCHES.normal[:, 2],
    ]
)
FACET = np.array(TOUCHES.facet)
NUMBER = np.arange(1, len(TOUCHES) + 1)


def test_probe_lobing_turns_with_the_spindle() -> None:
    azimuth, across = np.arctan2(SPINDLE[:, 1], SPINDLE[:, 0]), np.hypot(SPINDLE[:, 0], SPINDLE[:, 1])
    assert read_early("probe_lobing", phase=20) == pytest.approx(0.004 * across * np.cos(3 * azimuth + np.radians(20)), abs=1e-12)


def test_a_probe_is_stiffer_along_its_axis() -> None:
    early = read_early("pretravel_anisotropy")
    assert early == pytest.approx(0.003 * TOUCHES.normal[:, 2] ** 2, abs=1e-12)
    assert early[TOUCHES.normal[:, 2] > 0.999].min() == pytest.approx(0.003)


def test_a_late_latch_reads_late_by_feed_times_delay() -> None:
    assert CELL.strategy.approach.feed == 180  # 3 mm/s: 3 µm in a millisecond
    assert read_early("trigger_latency") == pytest.approx(np.full(len(TOUCHES), -0.003), abs=1e-12)
    slow = replace(TOUCHES, feed=np.where(NUMBER > 100, 60.0, 180.0))
    gap = effects.disturbance(effects.checked(world("trigger_latency").effects), slow, 5).gap
    assert gap == pytest.approx(np.where(NUMBER > 100, -0.001, -0.003))


@pytest.mark.few(0)
def test_a_stylus_rests_where_the_touch_before_pushed_it() -> None:
    early = read_early("probe_hysteresis")
    assert early[0] == pytest.approx(0, abs=1e-12)
    # pushed away from a surface and not quite back, it meets the same surface late: it is further off
    assert early[1:] == pytest.approx(-0.001 * np.sum(SPINDLE[1:] * SPINDLE[:-1], axis=1), abs=1e-9)


@pytest.mark.few(0)
def test_the_first_touch_after_an_indexation_or_a_pause_reads_early() -> None:
    positions = [tuple(row) for row in np.round(TOUCHES.position[:, [MACHINE.column(name) for name in "BCS"]], 9)]
    first = np.array([i == 0 or positions[i] != positions[i - 1] for i in range(len(positions))])
    assert first.sum() == len(CELL.strategy.indexations)
    assert read_early("first_touch") == pytest.approx(0.002 * first, abs=1e-12)
    coffee = replace(TOUCHES, time=TOUCHES.time + 900 * (NUMBER >= 20))
    gap = effects.disturbance(effects.checked(world("first_touch").effects), coffee, 5).gap
    assert gap == pytest.approx(0.002 * (first | (NUMBER == 20)))
    assert not first[19]
    turned = np.array([i == 0 or positions[i][:2] != positions[i - 1][:2] for i in range(len(positions))])
    assert turned.sum() < first.sum()
    for after, wanted in (("indexation", first), ("turn", turned), ("pause", (NUMBER == 1) | (NUMBER == 20))):
        gap = effects.disturbance(effects.checked(world("first_touch", after=after).effects), coffee, 5).gap
        assert gap == pytest.approx(0.002 * wanted)


def spindle_effect(error: Array) -> Array:
    """(n,) rad by which S stands too far → (n,) mm read early: the tip goes by that across its offset, turned by S."""
    s = at("S")
    across = np.array([-STYLUS["EYt"], STYLUS["EXt"]])
    went = np.column_stack([np.cos(s) * across[0] - np.sin(s) * across[1], np.sin(s) * across[0] + np.cos(s) * across[1]])
    return -error * np.sum(went * TOUCHES.normal[:, :2], axis=1)


@pytest.mark.few(0)
def test_a_spindle_that_stops_elsewhere_takes_an_offset_stylus_along() -> None:
    assert read_early("spindle_orientation", order=1) == pytest.approx(np.zeros(len(TOUCHES)), abs=1e-12)
    once = 0.001 * np.cos(at("S") + np.radians(50))
    assert read_early("spindle_orientation", STYLUS, order=1, phase=50) == pytest.approx(spindle_effect(once), abs=3e-6)


def test_a_stylus_that_creeps_turns_with_the_spindle_and_only_sideways() -> None:
    s, grown = at("S"), 1 - np.exp(-TOUCHES.time / 1800)
    x, y = np.cos(s) - np.sin(s), np.sin(s) + np.cos(s)
    along = (x * TOUCHES.normal[:, 0] + y * TOUCHES.normal[:, 1]) / np.sqrt(2)
    assert np.ptp(s) > 1
    assert read_early("stylus_creep") == pytest.approx(0.005 * grown * along, abs=1e-9)
    with pytest.raises(InputError, match="across the spindle"):
        effects.checked(world("stylus_creep", direction=[0, 0, 1]).effects, MACHINE, CELL.artefact)


def test_without_an_order_every_stop_of_the_spindle_is_another_one() -> None:
    early = read_early("spindle_orientation", STYLUS)
    stop = np.cumsum(np.abs(np.diff(at("S"), prepend=0.0)) > 1e-9)
    assert stop.max() >= 6
    errors = []
    for number in np.unique(stop):
        mine, seen = stop == number, spindle_effect(np.ones(len(stop)))
        error = early[mine] @ seen[mine] / (seen[mine] @ seen[mine])
        assert early[mine] == pytest.approx(error * seen[mine], abs=1e-5)
        errors.append(error)
    assert len(set(np.round(errors, 6))) == len(errors)
    chosen = effects.checked(world("spindle_orientation").effects)
    drawn = [np.unique(effects.disturbance(chosen, TOUCHES, seed).errors["ECS0"]) for seed in range(100)]
    assert np.std(drawn) == pytest.approx(0.001, rel=0.12)


@pytest.mark.long
def test_surface_form_is_white_and_only_where_it_is_said_to_be() -> None:
    rough = np.isin(FACET, ["16", "17", "18"])
    early = read_early("surface_form", facets=[16, 17, "18"])
    assert np.abs(early[~rough]).max() < 1e-12
    assert early[rough].std() == pytest.approx(0.002, rel=0.35)
    everywhere = read_early("surface_form")
    assert everywhere.std() == pytest.approx(0.002, rel=0.12)


def test_a_rough_surface_reads_alike_where_it_is_touched_again() -> None:
    """Two cycles meet the same spots; another indexation meets another one, as errors of the machine carry the ball beside it."""
    n = len(TOUCHES)
    twice = replace(
        TOUCHES,
        **{
            name: np.concatenate([value, value])
            for name in ("time", "warm", "day", "indexation", "position", "direction", "move", "feed", "point")
            if (value := getattr(TOUCHES, name)) is not None
        },
        **{
            name: np.concatenate([v := getattr(TOUCHES, name), v]) for name in ("normal_table", "normal", "normal_spindle", "table")
        },
        facet=TOUCHES.facet * 2,
    )
    gap = effects.disturbance(effects.checked(world("surface_form").effects), twice, 3).gap
    assert gap is not None
    assert np.array_equal(gap[:n], gap[n:])
    beside = replace(twice, point=twice.point + np.where(np.arange(2 * n) < n, 0.0, 3.0)[:, None])
    other = effects.disturbance(effects.checked(world("surface_form").effects), beside, 3).gap
    assert other is not None
    assert not np.isin(other[n:], other[:n]).any()


@pytest.mark.few(0)
def test_more_noise_is_white() -> None:
    early = read_early("noise_level")
    assert early.std() == pytest.approx(0.001, rel=0.12)  # about 370 touches: one standard deviation is 4 %
    assert abs(np.corrcoef(early[:-1], early[1:])[0, 1]) < 0.15


def test_outliers_are_few_and_gross() -> None:
    chosen = effects.checked(world("outliers").effects)
    gaps = np.concatenate([effects.disturbance(chosen, TOUCHES, seed).gap for seed in range(50)])  # type: ignore[arg-type]
    wrong = gaps[gaps != 0]
    assert len(wrong) / len(gaps) == pytest.approx(0.05, rel=0.1)
    assert np.abs(wrong).min() >= 0.025 and np.abs(wrong).max() <= 0.05
    assert np.mean(wrong > 0) == pytest.approx(0.5, abs=0.06)
    assert not np.any(effects.disturbance(effects.checked(world("outliers", rate=0).effects), TOUCHES, 5).gap)


def test_a_chip_makes_one_facet_read_early_for_a_while() -> None:
    there = (FACET == "16") & (NUMBER >= 30) & (NUMBER <= 200)
    assert there.sum() > 2
    assert read_early("chip", until=200) == pytest.approx(0.05 * there, abs=1e-12)


def test_swapped_facets_are_wrong_in_the_log_and_nowhere_else() -> None:
    log = simulate(MACHINE, CELL.artefact, CELL.strategy, world("swapped_facets", at=50, until=150))
    assert np.array_equal(log.position, PLAIN.position)
    other = {"16": "17", "17": "16"}
    wanted = [other.get(name, name) if 50 <= i <= 150 else name for i, name in enumerate(PLAIN.facet, start=1)]
    assert list(log.facet) == wanted
    assert sum(a != b for a, b in zip(log.facet, PLAIN.facet, strict=True)) > 4


def test_two_exchanges_and_an_effect_on_one_facet_do_not_disturb_each_other() -> None:
    pair = ({"cause": "swapped_facets", "facets": [16, 17]}, {"cause": "swapped_facets", "facets": [20, 21]})
    log = simulate(MACHINE, CELL.artefact, CELL.strategy, World(effects=(*pair, *world("chip").effects)))
    other = {"16": "17", "17": "16", "20": "21", "21": "20"}
    assert list(log.facet) == [other.get(name, name) for name in PLAIN.facet]
    # the chip lies on the true facet 16, whatever it is called
    chipped = simulate(MACHINE, CELL.artefact, CELL.strategy, world("chip"))
    assert np.array_equal(log.position, chipped.position)


@pytest.mark.few(0)
def test_a_round_facet_taken_for_flat_is_what_a_round_facet_of_the_artefact_is() -> None:
    """Two ways to the same readings: the effect on flat facets, and surfaces that are cylinders in the simulated machine."""
    wrong = World({"EX0C": -0.4, "EA0B": 1e-3})
    sides = {name: f for name, f in CELL.artefact.facets.items() if abs(f.normal[2]) < 1e-6}
    bent = {name: replace(f, surface=Surface("cylinder", 200.0, (0.0, 0.0, 1.0))) for name, f in sides.items()}
    curved = replace(CELL.artefact, facets={**CELL.artefact.facets, **bent})
    truly = simulate(MACHINE, curved, CELL.strategy, wrong).position
    effect = simulate(MACHINE, CELL.artefact, CELL.strategy, replace(world("cylinder_cosine"), errors=wrong.errors)).position
    without = simulate(MACHINE, CELL.artefact, CELL.strategy, wrong).position
    assert np.abs(truly - without).max() > 0.0003
    assert effect == pytest.approx(truly, abs=2e-5)
    tops = ~np.isin(FACET, list(sides))
    assert np.array_equal(effect[tops], without[tops])
