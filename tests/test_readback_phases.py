"""What a program may do where: the table of the read-back's phases, read as sentences."""

from __future__ import annotations

import pytest

from tango_cnc.readback.phases import NEXT, Action, Phase, after
from tango_cnc.records import InputError

ONCE_ROUND = [
    Action.STARTS,
    Action.GUARDED,
    Action.TURNS,
    Action.MEASURES,
    Action.LEAVES,
    Action.RECORDS,
    Action.GUARDED,
    Action.ENDS,
]
TWICE = [
    Action.STARTS,
    Action.FINDS,
    Action.LEAVES,
    Action.GUARDED,
    Action.MEASURES,
    Action.RECORDS,
    Action.LEAVES,
    Action.MOVES,
    Action.ENDS,
]


def walked(steps: list[Action]) -> Phase:
    phase = Phase.HEAD
    for step in steps:
        phase = after(phase, step)
    return phase


@pytest.mark.parametrize("steps", [ONCE_ROUND, TWICE])
def test_a_single_and_a_double_touch_go_round_and_end(steps: list[Action]) -> None:
    assert walked(steps) is Phase.ENDED


@pytest.mark.parametrize("steps", [ONCE_ROUND, TWICE])
@pytest.mark.parametrize("lost", [Action.STARTS, Action.MEASURES, Action.RECORDS, Action.LEAVES])
def test_none_of_these_steps_may_be_missing(steps: list[Action], lost: Action) -> None:
    with pytest.raises(InputError):
        walked([step for step in steps if step is not lost])


def test_nothing_moves_turns_or_is_recorded_outside_of_the_marks() -> None:
    for phase in (Phase.HEAD, Phase.ENDED):
        allowed = {step for step in Action if (phase, step) in NEXT}
        assert allowed <= {Action.STARTS}


def test_nothing_guarded_begins_at_a_facet_and_nothing_turns_there() -> None:
    for phase in (Phase.FOUND, Phase.MET, Phase.NOTED):
        for step in (Action.GUARDED, Action.TURNS, Action.FINDS, Action.MEASURES):
            with pytest.raises(InputError, match=r"at a facet|has no record"):
                after(phase, step)


def test_every_phase_can_be_reached_and_left_but_the_last() -> None:
    assert {phase for _, phase in NEXT.items()} == set(Phase) - {Phase.HEAD}
    assert {phase for phase, _ in NEXT} == set(Phase) - {Phase.ENDED}


WORDS = {  # Z: what it does, and where
    "S": "a second start mark",
    "E": "a second end mark",
    "B": "an end mark before the start mark",
    "T": "something turns outside of start mark and end mark",
    "M": "something moves outside of start mark and end mark",
    "R": "a record without a touch",
    "U": "found an unprotected move; allowed: one off the facet, right after a measuring move",
    "O": "the touch before has no record",
    "F": "the probe is at a facet, and this does not take it off first",
}
SAID = """
          STARTS PROVES RESTS FINDS MEASURES LEAVES FREED GUARDED MOVES TURNS RECORDS ENDS
HEAD      .      M      M     M     M        M      M     M       M     T     R       B
FREE      S      .      Z     .     .        U      .     .       .     .     R       .
TOUCHED   S      Z      .     Z     Z        U      .     Z       Z     Z     R       Z
FOUND     S      F      F     F     F        .      .     F       .     F     R       F
MET       S      O      O     O     O        .      .     O       .     O     .       O
ASIDE     S      O      O     O     O        U      .     O       .     O     .       O
NOTED     S      F      F     F     F        .      .     F       .     F     R       F
BACK      S      Z      Z     Z     Z        U      .     .       .     Z     R       Z
ENDED     S      M      M     M     M        M      M     M       M     T     R       E
"""


def test_what_is_refused_is_said_by_the_rule_that_it_breaks() -> None:
    """One letter each: what is said; `.` is allowed."""
    head, *rows = (line.split() for line in SAID.strip().splitlines())
    assert sorted(head) == sorted(step.name for step in Action)
    assert [row[0] for row in rows] == [phase.name for phase in Phase]
    for name, *letters in rows:
        for step, letter in zip(head, letters, strict=True):
            pair = (Phase[name], Action[step])
            assert (pair in NEXT) == (letter == "."), pair
            if letter != ".":
                with pytest.raises(InputError) as error:
                    after(*pair)
                assert str(error.value) == WORDS.get(letter, f"found {pair[1].value} {pair[0].value}"), pair
