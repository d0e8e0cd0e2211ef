"""ISO 14253-1: conforms, does not conform, cannot tell."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example
from tango_cnc.conformity import Limits, all_conform, decide, decide_from, guard_band, read_limits
from tango_cnc.records import InputError

ONE_SIDED = Limits(-math.inf, 10.0)


def test_guard_band_is_1_65_standard_uncertainties() -> None:
    assert guard_band(2.0) == pytest.approx(3.29, abs=0.01)
    assert guard_band(2.0, dof=10) == pytest.approx(2 * 1.812, abs=0.01)


@pytest.mark.parametrize(
    ("value", "verdict"), [(6.6, "conforms"), (6.8, "cannot tell"), (13.2, "cannot tell"), (13.4, "does not conform")]
)
def test_the_three_zones_of_one_limit(value: float, verdict: str) -> None:
    assert decide("x", value, 2.0, ONE_SIDED).verdict == verdict


@pytest.mark.long
@given(st.floats(-30, 30), st.floats(0.01, 20))
def test_better_measurement_never_turns_a_proof_into_its_opposite(value: float, u: float) -> None:
    wide, narrow = (decide("x", value, scale * u, Limits(-10, 10)).verdict for scale in (1.0, 0.5))
    assert {wide, narrow} != {"conforms", "does not conform"}


def test_two_limits_narrower_than_the_uncertainty_can_prove_nothing_good() -> None:
    assert decide("x", 0.0, 5.0, Limits(-1, 1)).verdict != "conforms"


def test_without_uncertainty_the_value_decides() -> None:
    assert [decide("x", v, 0.0, ONE_SIDED).verdict for v in (10.0, 10.1)] == ["conforms", "does not conform"]


def test_trials_of_a_skew_distribution_decide_by_their_own_shape() -> None:
    values = np.random.default_rng(1).exponential(size=100_000)
    assert decide_from("x", values, 1.0, Limits(0.0, 3.1)).verdict == "conforms"
    assert decide("x", 1.0, 1.0, Limits(0.0, 3.1)).verdict == "cannot tell"


def test_nothing_decided_is_not_conformity() -> None:
    assert not all_conform([])
    with pytest.raises(InputError, match="conformance probability"):
        decide("x", 0.0, 1.0, ONE_SIDED, 0.4)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("limits: {EX0D: 0.1}", "Did you mean 'EX0C'"),
        ("limits: {EX0C: [0.1, -0.1]}", "low below high"),
        ("limits: {EX0C: [1, 2, 3]}", "low below high"),
        ("limits: {EX0C: [null, null]}", "on one side"),
        ("limits: {EX0C: -0.1}", "greater than 0"),
        ("limits: {}", "at least one name"),
    ],
)
def test_wrong_limits_name_file_line_and_what_is_allowed(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "limits.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        read_limits(file, ["EX0C"])
    assert f"{file}:1" in str(caught.value)


def test_limits_of_one_side(tmp_path: Path) -> None:
    file = tmp_path / "limits.yaml"
    file.write_text("limits: {EX0C: [null, 0.1], EB0C: 2.0e-5}", encoding="utf-8")
    assert read_limits(file, ["EX0C", "EB0C"]) == {"EX0C": Limits(-math.inf, 0.1), "EB0C": Limits(-2e-5, 2e-5)}


@pytest.mark.long
def test_the_command_line_exits_with_1_unless_all_conform(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell, limits = tmp_path / "cell", tmp_path / "limits.yaml"
    write_example(cell, "hu40t")

    def call(*args: object) -> int:
        return guarded(tango.main, [str(a) for a in args], standalone_mode=False)

    assert call("simulate", "-C", cell) == 0
    capsys.readouterr()
    for text, status, verdict in (
        ("limits: {EX0C: 0.2}", 0, "conforms"),
        ("limits: {EX0C: 0.01}", 1, "does not conform"),
        ("limits: {EX0C: 0.1138}", 1, "cannot tell"),
    ):
        limits.write_text(text, encoding="utf-8")
        assert call("uncertainty", "-C", cell, "--limits", limits, "--trials", 2000, "--json", "-") == status
        assert json.loads(capsys.readouterr().out)["conformity"]["EX0C"]["verdict"] == verdict
