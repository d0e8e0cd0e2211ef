"""How much a plan holds for any diagnosis: what a judge names who knows the noise and that exactly one cause is hidden."""

from __future__ import annotations

import numpy as np
import pytest
from support import best_judge, blind


@pytest.mark.long
def test_a_cause_that_is_far_above_the_noise_is_no_question_to_the_best_judge() -> None:
    found = best_judge.calls(0, 0.006, 40, 7)
    assert sum(c.named == c.hidden for c in found) >= 36


@pytest.mark.long
def test_sixty_one_touches_do_not_hold_a_name() -> None:
    """So the diagnosis names nothing there (docs/measured_diagnose.md); 100 touches hold most names."""
    few, more = best_judge.row(61, 0.003, 60, 7), best_judge.row(100, 0.003, 60, 7)
    assert few.first < 0.75 < more.first
    assert few.clear < 0.5 < more.clear
    assert few.floor < more.floor and few.told > 0.95, "what is missing are touches that separate two causes, and no signal"


@pytest.mark.long
def test_noise_alone_is_named_in_two_of_a_hundred_runs() -> None:
    """The limit holds for noise that did not set it."""
    b = blind.bench()
    eye = blind.eyes(b)
    every = best_judge.patterns(b, eye)
    limit = every.limit(eye.outside, np.random.default_rng(8))
    noise = eye.outside @ np.random.default_rng(9).normal(size=(len(eye.outside), 1000))
    assert 0.005 < np.mean(every.unlikely(noise).max(axis=0) > limit) < 0.045
