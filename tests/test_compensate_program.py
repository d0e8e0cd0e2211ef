"""What is left when programs are compensated on top of a target: never more than the target leaves alone."""

from __future__ import annotations

import pytest
from support.closing import SETTINGS
from support.compensated import example, measured

from tango_cnc.compensate import propose


@pytest.mark.long
def test_programs_on_top_leave_no_more_than_the_target_that_holds_reversal() -> None:
    cell, world = example("trunnion")
    found = propose(measured(cell, world), "siemens", SETTINGS.get("siemens", ())).fit
    assert found.rms_program.value <= 1.05 * found.rms_after.value
