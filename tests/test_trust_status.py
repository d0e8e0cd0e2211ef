"""What a judgement does to a command: its first line, its exit status, and whether the estimate goes on to the next command."""

from __future__ import annotations

import pytest
from support.trust_parts import members, status, told, usable

from tango_cnc.judgement import Judgement
from tango_cnc.records import TangoError

NOTHING = Judgement("doubtful", ("the two parts of the run contradict each other",), untrusted=("EC0X", "EC0B"), nothing=True)


def test_a_doubt_that_leaves_parameters_is_looked_at_and_ends_well() -> None:
    some = Judgement("doubtful", ("a step",), untrusted=("EC0X",))
    assert status(some, despite=False) == 0 and told(some)[0] == "DOUBTFUL: look at this before you act on the numbers"


def test_where_no_parameter_is_trusted_nobody_acts_unasked() -> None:
    assert status(NOTHING, despite=False) == 1 and status(NOTHING, despite=True) == 0
    assert told(NOTHING)[0] == "DOUBTFUL: no parameter is trusted, do not act on these numbers"
    assert members(NOTHING)["nothing_trusted"] is True


def test_the_next_command_takes_no_estimate_of_which_nothing_is_trusted() -> None:
    with pytest.raises(TangoError, match=r"compensate: the estimate is doubtful, no parameter of it is trusted, and is not used"):
        usable(NOTHING, False, "compensate")
