"""What the last night no longer shows is said so on every view: neither as still there, nor as a change of another size."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from support.nights import night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.cli import tango
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.standing import still
from tango_cnc.nightly.words import changed, headline
from tango_cnc.report.course import course
from tango_cnc.report.faults import faults
from tango_cnc.report.texts import texts
from tango_cnc.report.tonight import shows
from tango_cnc.report.units import Units
from tango_cnc.texts import say
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

M = "HU40T-like"
FOUND = -6.6  # µm/m, ± 0.7: what its night found


def scale(change: float, std: float, *, full: bool = True) -> dict[str, Any]:
    """change of the scale by now and its standard deviation, µm/m → its alarm as the last night has it."""
    since, dated = (night(M, i)["night"] for i in (1, 2))
    size = f"{FOUND:+.1f} ± 0.7 µm/m"
    now = still(FOUND * 1e-6, change * 1e-6, std * 1e-6, f"{change:+.1f} ± {std:.1f} µm/m", confirmed=full)
    return {
        **{"id": f"{dated}-020000-1", "cause": "scale", "parameter": "EYY1-EXX1", "since": since, "night": dated, "unit": "mm/mm"},
        "text": say("changed.other", what="scale of Y", size=size, since=since, name="EYY1-EXX1"),
        **{"size": FOUND * 1e-6, "std": 0.7e-6, "rate_per_day": None, "instead": [], "owner": "Ann", "decision": None},
        **{"on_part_um": 1.0, "on_part": "A part is off.", "do": "Check the scale.", "total": change * 1e-6, "now": now},
    }


@pytest.mark.parametrize(
    ("change", "std", "told"),
    [
        (11.7, 7.8, "gone again, as far as tonight can tell"),  # 1.5 of its own, and the other way: it was "still there"
        (0.4, 7.8, "gone again, as far as tonight can tell"),
        (-2.0, 2.0, "gone again, as far as tonight can tell"),
        (-6.6, 7.8, "still there"),  # as near to it as may be, though no night could tell it from nothing
        (-5.9, 0.7, "still there"),
        (-0.4, 0.4, "gone again: -0.4"),  # sure to be elsewhere
        (20.0, 1.0, "it is +20.0"),
        (13.0, 6.6, "gone again, as far as tonight can tell"),  # 1.97 of its own, but it has turned
        (14.0, 7.0, "gone again, as far as tonight can tell"),  # 2, and it has turned
    ],
)
def test_what_is_no_more_than_its_own_uncertainty_is_neither_there_nor_another_size(change: float, std: float, told: str) -> None:
    assert str(scale(change, std)["now"]).startswith(told)
    assert shows(FOUND, change, std) == (not told.startswith("gone again") and change < 0)
    known = abs(change) > 2 * std
    assert ("confirmed" in str(scale(change, std)["now"])) == (told == "still there" and known)  # ± more than itself is none


@pytest.mark.parametrize(("change", "way"), [(11.7, " the other way"), (-0.9, "")])
def test_the_page_has_the_change_as_it_was_found_and_that_it_no_longer_shows(change: float, way: str) -> None:
    record = night(M, 8, standing=[scale(change, 7.8)])
    (found,) = faults(record, (), {}, Units(), texts())
    size = "3.5" if way else "0.3"
    wanted = f"it shows {size} µm over 300 mm{way}, no more than it leaves open."
    assert found["text"].startswith("Scale of Y has changed by 2 µm over 300 mm") and wanted in found["text"]
    assert "as far as the night ending Sun 1 Nov 2026 can tell" in found["text"] and not found["whole"] and not found["gone"]
    assert found["begun"] == night(M, 1)["night"]  # its parts stay in question
    (sure,) = faults(night(M, 8, standing=[scale(20.0, 1.0)]), (), {}, Units(), texts())
    assert sure["text"].startswith("Scale of Y against X has changed by 6 µm over 300 mm") and "can tell" not in sure["text"]


@pytest.mark.few(0)
def test_every_view_says_it(tmp_path: Path) -> None:
    own = scale(11.7, 7.8)
    record = night(M, 8, standing=[own])
    record["headline"] = headline(record | {"repaired": []})
    place = cell(tmp_path / "one", records=[night(M, 2, "changed", alarms=[own]), record])
    with TestClient(create(Settings((place,))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        for path in ("/", "/alarms", f"/machine/{M}"):
            text = client.get(path).text
            assert "as far as the " in text and "still there" not in text, path
    told = CliRunner().invoke(tango, ["nightly", "--status", "-C", str(place)]).output
    line = next(x for x in told.splitlines() if "open alarm 2026-10-26" in x)
    assert "-6.6 ± 0.7 µm/m" in line and "as far as tonight can tell: +11.7 ± 7.8 µm/m" in line
    assert "as far as tonight can tell: +11.7 ± 7.8 µm/m" in message(record, (), ())[1]


@pytest.mark.parametrize(
    ("then", "std", "wanted"),
    [
        (11.7, 5.5, "Jumped by −6.6 µm/m on Sun 1 Nov 2026. Gone again, as far as the night ending Sat 7 Nov 2026 can tell."),
        (-6.6, 0.7, "Jumped by −6.6 µm/m on Sun 1 Nov 2026, steady since then."),
        (-6.6, 5.5, "Jumped by −6.6 µm/m on Sun 1 Nov 2026, steady since then."),
    ],
)
def test_a_jump_is_steady_while_it_still_shows(then: float, std: float, wanted: str) -> None:
    value = np.r_[np.full(8, 21.1), np.full(7, 21.1 + then)]
    days, spread = np.arange(15.0), np.r_[np.full(8, 0.7), np.full(7, std)]
    assert course(date(2026, 10, 24), days, value, spread, [(8, -6.6)], None, "µm/m", texts()) == wanted


@pytest.mark.parametrize(
    ("opposite", "wanted"),
    [
        (False, "C axis or B axis or spindle has moved along X by +20 µm, since Mon 26 Oct 2026."),
        (True, "C axis or B axis has moved along X by +20 µm, or spindle by −20 µm, since Mon 26 Oct 2026."),
    ],
)
def test_the_list_has_the_size_of_what_no_touch_tells_apart(tmp_path: Path, opposite: bool, wanted: str) -> None:
    """It stopped at the bracket: "C axis or B axis, since Mon 26 Oct 2026"."""
    since = night(M, 1)["night"]
    text = changed("EX0C", "+20.0 ± 0.3 µm", since, ["EX0B", "EX0S"], {"EX0S": "-20.0 ± 0.3 µm"} if opposite else {})
    own = scale(FOUND, 0.7) | {"parameter": "EX0C", "unit": "mm", "size": 0.02, "total": 0.02, "text": text, "alike": ["EX0B"]}
    own["now"] = say("night.alarms.still_there", told="+20.0 ± 0.3 µm")
    place = cell(tmp_path / "one", records=[night(M, 2, "changed", alarms=[own]), night(M, 8, "changed", standing=[own])])
    with TestClient(create(Settings((place,))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        text = " ".join(client.get("/").text.split())
    assert wanted in text
