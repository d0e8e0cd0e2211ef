"""What is no knock of its own, no fault of a control, and no loose stylus: a morning sends nobody to look at the wrong thing."""

from __future__ import annotations

import errno
from types import SimpleNamespace
from typing import Any, cast

import pytest

from tango_cnc.files.nightly import Nightly
from tango_cnc.link.measure import _written
from tango_cnc.nightly import Ports
from tango_cnc.nightly.again import step_by_step
from tango_cnc.nightly.goes_on import _twice
from tango_cnc.nightly.night import _measured
from tango_cnc.records import LinkError, NothingSentError
from tango_cnc.report.look import looks
from tango_cnc.report.texts import texts
from tango_cnc.report.together import _one_way
from tango_cnc.texts import say


def step(night: str, size: float, total: float | None) -> dict[str, Any]:
    like = {"cause": "axis_location", "parameter": "EX0S", "rate_per_day": None, "now": "", "do": "ask"}
    return {**like, "night": night, "size": size, "total": total}


@pytest.mark.parametrize(("total", "drifts"), [(-0.0203, False), (-0.0480, True), (-0.0600, True), (None, True)])
def test_one_knock_that_two_nights_found_is_no_drift(total: float | None, drifts: bool) -> None:
    """The clock of the first of them was a month back, so that the second was not compared with it."""
    older, tonight = step("2026-02-13", -0.0201, total), step("2026-03-15", -0.0199, None)
    assert _one_way([older, tonight], (), ()) == drifts
    do = step_by_step(tonight, [older], {"EX0S": {"value": 0.0}})["do"]
    assert ("clamping" in do) == drifts and (do == "ask") != drifts


def test_a_full_disk_before_anything_was_sent_sends_nobody_to_the_control() -> None:
    with (
        pytest.raises(NothingSentError, match="the program cannot be written"),
        _written("the program", "make room", NothingSentError),
    ):
        raise OSError(errno.ENOSPC, "No space left on device")
    for error, moved in ((NothingSentError("the program cannot be written"), None), (LinkError("no answer"), True)):

        def measure(*_: Any, error: LinkError = error) -> None:
            raise error

        world = SimpleNamespace(
            analysis=SimpleNamespace(choice=lambda *_: ("check", "due", (1,))),
            control=SimpleNamespace(preflight=lambda *_: [], measure=measure),
            disk=SimpleNamespace(free_mb=lambda: 1e6),
            past=SimpleNamespace(of_now=lambda: None),
        )
        record, *_ = _measured(Nightly(), cast(Ports, world), cast(Ports, world), 0.0)
        assert record.get("moved") is moved and record["kind"] == "none"


def test_a_machine_that_moves_on_while_it_is_measured_warms_up_first() -> None:
    (told,) = looks([say("night.moves_on")], texts())
    assert "Let the machine warm up" in told and "stylus and probe sit tight" in told


@pytest.mark.parametrize(("cause", "asks"), [("stylus", False), ("pretravel", False), ("axis_location", True)])
def test_what_is_of_the_probe_asks_for_no_compensation(cause: str, asks: bool) -> None:
    assert ("compensation" in str(_twice({"cause": cause}).get("do", ""))) == asks
