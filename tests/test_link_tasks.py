"""What a client is given of every program of a run: which touches, which of them again, and how long it waits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.readback import GOLDEN, golden

from tango_cnc.files import read_cell
from tango_cnc.link import measure as module
from tango_cnc.link.entries import End, Entry, Identity, ProgramSent
from tango_cnc.link.measure import Wanted, silence_after
from tango_cnc.link.rest import durations, rest_of
from tango_cnc.plan import part, plan
from tango_cnc.program import Program
from tango_cnc.records import InputError, Plan

WANTED = Wanted("/dev/null", "dnc", "fanuc", Path("readings.csv"), start_timeout=77.0)


def programs() -> list[Program]:
    """→ two programs of three touches each."""
    parts = [part(golden(), numbers) for numbers in ([1, 2, 3], [4, 5, 6])]
    return [Program(f"O{i}", f"mark {i}", lambda: iter(()), made, ("X",)) for i, made in enumerate(parts)]


@pytest.mark.parametrize(("again", "counts"), [((), (0, 0)), ((2,), (1, 0)), ((2, 3, 4), (3, 0)), ((2, 3, 4, 5), (3, 1))])
def test_every_program_has_its_touches_and_those_of_them_that_are_repeated(again: tuple[int, ...], counts: tuple[int, int]) -> None:
    numbers = (*again, *range(11, 17 - len(again)))
    one, other = module._tasks(programs(), again, numbers[len(again) :], WANTED, 5.0)
    assert (one.original, other.original) == (numbers[:3], numbers[3:])
    assert (one.again, other.again) == counts
    assert (one.quiet, other.quiet) == (5.0, 0.0), "silence is asked for before the first program alone"
    assert (one.mark, other.mark) == ("mark 0", "mark 1") and one.nonce != 0


def test_silence_is_allowed_for_half_a_minute_and_three_times_what_a_touch_takes() -> None:
    """Longer before the first one, where somebody touches the stylus; behind the last one as long as the longest takes."""
    for task, program in zip(module._tasks(programs(), (), tuple(range(1, 7)), WANTED, 0.0), programs(), strict=True):
        seconds = durations(program.plan)
        expected = [30.0 + 3.0 * seconds[touch.number] for touch in program.plan.touches]
        assert task.patience == pytest.approx((expected[0] + 40.0, *expected[1:], 30.0 + 3.0 * max(seconds.values())))
        assert task.start_patience == 77.0
    for task in module._tasks(programs(), (), tuple(range(1, 7)), replace(WANTED, timeout=9.0), 0.0):
        assert task.patience == (9.0,) * 4 and task.start_patience == 9.0


@pytest.mark.parametrize(("drawn", "nonce"), [(0, 1), (0x7FFFFFFD, 0x7FFFFFFE)])
def test_the_number_of_a_run_has_31_bits_and_is_never_zero(drawn: int, nonce: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("secrets.randbelow", lambda most: min(drawn, most - 1))
    assert {task.nonce for task in module._tasks(programs(), (), tuple(range(1, 7)), WANTED, 0.0)} == {nonce}


def other(made: Plan, **changes: Any) -> Plan:
    """plan → the same with its second touch changed."""
    first, second, *rest = made.touches
    return replace(made, touches=(first, replace(second, **changes), *rest))


@pytest.mark.parametrize(
    ("changed", "refused"),
    [
        (lambda made: made, False),
        (lambda made: other(made, facet="another"), True),
        (lambda made: other(made, contact=tuple(value + 1e-5 for value in made.touches[1].contact)), True),
        (lambda made: other(made, contact=tuple(value + 1e-7 for value in made.touches[1].contact)), False),
        (lambda made: replace(made, touches=made.touches[:-1]), True),
    ],
)
def test_what_is_left_is_refused_where_it_would_not_be_made_as_it_was(
    changed: Callable[[Plan], Plan], refused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    cell, whole = read_cell(GOLDEN / "cell"), golden()
    monkeypatch.setattr("tango_cnc.link.rest.make_plan", lambda rest, *more: changed(plan(rest, *more)))
    if refused:
        with pytest.raises(InputError, match="cannot be planned as they were"):
            rest_of(cell, whole, (2,), (4, 5, 6))
    else:
        assert [touch.facet for touch in rest_of(cell, whole, (2,), (4, 5, 6)).touches] == [
            whole.touches[number - 1].facet for number in (2, 4, 5, 6)
        ]


def test_silence_proves_an_end_where_the_control_did_not_say_it() -> None:
    """Half as long again as the longest way from touch to touch, and five seconds; never longer than --timeout."""
    utc = "2026-05-01T06:00:00.000+00:00"
    segment = ProgramSent(utc, "1", "m", {"post": "x", "port": "y"}, "A", "B", (1,))
    stopped, ended = End(False, "line lost", utc), End(True, "end mark", utc, stands=True)
    longest = 5.0 + 1.5 * max(durations(golden()).values())
    entries: list[tuple[list[Entry], float]] = [
        ([], 0.0),
        ([Identity("Grbl")], 0.0),
        ([segment, ended], 0.0),
        ([segment, stopped, segment, ended, Identity("Grbl")], 0.0),
        ([segment, stopped], longest),
        ([segment, ended, segment, Identity("Grbl")], longest),  # killed: it has not even said that it ended
    ]
    for before, seconds in entries:
        assert silence_after(before, golden()) == pytest.approx(seconds)
        assert silence_after(before, golden(), 4.0) == pytest.approx(min(seconds, 4.0))
        assert silence_after(before, golden(), 1e4) == pytest.approx(seconds)
