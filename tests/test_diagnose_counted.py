"""`at` and `until` are the numbers that touches have in the readings: those that were left out count, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support import blind
from support.diagnosis_parts import pattern

from sim_controller.simulate import simulate
from tango_cnc import terms
from tango_cnc.diagnose import diagnose
from tango_cnc.diagnose.sentences import moment, said
from tango_cnc.diagnose.words import as_text
from tango_cnc.records import Readings
from tango_cnc.touches import from_readings

MISSED = 40  # touches in a row that met nothing


def missed(read: Readings) -> Readings:
    """readings → the same readings, but the first touches met nothing."""
    return replace(read, status=tuple("missed" if i < MISSED else "ok" for i in range(len(read))))


def test_touches_that_were_left_out_count() -> None:
    b = blind.bench()
    touches = from_readings(b.cell.machine, b.cell.artefact, missed(b.clean))
    assert touches.counted[0] == MISSED + 1 and touches.row(MISSED + 1) == 0 and touches.row(100) == 99 - MISSED
    column = pattern(touches, terms.cause("step", b.cell.machine, {"at": 100}))
    assert not column[: 99 - MISSED].any() and column[99 - MISSED :].any()


def test_another_cycle_and_another_day_go_on_counting() -> None:
    b = blind.bench()
    whole, n = b.clean, len(b.clean)
    twice = replace(whole.rows(np.tile(np.arange(n), 2)), cycle=np.repeat([1, 2], n), day=np.ones(2 * n, dtype=int))
    kept = np.r_[0 : n - 3, n + 5 : 2 * n]  # what is missing at the end of one cycle moves nothing of the next one
    touches = from_readings(b.cell.machine, b.cell.artefact, twice.rows(kept))
    assert touches.counted.tolist() == (kept + 1).tolist()


def test_touches_that_somebody_plans_are_made_later() -> None:
    b = blind.bench()
    touches = from_readings(b.cell.machine, b.cell.artefact, missed(b.clean))
    n = len(touches)
    longer = touches.rows(np.r_[0:n, 3, 2])
    assert longer.counted[:n].tolist() == touches.counted.tolist()
    assert longer.counted[n:].tolist() == [touches.counted[-1] + 1, touches.counted[-1] + 2]


@pytest.mark.long
def test_a_step_is_at_the_touch_that_a_person_looks_up() -> None:
    b = blind.bench()
    cell, at = b.cell, 201
    effect = {"cause": "step", "amplitude": 0.012, "direction": [0.6, -0.8, 0.0], "at": at}
    read = simulate(cell.machine, cell.artefact, cell.strategy, replace(b.world, effects=(effect,), noise=blind.NOISE), seed=5)
    read = missed(read)
    d = diagnose(cell.machine, cell.artefact, read, cell.terms)
    (f,) = d.findings
    assert f.detail["at_after"] < at <= f.detail["at"]
    row = read.touch.tolist().index(f.detail["at"])
    assert f.detail["time_s"] == pytest.approx(float(read.time[row]))
    assert f"touch {f.detail['at']}" in said(f) or f"{f.detail['at_after']} and {f.detail['at']}" in said(f)
    assert abs(int(f.effect["at"]) - at) < MISSED / 2, "no count of the touches that were used"


@pytest.mark.long
def test_what_was_set_aside_is_named_by_the_numbers_of_its_touches() -> None:
    b = blind.bench()
    cell = b.cell
    effect = {"cause": "pulse", "amplitude": 0.01, "direction": [0.6, -0.8, 0.0], "at": 180, "until": 240}
    read = simulate(cell.machine, cell.artefact, cell.strategy, replace(b.world, effects=(effect,), noise=blind.NOISE), seed=5)
    d = diagnose(cell.machine, cell.artefact, missed(read), cell.terms)
    (m,) = d.events
    assert abs(m.item["at"] - 180) < 8 and abs(m.item["until"] - 240) < 8
    assert f"{m.item['at']} to {m.item['until']}" in moment(m)
    assert f"until: {m.item['until']}" in as_text(d)
