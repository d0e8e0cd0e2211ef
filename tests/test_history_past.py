"""Many nights at once: what a parameter follows, what only wanders, and what is known of the past today."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.histories import record
from support.runs import Result

from tango_cnc.history import Knowledge, opened
from tango_cnc.nightly.lookback import looked_back, smooth
from tango_cnc.records import InputError

RATE, NOISE = 3e-4, 4e-4  # mm: wandered in a day, standard deviation of what a night by itself says
TWENTY = 20_000.0  # days since 1970


def nights(
    folder: Path,
    count: int,
    seed: int,
    *,
    warm: float = 0.0,
    wear: float = 0.0,
    season: float = 0.0,
    drift: float = 0.0,
    every: float = 1.0,
) -> np.ndarray:
    """A history whose one parameter is filtered from what every night says; → its true values. Knocked by 50 µm in the middle."""
    rng, day = np.random.default_rng(seed), TWENTY + every * np.arange(count)
    knock, bed = count // 2, 20 + rng.normal(size=count)
    true = np.cumsum(rng.normal(size=count) * RATE * np.sqrt(every)) + warm * (bed - 20) + drift * (day - TWENTY)
    true += season * np.cos(2 * np.pi * day / 365.25) + wear * np.maximum(day - day[knock], 0) + 0.05 * (day >= day[knock])
    mean, variance = 0.0, 1.0
    with opened(folder / "history.db") as history:
        for i in range(count):
            variance += 1.0 if i == knock else RATE**2 * every
            gain = variance / (variance + NOISE**2)
            mean, variance = mean + gain * (true[i] + rng.normal() * NOISE - mean), variance * (1 - gain)
            start = f"{datetime(1970, 1, 1, tzinfo=UTC) + timedelta(days=day[i]):%Y-%m-%dT%H:%M:%SZ}"
            told: dict[str, Any] = {
                **{"night": start[:10], "start_utc": start, "end_utc": start},
                "state": {
                    **{"day": day[i], "rates": [RATE**2], "sigma": 7e-4, "reference": None},
                    **{"noise": [0.0, 0.0], "agreement": [0.0, 0.0]},
                },
                "alarms": [{"id": "1", "parameter": "EX0C"}] if i == knock else [],
                "parameters": {"EX0C": {"value": mean, "std": variance**0.5, "unit": "mm"}},
                "temperatures": {"bed": {"mean": bed[i]}},
            }
            known = Knowledge(("EX0C",), np.array([mean]), np.array([[variance]]))
            history.add_night(record(1, **told), "touch,time_s\n1,0\n", known)
    return np.asarray(true)


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("follows", "size", "cause"),
    [
        ({"count": 60, "warm": 8e-4}, 8e-4, "temperature"),
        ({"count": 60, "drift": 6e-4}, 6e-4, "drift"),
        ({"count": 60, "wear": 8e-4}, 8e-4, "wear"),
        ({"count": 90, "season": 0.02, "every": 8.0}, 0.02, "season"),
    ],
)
def test_what_a_parameter_follows_is_named_with_its_size(tmp_path: Path, follows: dict[str, Any], size: float, cause: str) -> None:
    nights(tmp_path, seed=2, **follows)
    with opened(tmp_path / "history.db") as history:
        (found, *_) = looked_back(history, "M")
    assert found.cause == cause and found.parameter == "EX0C" and found.p_value < 0.003
    assert abs(found.size - size) < 4 * found.std < 2 * size


@pytest.mark.long
def test_a_machine_that_only_wanders_follows_nothing(tmp_path: Path) -> None:
    for seed in range(6):
        (tmp_path / str(seed)).mkdir()
        nights(tmp_path / str(seed), 60, seed)
        with opened(tmp_path / str(seed) / "history.db") as history:
            assert looked_back(history, "M") == (), f"seed {seed}"


@pytest.mark.long
def test_the_past_is_known_better_today_and_nothing_is_carried_back_over_a_knock(tmp_path: Path) -> None:
    true = nights(tmp_path, 240, 4)
    with opened(tmp_path / "history.db") as history:
        then, now = history.trend("M", "EX0C"), smooth(history, "M", "EX0C")
    assert np.all(now.std <= then.std + 1e-9) and np.mean(now.std[5:110]) < 0.85 * np.mean(then.std[5:110])
    assert np.sqrt(np.mean((now.value - true) ** 2)) < 0.95 * np.sqrt(np.mean((then.value - true) ** 2))
    assert now.value[119] == pytest.approx(then.value[119]) and now.std[119] == pytest.approx(
        then.std[119]
    )  # the night before the knock
    assert 0.04 < now.value[120] - now.value[119] < 0.06


@pytest.mark.long
def test_the_command_says_what_is_followed_and_draws_the_past(tmp_path: Path) -> None:
    nights(tmp_path, 40, 2, warm=8e-4)
    place = ("--history", tmp_path / "history.db")
    said = Result("history", "causes", *place)
    assert said.code == 0 and "EX0C       temperature" in said.out and "µm per K" in said.out
    found = json.loads(Result("history", "causes", *place, "--json", "-").out)
    assert found["format"] == "tango-history-causes/1" and [f["cause"] for f in found["causes"]] == ["temperature"]
    assert Result("history", "plot", "EX0C", "--smooth", *place).out != Result("history", "plot", "EX0C", *place).out
    refused = Result("history", "plot", "EX0C", "--smooth", "--chart", "ewma", *place)
    assert refused.code == 2 and "--chart, --smooth: found both" in refused.err


def test_a_short_history_is_not_looked_back_over(tmp_path: Path) -> None:
    nights(tmp_path, 6, 0)
    with opened(tmp_path / "history.db") as history, pytest.raises(InputError, match="6 measured nights; allowed: 12 or more"):
        looked_back(history, "M")
