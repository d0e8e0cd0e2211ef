"""A knock of the stylus, of an axis on what carries it, of everything; a tip that wears. Where two read alike, both are listed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import blind

from sim_controller.simulate import simulate
from tango_cnc import terms
from tango_cnc.diagnose import Diagnosis, diagnose
from tango_cnc.diagnose.words import as_text
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.noise import honest
from tango_cnc.plausible import judge
from tango_cnc.records import Cell, Readings
from tango_cnc.terms._moment import between

EXAMPLES = blind.EXAMPLES
KNOCKS = {"step", "stylus_knock", "axis_knock"}


def told(**effect: Any) -> Diagnosis:
    b = blind.bench()
    world = replace(b.world, effects=({"amplitude": 0.012, **effect},), noise=blind.NOISE)
    read = simulate(b.cell.machine, b.cell.artefact, b.cell.strategy, world, seed=5)
    return diagnose(b.cell.machine, b.cell.artefact, read, b.cell.terms)


def listed(d: Diagnosis) -> set[str]:
    """→ what is named, and what would do as well."""
    return {f.cause for f in d.findings} | {name for f in d.findings for name, _, _ in f.alternatives}


def test_its_numbers_are_a_direction() -> None:
    machine = blind.bench().cell.machine
    for cause, setting in (("stylus_knock", {"at": 100}), ("axis_knock", {"axis": "C", "at": 100})):
        (effect,) = terms.effects(cause, machine, setting, np.array([3e-3, 0.0, -4e-3]))
        assert (effect["cause"], effect["amplitude"], effect["at"]) == (cause, pytest.approx(5e-3), 100)
        assert effect["direction"] == pytest.approx([0.6, 0.0, -0.8])


def test_only_an_axis_that_another_one_carries_can_be_pushed_on_it() -> None:
    assert blind.bench().cell.machine.carried == ("C",)


@pytest.mark.long
@pytest.mark.parametrize("cause", [{"cause": "stylus_knock"}, {"cause": "axis_knock", "axis": "C"}, {"cause": "step"}])
@pytest.mark.parametrize(("direction", "at"), [([1.0, 0.0, 0.0], 200), ([0.6, -0.8, 0.0], 130)])
def test_what_was_knocked_is_named_or_listed_and_nothing_else_is_explained(
    cause: dict[str, Any], direction: list[float], at: int
) -> None:
    d = told(**cause, direction=direction, at=at)
    named = [f.cause for f in d.findings]
    assert cause["cause"] in listed(d), named
    assert set(named) <= KNOCKS and len(named) == 1, named
    assert named == [cause["cause"]] or d.verdict == "unexplained", named
    first, last = d.findings[0].detail["at_after"], d.findings[0].detail["at"]
    assert first < at <= last, "the moment lies between two touches that tell it"


@pytest.mark.long
def test_a_knock_that_reads_like_no_step_is_found_without_one() -> None:
    """What C moved on its carrier turns with B: no step of the machine or the table does that."""
    o = blind.tried(blind.Trial(blind.SMALL, "hu40t", ("axis_knock",), (0.0015, 0.0015), 93200075))
    assert o is not None
    assert o.found == ["axis_knock"]


@pytest.mark.long
def test_a_moment_that_touches_do_not_feel_is_told_as_two_touches() -> None:
    """Along X of the spindle: no touch on a facet that looks up feels it."""
    d = told(cause="stylus_knock", direction=[1.0, 0.0, 0.0], at=203)
    (f,) = d.findings
    assert f.detail["at_after"] < 203 <= f.detail["at"]
    assert f.detail["at_after"] + 1 == f.detail["at"] or f"between touches {f.detail['at_after']} and {f.detail['at']}" in as_text(
        d
    )


@pytest.mark.long
@pytest.mark.parametrize("amplitude", [-0.006, 0.006])
def test_a_tip_that_wears_is_no_table_that_grows(amplitude: float) -> None:
    d = told(cause="tip_wear", tau=1500.0, amplitude=amplitude)
    assert [f.cause for f in d.findings] == ["tip_wear"], [(f.cause, f.alternatives) for f in d.findings]
    assert ("late" if amplitude < 0 else "early") in as_text(d)


@pytest.mark.long
def test_an_estimate_tells_everything_that_may_have_moved() -> None:
    b = blind.bench()
    cell = b.cell
    knocks = (
        ({"cause": "stylus_knock"}, "spindle"),
        ({"cause": "axis_knock", "axis": "C"}, "axis"),
        ({"cause": "step"}, "machine"),
    )
    for cause, may in knocks:
        effect = {"amplitude": 0.012, "direction": [1.0, 0.0, 0.0], "at": 200, **cause}
        read = simulate(cell.machine, cell.artefact, cell.strategy, replace(b.world, effects=(effect,), noise=blind.NOISE), seed=7)
        noise = honest(estimate(cell.machine, cell.artefact, read, cell.terms, 3)).noise
        assert noise is not None and noise.step is not None
        told = [(noise.step.frame, noise.step.axis), *noise.step.instead]
        assert may in [frame for frame, _ in told], (cause, told)
        assert len(set(told)) == len(told)


def seen(example: str, seed: int, effects: Sequence[dict[str, Any]]) -> tuple[Cell, Readings]:
    cell, world = read_cell(EXAMPLES / example), read_world(EXAMPLES / example / "world.yaml")
    return cell, simulate(
        cell.machine, cell.artefact, cell.strategy, replace(world, effects=tuple(effects), noise=0.0007), seed=seed
    )


def diagnosed(example: str, seed: int, **effect: Any) -> Diagnosis:
    cell, read = seen(example, seed, [effect])
    return diagnose(cell.machine, cell.artefact, read, cell.terms)


@pytest.mark.long
@pytest.mark.parametrize(
    ("example", "seed", "at", "direction", "amplitude"),
    [
        ("fork_head", 1, 36, [0.74, 0.61, -0.27], 0.0131),
        ("fork_head", 2, 34, [0.21, -0.97, -0.15], 0.0106),
        ("trunnion", 1, 21, [-0.93, 0.34, -0.13], 0.0061),
    ],
)
def test_what_moved_early_in_the_run_is_not_explained_where_its_rival_fits_as_well(
    example: str, seed: int, at: int, direction: list[float], amplitude: float
) -> None:
    """The few touches before it are of one angle of the axis: stylus and axis did the same to them."""
    d = diagnosed(example, seed, cause="stylus_knock", at=at, direction=direction, amplitude=amplitude)
    assert d.verdict == "unexplained"
    assert {"stylus_knock", "axis_knock"} <= listed(d)


@pytest.mark.long
@pytest.mark.parametrize(
    ("example", "seed", "effect"),
    [
        ("trunnion", 1, {"cause": "axis_knock", "axis": "C", "at": 113, "direction": [0.0, 1.0, 0.0], "amplitude": 0.02}),
        ("trunnion", 3, {"cause": "axis_knock", "axis": "C", "at": 113, "direction": [0.0, 1.0, 0.0], "amplitude": 0.02}),
        ("hu40t", 2, {"cause": "stylus_knock", "at": 240, "direction": [1.0, 0.0, 0.0], "amplitude": 0.03}),
    ],
)
def test_touches_that_do_not_feel_a_knock_do_not_tell_its_moment(example: str, seed: int, effect: dict[str, Any]) -> None:
    d = diagnosed(example, seed, **effect)
    (f,) = d.findings
    assert f.detail["at_after"] < effect["at"] <= f.detail["at"]
    assert f.detail["at"] - f.detail["at_after"] < 12


def test_a_moment_lies_between_the_touches_that_contradict_the_others() -> None:
    felt = np.array([6.0, 5.0, 0.1, 2.0, 5.0, 6.0])  # standard deviations by which a touch feels it
    after = np.arange(6) >= 3  # of the touches of which it is true: the fourth is the first one
    # From a moment on, it explains what was touched after it and makes those wrong that were touched before.
    gain = np.array([np.sum(np.where(after, 1, -1)[at:] * felt[at:] ** 2) for at in range(6)])
    best, first, last = between(gain, 1.0)
    assert (best, first, last) == (3, 2, 4), "the third touch feels nothing, the fourth too little"
    assert between(4.0 * gain, 4.0) == (best, first, last)


@pytest.mark.long
def test_a_straight_line_has_no_time_constant_that_makes_its_size_unknown() -> None:
    d = told(cause="tip_wear", shape="linear", tau=3600.0, amplitude=-0.012)
    (f,) = [f for f in d.findings if f.cause == "tip_wear"]
    (own,) = f.detail["coefficients"].values()
    if f.detail["shape"] == "linear":
        assert f.size.amplitude_std == pytest.approx(own["std"], rel=0.01)
        assert f.size.amplitude_std < 0.05 * f.size.amplitude
    else:
        assert f.detail["run_std_um"] < 0.1 * f.detail["run_um"]


@pytest.mark.long
@pytest.mark.parametrize(
    ("example", "effect", "both"),
    [
        ("hu40t", {"cause": "stylus_knock", "at": 386, "direction": [1.0, 0.0, 0.0], "amplitude": 0.018}, False),
        ("trunnion", {"cause": "axis_knock", "axis": "C", "at": 219, "direction": [0.0, 1.0, 0.0], "amplitude": 0.02}, True),
        ("trunnion", {"cause": "axis_knock", "axis": "C", "at": 5, "direction": [0.0, 1.0, 0.0], "amplitude": 0.02}, True),
    ],
)
def test_what_a_change_at_a_moment_explains_is_no_fact_of_a_facet_a_ball_or_an_angle(
    example: str, effect: dict[str, Any], both: bool
) -> None:
    cell, read = seen(example, 5, [effect])
    found = judge(cell, read, honest(estimate(cell.machine, cell.artefact, read, cell.terms, 3)))
    said = [r for r in found.reasons if "They fit if this moved" in r]
    assert len(said) == 1, found.reasons
    before, after = (int(x) for x in re.findall(r"between touches (\d+) and (\d+)", said[0])[0])
    assert before < effect["at"] <= after
    assert ("Or else" in said[0]) == both
    assert not [r for r in found.reasons if r not in said and ("elsewhere in touches" in r or "from where the readings say" in r)]
    assert found.suspicions[0].kind == "step"


@pytest.mark.long
def test_what_the_wrong_one_of_two_knocks_leaves_gets_no_name() -> None:
    """3 µm of C on its cradle were a `step` and a `moving_mass` that followed what the step left."""
    b = blind.bench()
    tried = blind.trial(b, blind.eyes(b), ("axis_knock",), (0.003, 0.003), 28310047)
    assert tried is not None
    d = tried[1]
    assert {f.cause for f in d.findings} <= KNOCKS and "axis_knock" in listed(d)
    assert [f.cause for f in d.findings] == ["axis_knock"] or d.verdict == "unexplained"


@pytest.mark.parametrize("variance", [0.0, 1e-27])
def test_touches_without_scatter_leave_one_moment(variance: float) -> None:
    """A model that leaves nothing of its touches contradicts every moment but the best one."""
    assert between(np.array([1e-4, 2e-3, 1e-3]), variance) == (1, 1, 1)
