"""Which rows of tables touches meet: the simulated control has one wrong row, and the touches that move are those that meet it."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.closing import SETTINGS
from support.commands import run
from support.compensated import ROOT, write
from support.loaded import before, loaded

from sim_controller.compensation import read
from sim_controller.simulate import simulate
from tango_cnc.commands.check import positioning_feed
from tango_cnc.commands.design import gate_of
from tango_cnc.compensate import propose
from tango_cnc.compensate.look import look
from tango_cnc.compensate.outcome import Outcome
from tango_cnc.compensate.promise import Figure
from tango_cnc.compensate.rows import FEELS, TableRows, added, lines_of, not_met, rows_of
from tango_cnc.compensate.space import sample
from tango_cnc.loaded import AS_SEEN, HELPS

WRONG = 0.05  # mm


@pytest.mark.few(0)
def test_touches_that_meet_a_row_are_those_that_a_wrong_one_moves(tmp_path: Path) -> None:
    cell, true, result = before("trunnion", 1)
    p = propose(result, "siemens", SETTINGS.get("siemens", ()))
    touches, quiet = result.model.touches, replace(true, noise=0.0)
    changed = [h.place for h in p.held if p.numbers[h.place] != p.present[h.place]]
    tables = {one.table: one for one in rows_of(p.held, changed, touches, sample(cell.machine, p.request.limits))}
    lengths = [h for h in p.held if h.at is not None and h.kind == "length" and h.table in tables]
    told = [(h, [x for x in p.held if x.table == h.table and x.at is not None].index(h)) for h in lengths if not h.sense]
    found = {(h.place): tables[h.table].felt[:, i] for h, i in told}
    seen = sorted(found, key=lambda place: float(found[place].max()))
    for place in (seen[0], seen[len(seen) // 2], seen[-1]):  # one that is hardly met, one in the middle, one that is met best
        held = next(h for h in lengths if h.place == place)
        wrong = {**p.numbers, place: held.number(held.value(p.numbers[place]) + WRONG)}
        sound, spoilt = (
            simulate(
                *(cell.machine, cell.artefact, cell.strategy, quiet),
                seed=3,
                control=read(
                    write(replace(p, numbers=numbers), tmp_path / f"{place}{i}".replace("/", "")), cell.machine, tcp=False
                ),
            )
            for i, numbers in enumerate((p.numbers, wrong))
        )
        moved = np.linalg.norm((spoilt.position - sound.position)[:, :3], axis=1)
        clear = np.abs(found[place] - FEELS) > 0.1
        assert np.array_equal((moved > FEELS * WRONG)[clear], (found[place] > FEELS)[clear]), place


def test_the_fewest_touches_more_meet_what_all_of_them_meet() -> None:
    felt = np.array([[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [0.0, 0.6, 0.6, 0.0], [0.0, 0.0, 0.2, 0.2]])
    table = TableRows("comp_x", "X", "mm", (-100.0, 0.0, 100.0, 200.0), felt)
    assert table.missed([0]) == [0.0, 100.0, 200.0] and table.missed() == [200.0]  # nothing feels more than a fifth of the last
    assert added([table], [0]) == [2] and added([table], [0, 2]) == [] and added([], []) == []
    assert lines_of([table], [0])[1] == "  comp_x: 1 of 4; none at X 0, 100, 200 mm" and lines_of([]) == []


def test_a_verdict_says_first_which_rows_no_touch_met() -> None:
    """A wrong row of 20 µm was kept as far as seen, without a word about it."""
    felt = np.array([[1.0, 0.0, 0.0], [0.4, 0.2, 0.0]])
    rows = not_met(
        [TableRows("comp_x", "X", "mm", (-100.0, 0.0, 100.0), felt), TableRows("comp_y", "Y", "mm", (5.0,), felt[:, :1])]
    )
    assert rows == ("comp_x, 2 of 3 (X 0, 100 mm)",)
    size = Figure(1.0, 0.5, 1.5)
    found = Outcome(Figure(22.0, 21.0, 23.0), size, size, AS_SEEN, "all agrees", rows=rows)
    assert found.said.startswith("Rows of tables that no touch of this run met: comp_x, 2 of 3 (X 0, 100 mm). A wrong number there")
    assert found.said.endswith("all agrees") and found.in_any_case
    file = replace(found, not_seen=("enc.ini",), left_if_none=4.0)
    assert file.said.startswith("this run does not see whether the control uses enc.ini") and not file.in_any_case
    assert "where a sign is wrong. Rows of tables that no touch" in file.said and file.said.endswith("All agrees")
    assert replace(found, verdict="undecided").said == "all agrees" and replace(found, rows=()).said == "all agrees"
    assert not replace(found, rows=()).in_any_case and "2 more tables" in replace(found, rows=rows * 6).said


@pytest.mark.few(0)
def test_a_proposal_says_which_rows_its_touches_meet(tmp_path: Path) -> None:
    cell = tmp_path / "cell"
    shutil.copytree(ROOT / "examples" / "trunnion", cell)
    assert run("simulate", "-C", cell).exit_code == 0
    said = run("compensate", "-C", cell, "--target", "siemens", "--simulated", "--dry-run").output
    assert "a wrong row that none meets is not seen" in said and "ENC_COMP Y: 17 of 17" in said, said


@pytest.mark.long
def test_a_short_check_with_all_rows_meets_what_the_strategy_meets_and_keeps_no_wrong_row(tmp_path: Path) -> None:
    one = loaded("trunnion", "siemens", 1, tmp_path, tcp=False)
    few = one.look
    given = (one.asked, one.cell, one.proposal.fit.rms_before, positioning_feed(one.cell), gate_of(one.cell))
    every = look(*given, rows=True)
    assert added(few.tables, few.made) and not added(every.tables, every.made)
    assert all(table.missed(every.made) == table.missed() for table in every.tables) and every.seconds > few.seconds
    sound = one.control(dict(one.proposal.numbers), "sound")
    assert replace(one, look=every).judged(sound, 21).verdict in HELPS
    assert few.seconds <= 8 * 60
    # The row that the few touches do not meet and all of them feel most.
    open_ = [(t, at) for t in few.tables if t.unit == "mm" for at in t.missed(few.made) if at not in t.missed()]
    table, at = max(open_, key=lambda pair: float(pair[0].felt[:, pair[0].at.index(pair[1])].max()))
    held = next(h for h in one.proposal.held if h.table == table.table and h.at is not None and abs(h.at - at) < 1e-5)
    numbers = {**one.proposal.numbers, held.place: held.number(held.value(one.proposal.numbers[held.place]) + 0.4 * WRONG)}
    control = one.control(numbers, "wrong")
    assert replace(one, look=few).judged(control, 21).verdict in (*HELPS, "undecided")  # as far as it sees
    assert replace(one, look=every).judged(control, 21).verdict not in HELPS
