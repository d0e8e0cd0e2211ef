"""Long plans: a program is written line by line, so that its length costs time and no memory."""

from __future__ import annotations

import gc
import tracemalloc
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
import yaml

from postprocessors._base import load, program
from tango_cnc.check import collision
from tango_cnc.files import read_cell, read_strategy, strategy_text
from tango_cnc.files.plan import plan_lines
from tango_cnc.plan import places, plan, touches, travel
from tango_cnc.records import Cell, Plan

GOLDEN = Path(__file__).parent / "golden" / "cell"


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is worked on at once is little, so that short plans show what long ones take."""
    for module, name in ((places, "BLOCK"), (touches, "BLOCK"), (collision, "CHUNK"), (travel, "CHUNK")):
        monkeypatch.setattr(module, name, 15)


@cache
def repeated(times: int) -> Cell:
    """The golden strategy, six touches at three indexations, again and again."""
    cell = read_cell(GOLDEN)
    return replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations * times))


@cache
def planned(times: int) -> Plan:
    return plan(repeated(times))


def peak(work: Callable[[], object]) -> int:
    """→ bytes that this takes at most beyond what there was before; the least of three: threads of other tests may add theirs."""
    gc.disable()  # it empties the lists of small objects that Python keeps to use them again
    found = []
    try:
        work()  # the first time fills them
        for _ in range(3):
            tracemalloc.start()
            work()
            found.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
        return min(found)
    finally:
        tracemalloc.stop()
        gc.enable()


def a_byte(lines: Callable[[Plan], Iterable[str]]) -> float:
    """lines of a plan → bytes that its memory grows by, for every byte that their text grows by."""

    def of(times: int) -> tuple[int, int]:
        return peak(lambda: deque(lines(planned(times)), maxlen=0)), sum(len(line) for line in lines(planned(times)))

    (little, short), (much, long) = of(5), of(20)
    return (much - little) / (long - short)


@pytest.mark.campaign  # threads of other tests in the same process add their memory
@pytest.mark.parametrize("post", ["linuxcnc", "fanuc", "heidenhain"])
def test_a_program_is_never_in_memory_as_a_whole(post: str) -> None:
    options = {"macros": "called"} if post == "fanuc" else {}
    assert a_byte(lambda made: program(load(post), made, options, "0123456789AB")[2]()) < 0.3


@pytest.mark.campaign
def test_plan_csv_is_never_in_memory_as_a_whole() -> None:
    assert a_byte(plan_lines) < 0.3


def test_lines_that_are_kept_would_be_noticed() -> None:
    assert a_byte(lambda made: iter([*plan_lines(made)])) > 1


def a_touch(work: Callable[[int], object]) -> float:
    """work on so many times six touches → bytes a touch that its peak grows by."""
    return (peak(lambda: work(20)) - peak(lambda: work(5))) / 90


@pytest.mark.campaign
@pytest.mark.parametrize(("kept", "least", "most"), [(plan, 100, 300), (lambda cell: list(plan(cell).touches), 1000, 9000)])
def test_a_plan_takes_little_more_than_the_list_of_its_touches(kept: Callable[[Cell], object], least: int, most: int) -> None:
    """Two touches an indexation; of what is made and not kept there is a block at a time. Records would be noticed."""
    assert least < a_touch(lambda times: kept(repeated(times))) < most


def test_a_strategy_is_read_into_little_more_than_its_words(tmp_path: Path) -> None:
    cell, file = read_cell(GOLDEN), tmp_path / "strategy.yaml"

    texts = {times: strategy_text(repeated(times).strategy) for times in (5, 20)}

    def read(times: int) -> None:
        file.write_text(texts[times], encoding="utf-8")
        read_strategy(file, cell.machine, cell.artefact)

    assert a_touch(read) < 1000
    assert a_touch(lambda times: yaml.compose(texts[times], Loader=yaml.SafeLoader)) > 2000, (
        "yaml's own nodes take so much that this measures it"
    )
