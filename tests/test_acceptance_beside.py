"""The sheet judges the touches by the fit that its figures rest on: a machine has more error motions than the terms of a cell."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tango_cnc.acceptance.beside import by_figures, contradicting
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import read_cell
from tango_cnc.iso230.signed import Sheet
from tango_cnc.iso230.sizes import learned
from tango_cnc.iso230.whole import Whole, whole
from tango_cnc.judgement import Judgement
from tango_cnc.records import Readings
from tests.support.iso_coverage import EXAMPLES, touched
from tests.support.iso_every import Every

HU40T = EXAMPLES / "hu40t"
DOUBTED = Judgement("doubtful", ("the residuals are no mere scatter",))
SOUND = Judgement("trustworthy")


def of_machine(seed: int) -> tuple[Estimate, Readings]:
    cell = read_cell(HU40T)
    readings = touched(Every(HU40T, seed), cell.machine.names)
    return estimate(cell.machine, cell.artefact, readings, cell.terms), readings


def seen_by(result: Estimate) -> Whole:
    return learned(result, whole(result))


def with_figures(machine: Whole) -> Sheet:
    return cast(Sheet, SimpleNamespace(learned=machine))


@pytest.fixture(scope="module")
def sound() -> tuple[Estimate, Readings]:
    return of_machine(95000)


@pytest.mark.few(0)
def test_a_sound_machine_with_every_error_motion_is_not_doubted(sound: tuple[Estimate, Readings]) -> None:
    """Its terms leave 2.6 µm where the probe has 0.7: S3 has no straightness. The figures rest on all error motions."""
    assert sound[0].sigma > 2e-3
    found = by_figures(DOUBTED, SOUND, with_figures(seen_by(sound[0])))
    assert found.verdict == "trustworthy" and found.reasons == ()
    assert "no mere scatter" in found.remarks[-1] and "degree 9, 6 harmonics" in found.remarks[-1]


@pytest.mark.few(0)
@pytest.mark.parametrize("what", ["knocked", "slipped"])
def test_what_no_error_motion_explains_keeps_the_doubt(sound: tuple[Estimate, Readings], what: str) -> None:
    """8 µm of X from the middle of the run on; one touch that is 20 µm off."""
    moved, half = sound[1].position.copy(), len(sound[1]) // 2
    across = half + int(np.argmax(np.abs(sound[0].model.touches.machine_normal[half:, 0])))  # a facet that X runs into
    moved[across if what == "slipped" else slice(half, None), 0] += 0.02 if what == "slipped" else 0.008
    cell = read_cell(HU40T)
    result = estimate(cell.machine, cell.artefact, replace(sound[1], position=moved), cell.terms)
    found = by_figures(DOUBTED, SOUND, with_figures(seen_by(result)))
    assert found.verdict == "doubtful" and found.reasons[0].startswith("no error motion of the machine explains")
    assert any(f"explains touch {across + 1}:" in reason for reason in found.reasons) == (what == "slipped")


@pytest.mark.parametrize(
    ("judgement", "rows"),
    [
        (Judgement("implausible", ("a value",)), SOUND),
        (replace(DOUBTED, incomplete=True), SOUND),
        (DOUBTED, Judgement("doubtful", ("copied rows",))),
    ],
)
def test_readings_that_are_wrong_themselves_are_not_judged_again(judgement: Judgement, rows: Judgement) -> None:
    nothing = cast(Any, SimpleNamespace(learned="never looked at"))
    assert by_figures(judgement, rows, nothing) is judgement


def test_so_few_touches_that_nothing_is_left_are_said_to_be_too_few() -> None:
    n = 8
    few = SimpleNamespace(touches=[0] * n, leave=np.zeros((n, n)), residuals=np.zeros(n), sigma=1e-3, scatter=None)
    (reason,) = contradicting(cast(Whole, few))
    assert reason.startswith("8 touches are too few")
