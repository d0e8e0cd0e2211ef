"""How memory grows with the length of a plan: `python -m tests.support.memory WHAT…` prints a number for each, a line a number.

In a process of its own, as what other threads of a process of tests allocate would be counted too.
"""

from __future__ import annotations

import gc
import subprocess
import sys
import tempfile
import tracemalloc
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path

import yaml

from postprocessors import load, program
from tango_cnc.check import collision
from tango_cnc.files import read_cell, read_strategy, strategy_text
from tango_cnc.files.plan import plan_lines
from tango_cnc.plan import places, plan, touches, travel
from tango_cnc.records import Cell, Plan

ROOT = Path(__file__).parents[2]
GOLDEN = ROOT / "tests" / "golden" / "cell"
SHORT, LONG = 5, 20  # times the six touches of the golden strategy


def growth(*what: str) -> list[float]:
    """names in MEASURED → what a process of its own prints for each."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.memory", *what], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return [float(line) for line in done.stdout.splitlines()]


@cache
def repeated(times: int) -> Cell:
    """The golden strategy, six touches at three indexations, again and again."""
    cell = read_cell(GOLDEN)
    return replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations * times))


@cache
def planned(times: int) -> Plan:
    return plan(repeated(times))


def peak(work: Callable[[], object]) -> int:
    """→ bytes that this takes at most beyond what there was before."""
    gc.disable()  # it empties the lists of small objects that Python keeps to use them again
    try:
        work()  # the first time fills them
        _let_go_of_tuples()
        tracemalloc.start()
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
        gc.enable()


def _let_go_of_tuples() -> None:
    """Python keeps 2000 of each length to use them again. A plan would fill these lists bit by bit, and seem to grow."""
    for length in range(1, 21):
        kept = [tuple(range(length)) for _ in range(2000)]
        del kept


def a_byte(lines: Callable[[Plan], Iterable[str]]) -> float:
    """lines of a plan → bytes that its memory grows by, for every byte that their text grows by."""

    def of(times: int) -> tuple[int, int]:
        return peak(lambda: deque(lines(planned(times)), maxlen=0)), sum(len(line) for line in lines(planned(times)))

    (little, short), (much, long) = of(SHORT), of(LONG)
    return (much - little) / (long - short)


def a_touch(work: Callable[[int], object]) -> float:
    """work on so many times six touches → bytes a touch that its peak grows by."""
    return (peak(lambda: work(LONG)) - peak(lambda: work(SHORT))) / (6 * (LONG - SHORT))


def a_program(post: str, kept: bool = False) -> float:
    """Its file is loaded before: compiling it takes more than a program of this length."""
    written, options = load(post), {"macros": "called"} if post == "fanuc" else {}

    def lines(made: Plan) -> Iterable[str]:
        return program(written, made, options, "0123456789AB")[2]()

    return a_byte((lambda made: iter([*lines(made)])) if kept else lines)


def strategies() -> dict[int, str]:
    return {times: strategy_text(repeated(times).strategy) for times in (SHORT, LONG)}


def a_strategy() -> float:
    cell, texts = read_cell(GOLDEN), strategies()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "strategy.yaml")

        def read(times: int) -> None:
            file.write_text(texts[times], encoding="utf-8")
            read_strategy(file, cell.machine, cell.artefact)

        return a_touch(read)


def nodes() -> float:
    texts = strategies()
    return a_touch(lambda times: yaml.compose(texts[times], Loader=yaml.SafeLoader))


MEASURED: dict[str, Callable[[], float]] = {
    "program.linuxcnc": lambda: a_program("linuxcnc"),
    "program.linuxcnc kept": lambda: a_program("linuxcnc", kept=True),
    "program.fanuc": lambda: a_program("fanuc"),
    "program.fanuc kept": lambda: a_program("fanuc", kept=True),
    "program.heidenhain": lambda: a_program("heidenhain"),
    "program.heidenhain kept": lambda: a_program("heidenhain", kept=True),
    "plan.csv": lambda: a_byte(plan_lines),
    "plan.csv kept": lambda: a_byte(lambda made: iter([*plan_lines(made)])),
    "plan": lambda: a_touch(lambda times: plan(repeated(times))),
    "plan kept": lambda: a_touch(lambda times: list(plan(repeated(times)).touches)),
    "strategy": a_strategy,
    "strategy as nodes": nodes,
}

if __name__ == "__main__":
    # What is worked on at once is little, so that short plans show what long ones take.
    for module, name in ((places, "BLOCK"), (touches, "BLOCK"), (collision, "CHUNK"), (travel, "CHUNK")):
        assert hasattr(module, name)
        setattr(module, name, 15)
    for one in sys.argv[1:]:
        print(MEASURED[one]())
