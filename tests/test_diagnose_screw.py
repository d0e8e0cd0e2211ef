"""A screw that warms with its way, hidden by somebody who had no such cause in mind: named, and no drift that is not there."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support import blind
from support.annex import NAMED
from support.diagnosis_parts import parted
from support.judge import tried

from sim_controller.simulate import simulate
from tango_cnc.diagnose import Diagnosis, diagnose
from tango_cnc.terms.screw_heat import heat


def test_heat_comes_with_the_way_and_goes_with_time_and_with_the_night() -> None:
    """Two metres at once, half of it left after a time of ln 2, another metre; the next day begins cold."""
    x = np.array([0.0, 2000.0, 2000.0, 1000.0, 4000.0, 4500.0])
    day: Any = SimpleNamespace(axis=lambda name: x, warm=np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0]))
    assert heat(day, "X", 1 / np.log(2)) == pytest.approx([0.0, 2.0, 1.0, 2.0, 0.0, 0.5])


@pytest.mark.long
@pytest.mark.parametrize(("machine", "peak", "seed"), [("trunnion", 0.005, 95_008_050), ("fork_head", 0.008, 95_028_080)])
def test_a_screw_that_warms_with_its_way_is_named(machine: str, peak: float, seed: int) -> None:
    assert tried(machine, "hot_screw", peak, seed, kinds=NAMED).found == ["screw_heat"]


@pytest.mark.long
@pytest.mark.parametrize("seed", [47, 67])
def test_a_scale_that_grows_is_no_screw_that_warms_with_its_way(seed: int) -> None:
    """An axis goes about as far every minute: the heat of its way grows as the scale does, and fits the noise a little better."""
    b = blind.bench()
    found = blind.trial(b, blind.eyes(b), ["scale_drift"], (0.003, 0.003), seed)
    assert found is not None
    assert blind.names(found[1]) == ["scale_drift"]
    assert "screw_heat" in [cause for cause, _, _ in found[1].findings[0].alternatives]


def heated(machine: str, axis: str, part: float, zero: float, peak: float, seed: int, cause: str = "screw_heat") -> Diagnosis:
    """machine, axis, time constant as a part of the run, reading where it is held, visible peak mm, seed, cause → diagnosis."""
    b = blind.bench(machine)
    eye = blind.eyes(b)
    tau = part * float(np.ptp(b.clean.time))
    effect = {"cause": cause, "axis": axis, "amplitude": 1e-6, "tau": tau, "zero": zero}
    hidden = blind.visible(b, effect, peak, eye.outside, eye.normal)
    assert hidden is not None
    world = replace(b.world, effects=(hidden.effect,), noise=blind.NOISE)
    read = simulate(b.cell.machine, b.cell.artefact, b.cell.strategy, world, seed=seed)
    return diagnose(b.cell.machine, b.cell.artefact, read, b.cell.terms)


@pytest.mark.long
def test_a_screw_that_is_held_anywhere_along_its_axis_is_named() -> None:
    assert blind.names(heated("fork_head", "Y", 1.25, 100.0, 0.005, 110)) == ["screw_heat"]


@pytest.mark.long
def test_a_screw_that_warms_as_slowly_as_a_scale_is_told_beside_it() -> None:
    """Which of both it is, these touches do not show: the plainer name is first, and the verdict does not rely on it."""
    d = heated("trunnion", "Y", 1.39, 0.0, 0.003, 132)
    assert d.verdict == "unexplained"
    assert [f.cause for f in d.findings] == ["scale_drift"]
    assert [r.rivals for r in d.unexplained] == [("screw_heat",)]
    assert any("let all axes stand for an hour" in how for how in d.findings[0].separate_with)


@pytest.mark.long
@pytest.mark.parametrize(("axis", "zero"), [("X", -150.0), ("Y", 200.0)])
def test_a_scale_that_is_held_at_its_end_is_a_scale_and_no_screw(axis: str, zero: float) -> None:
    d = heated("hu40t", axis, 0.6, zero, 0.005, 4, "scale_drift")
    assert blind.names(d) == ["scale_drift"]
    assert abs(d.findings[0].setting.get("zero", 0.0) - zero) < 60
    listed = [cause for cause, _, behind in d.findings[0].alternatives if behind <= 4]
    assert d.verdict == ("unexplained" if listed else "explained")


def test_either_file_says_what_parts_a_scale_from_a_screw() -> None:
    assert parted("scale_drift", ["screw_heat"]) == parted("screw_heat", ["table_growth", "scale_drift"]) != []
    assert parted("scale_drift", ["table_growth", "outlier"]) == parted("outlier", ["scale_drift"]) == []
