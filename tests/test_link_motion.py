"""Backlash is decided by the last motion of each axis; the plan knows it, positions alone do not."""

import math

import numpy as np
from linkparts import plan

from tango_cnc.duration import duration
from tango_cnc.link._motion import durations, last_motion
from tango_cnc.records import Move


def senses(moves=None):
    return last_motion(plan().machine, plan().touches, moves or plan().moves)


def test_each_axis_keeps_the_sense_of_its_last_motion():
    #                        X  Y   Z  B   C  S
    expected = np.array([[1, 0, -1, 0, 0, 0], [-1, -1, -1, 0, 0, 0], [-1, -1, -1, 1, -1, 0]])
    assert np.array_equal(senses(), expected)


def test_positions_alone_would_have_told_it_wrong():
    """Touch 1 to touch 2: Z rises and falls in between, though both contacts lie at the same height."""
    contacts = np.array([touch.contact for touch in plan().touches])
    assert contacts[0, 2] == contacts[1, 2]
    assert senses()[1, 2] == -1


def test_the_measuring_move_ends_at_the_contact_not_at_the_search_end():
    """From contact (20) back to 22 is +, though 22 lies before the search end (25)."""
    moves = list(plan().moves)
    at = next(i for i, move in enumerate(moves) if move.kind == "back")
    moves[at : at + 1] = [Move("back", {"X": 22.0}, 1)]
    moves[at + 2] = Move("clear", {"Y": 40.0}, 2)
    assert senses(moves)[1, 0] == 1


def test_motion_below_the_least_increment_is_none():
    moves = list(plan().moves)
    moves.insert(next(i for i, move in enumerate(moves) if move.touch == 2), Move("clear", {"X": 5e-5}, 2))
    assert senses(moves)[1, 0] == -1


def test_the_time_of_a_touch_counts_from_the_touch_before_it():
    seconds = durations(plan())
    assert sum(seconds.values()) < sum(duration(plan()).values())  # the parting retract belongs to no touch
    # touch 2: back 15 mm, up 50, across 40, down 50 at 100 mm/s and 2 m/s² (0.05 s to get there and stop), 10 mm at 3 mm/s
    assert math.isclose(seconds[2], (15 + 50 + 40 + 50) / 100 + 4 * 0.05 + 10 / 3, rel_tol=1e-9)
    assert seconds[3] > seconds[2] + 1.5  # a clamp
