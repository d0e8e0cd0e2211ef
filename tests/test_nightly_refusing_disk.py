"""Every call of a night that writes is refused: a sentence, nothing measured is lost, the history is whole, the next night works.

The calls are counted in a night whose disk takes everything, those of SQLite with them. `make campaign-nights-disk` walks all of
them, once, from then on, and half taken; the long test takes a sample of them: TANGO_SEED=7 draws another one.
"""

from __future__ import annotations

import os
import random
import sys
from collections.abc import Iterator

import pytest
from support.nightwalk import HOW, KINDS, Line, Mail, Walk, different, write_cell
from support.refusingsqlite import system
from support.simulated_runs import controller

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="which file an open handle has is asked of /proc"),
    pytest.mark.skipif(system() is None, reason="the SQLite of this Python cannot be asked"),
]
SEED = int(os.environ.get("TANGO_SEED") or "1")
SOME = 5  # refusals of each kind of night


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Walk]:
    place, mail = tmp_path_factory.mktemp("nights"), Mail()
    write_cell(place / "cell", place / "board", mail)
    with controller(place / "cell", "--tcp", "127.0.0.1:0", once=False) as url:
        yield Walk(place, Line(url), mail)


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_a_call_here_and_there_of_a_night_is_refused(walk: Walk, kind: str) -> None:
    calls = walk.calls(kind)
    assert sum("history.db" in call.path for call in calls) > 20 and len(calls) > 150
    chance = random.Random(f"{SEED} {kind}")
    some = [(at, chance.choice(HOW)) for at in chance.sample(different(calls), SOME)]
    assert [text for at, how in some for text in walk.wrong(kind, at, how)] == []


@pytest.mark.long
def test_a_night_whose_readings_cannot_be_written_takes_them_from_the_journal(walk: Walk) -> None:
    """It was not measured, and a run that nobody can resume was to write them."""
    (at,) = [i for i, c in enumerate(walk.calls("check")) if c.what == "replace" and ".readings.csv." in c.path]
    walk.back("check")
    told = walk.night(1, walk.disk(at))
    assert told.code == 0 and told.record["status"] == "complete" and told.record["touches"] == told.record["planned"]
    assert "every touch is in" in told.said and "the night takes them from there" in told.said
    (readings,) = walk.cell.glob("nights/2026-11-24*/readings.csv")
    assert len(readings.read_text().splitlines()) == 1 + told.record["touches"]


@pytest.mark.campaign
@pytest.mark.parametrize("how", HOW)
@pytest.mark.parametrize("kind", KINDS)
def test_every_call_of_a_night_is_refused(walk: Walk, kind: str, how: str) -> None:
    calls, before = walk.calls(kind), walk.trials
    wrong = [text for at in different(calls) for text in walk.wrong(kind, at, how)]
    print(f"\n{kind}, {how}: {len(calls)} calls, {walk.trials - before} refused, {len(wrong)} findings")
    assert wrong == []
