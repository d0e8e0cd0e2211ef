"""What a program may do where: the table of the read-back's phases, read as sentences."""

from __future__ import annotations

import pytest

from tango_cnc.readback.phases import NEXT, Phase, Step, after
from tango_cnc.records import InputError

ONCE_ROUND = [Step.STARTS, Step.GUARDED, Step.TURNS, Step.MEASURES, Step.LEAVES, Step.RECORDS, Step.GUARDED, Step.ENDS]
TWICE = [Step.STARTS, Step.FINDS, Step.LEAVES, Step.GUARDED, Step.MEASURES, Step.RECORDS, Step.LEAVES, Step.MOVES, Step.ENDS]


def walked(steps: list[Step]) -> Phase:
    phase = Phase.HEAD
    for step in steps:
        phase = after(phase, step)
    return phase


@pytest.mark.parametrize("steps", [ONCE_ROUND, TWICE])
def test_a_single_and_a_double_touch_go_round_and_end(steps: list[Step]) -> None:
    assert walked(steps) is Phase.ENDED


@pytest.mark.parametrize("steps", [ONCE_ROUND, TWICE])
@pytest.mark.parametrize("lost", [Step.STARTS, Step.MEASURES, Step.RECORDS, Step.LEAVES])
def test_none_of_these_steps_may_be_missing(steps: list[Step], lost: Step) -> None:
    with pytest.raises(InputError):
        walked([step for step in steps if step is not lost])


def test_nothing_moves_turns_or_is_recorded_outside_of_the_marks() -> None:
    for phase in (Phase.HEAD, Phase.ENDED):
        allowed = {step for step in Step if (phase, step) in NEXT}
        assert allowed <= {Step.STARTS}


def test_nothing_guarded_begins_at_a_facet_and_nothing_turns_there() -> None:
    for phase in (Phase.FOUND, Phase.MET, Phase.NOTED):
        for step in (Step.GUARDED, Step.TURNS, Step.FINDS, Step.MEASURES):
            with pytest.raises(InputError, match=r"at a facet|has no record"):
                after(phase, step)


def test_every_phase_can_be_reached_and_left_but_the_last() -> None:
    assert {phase for _, phase in NEXT.items()} == set(Phase) - {Phase.HEAD}
    assert {phase for phase, _ in NEXT} == set(Phase) - {Phase.ENDED}
