"""How much a plan holds for any diagnosis: what a judge names who knows the noise and that exactly one cause is hidden."""

from __future__ import annotations

import pytest
from support import best_judge


@pytest.mark.long
def test_a_cause_that_is_far_above_the_noise_is_no_question_to_the_best_judge() -> None:
    found = best_judge.calls(0, 0.006, 40, 7)
    assert sum(c.named == c.hidden for c in found) >= 36


@pytest.mark.long
def test_sixty_one_touches_do_not_hold_a_name() -> None:
    """So the diagnosis names nothing there (docs/measured_diagnose.md); 100 touches hold most names."""
    few, more = best_judge.row(61, 0.003, 60, 7), best_judge.row(100, 0.003, 60, 7)
    assert few[0] < 0.75 < more[0]
    assert few[1] < 0.5 < more[1]
