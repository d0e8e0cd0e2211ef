"""Effects hidden by the simulated machine, whose code the diagnosis does not share, in a sample; `make blind` runs hundreds.

The campaign prints its confusion matrix and the table of docs/diagnose.md.
"""

from __future__ import annotations

import blind
import pytest

SAMPLE = [("step", 41), ("moving_mass", 42), ("rotary_tilt", 43), ("scale_drift", 44)]


@pytest.fixture(scope="module")
def bench() -> tuple[blind.Bench, blind.Eyes]:
    b = blind.bench()
    return b, blind.eyes(b)


@pytest.mark.parametrize(("cause", "seed"), SAMPLE)
def test_one_hidden_cause_is_named(bench: tuple[blind.Bench, blind.Eyes], cause: str, seed: int) -> None:
    found = blind.trial(*bench, [cause], (0.003, 0.003), seed)
    assert found is not None
    assert blind.names(found[1]) == [cause]


LEAST = {
    "nothing hidden, white: nothing named": 0.95,
    "nothing hidden, drift: nothing named": 0.95,
    "nothing hidden, outliers: nothing named": 0.95,
    "one cause, visible peak 3.0 µm: right name alone": 0.95,
    "one cause, visible peak 3.0 µm: name or alternative": 0.99,
    "one cause, visible peak 1.5 µm: right name alone": 0.80,
    "size within two standard deviations": 0.95,
    "held-out gain at least 80 % of the truth's": 0.95,
    "2 causes: exactly the right set": 0.90,
    "3 causes: exactly the right set": 0.85,
    "cause not in the catalogue: no false name": 0.90,
    "cause not in the catalogue: right covariate": 0.80,
}


def checked(outcomes: dict[str, list[bool]], chance: float) -> None:
    """outcomes, probability → fails when a diagnosis of the wanted quality would give so small a share less often than that."""
    from scipy import stats

    low = {
        case: blind.share(part)
        for case, part in outcomes.items()
        if case in LEAST and stats.binom.cdf(sum(part), len(part), LEAST[case]) < chance
    }
    assert not low, low


@pytest.mark.campaign
def test_hundreds_of_trials_keep_to_the_table() -> None:
    """Not reached yet where a slow drift is taken out of the catalogue (docs/diagnose.md says what is)."""
    checked(blind.campaign(15), 0.01)
