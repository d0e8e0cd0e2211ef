"""A control that gets a compensation is another machine for runs that see it: the next night says so, and curves mark the day."""

from __future__ import annotations

import shutil
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.compensated import ROOT, example, measured
from support.nights import into
from support.nights import night as plain
from support.nights_parts import nights_of

from sim_controller.compensation import read
from sim_controller.simulate import simulate
from tango_cnc.compensate import loop, propose
from tango_cnc.files import read_cell
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import Compensation, add_compensations, opened
from tango_cnc.history.picture import picture
from tango_cnc.nightly.control import Given
from tango_cnc.nightly.ports import Measured
from tango_cnc.plan import plan
from tango_cnc.report.charts import tip
from tango_cnc.report.compensated import as_loaded, begins, marked
from tango_cnc.report.course import by_compensations, jumps_of_tip
from tango_cnc.report.texts import texts
from tango_cnc.texts import say


def event(what: str, day: int, number: int = 1) -> Compensation:
    return Compensation(day, f"2026-11-{day:02d}T12:00:00Z", number, "siemens", what, "", None, None, None)


def test_days_on_which_a_control_was_changed_are_marks_and_their_nights_jumps() -> None:
    """Written on the 3rd, kept on the 5th, taken out on the 9th; what was proposed or undecided changes nothing."""
    happened = [event("rolled back", 9), event("kept", 5), event("undecided", 4), event("written", 3), event("proposed", 3)]
    marks = marked(happened, texts())
    assert marks == {"2026-11-03": "comp. 1 written", "2026-11-05": "comp. 1 kept", "2026-11-09": "comp. 1 taken out"}
    nights = [f"2026-11-{d:02d}" for d in (1, 2, 4, 5, 6, 7)]  # none on the 3rd, and none after the 9th
    starts = [f"{night}T02:00:00Z" for night in nights]  # that of the 5th has ended when it was kept at noon
    assert begins(happened, starts) == {2, 4}
    value = np.array([40.0, 40.2, 39.9, 40.0, 12.1, 11.9])
    assert jumps_of_tip({}, range(6), value, 0.5, {2, 4}) == [(4, pytest.approx(-27.9))]
    own = (1e-3 * value, np.full(6, 2e-4))
    assert by_compensations({2, 4}, own) == [(4, pytest.approx(-27.9e-3))]
    assert by_compensations({2, 4}, own, [(4, -0.5), (1, 0.2)]) == [(1, 0.2), (4, -0.5)]
    drawn = [(date.fromisoformat(n), float(v), "good") for n, v in zip(nights, value, strict=True)]
    chart = tip(drawn, 30.0, "µm", texts(), 425, 240, marks)
    assert "comp. 1 written" in chart and "comp. 1 kept" in chart and "taken out" not in chart


def test_the_night_after_says_that_the_control_was_changed() -> None:
    alarm = {"text": "EY0C has moved by −22 µm since last night", "do": "Look at the fixture."}
    told = Given("2026-11-03T12:00:00Z", "2026-11-03", 4, "siemens").told(alarm)
    assert told["text"].endswith(alarm["text"])
    assert "compensation 4 was written into the control on 2026-11-03" in told["text"]
    assert "Look at the fixture" not in told["do"] and "--measured 4" in told["do"]
    unknown = Given("2026-11-03T12:00:00Z", "2026-11-03", 4, "siemens").told({"text": say("changed.unknown"), "do": ""})
    wanted = "after compensation 4 was written into the control on 2026-11-03, the machine is not as it was, in more than one error"
    assert unknown["text"] == wanted  # it began with "no single cause explains it"
    assert "taken out" in Given("2026-11-03T12:00:00Z", "2026-11-03", 4, "siemens", taken_out=True).told(alarm)["text"]


@pytest.mark.long
def test_nights_of_a_machine_whose_tool_center_point_control_is_always_on(tmp_path: Path) -> None:
    """Such runs see everything that was written: the night after it measures another machine, and names the compensation."""
    folder = tmp_path / "cell"
    shutil.copytree(ROOT / "examples" / "trunnion", folder)
    cell, world = read_cell(folder), example("trunnion")[1]
    kept = loop.store(folder, propose(measured(cell, world, seed=5), "siemens"), "2026-01-01T00:00:00Z")
    settings, made, name = Nightly(limits={"volume": 60.0}), plan(cell), cell.machine.name
    control, found = read(kept.folder, cell.machine), list[dict[str, Any]]()

    with opened(tmp_path / "history.db") as history:

        def night(number: int, seed: int, with_it: bool) -> dict[str, Any]:
            base = plain(name, number)
            day = datetime.fromisoformat(base["start_utc"]).timestamp() / 86_400
            readings = simulate(cell.machine, cell.artefact, cell.strategy, world, seed=seed, control=control if with_it else None)
            told, knowledge, _ = nights_of(cell, settings, made, deep=False).analysed(
                history, day, "full", Measured(readings, None, len(readings), 60.0)
            )
            history.add_night({**base, "kind": "full", **told, "headline": "x"}, None, knowledge)
            found.append({**base, **told})
            return told

        def note(what: str, after: int, **more: Any) -> None:
            ended = datetime.fromisoformat(plain(name, after)["end_utc"])
            loop.note(folder, kept, (ended + timedelta(hours=3)).strftime("%Y-%m-%dT%H:%M:%SZ"), what, **more)

        assert not night(0, 6, False)["alarms"] and not night(1, 7, False)["alarms"]
        note("written", 1)
        changed = night(2, 8, True)
        assert changed["verdict"] == "changed" and "after compensation 1 was written" in changed["alarms"][0]["text"]
        assert changed["volume"]["worst_um"] < 0.3 * found[1]["volume"]["worst_um"]
        note("kept", 2, tcp=True)
        assert "in_control" not in night(3, 9, True)  # all of it is in what is measured: nothing is taken off once more
        assert found[3]["volume"]["worst_um"] == pytest.approx(found[2]["volume"]["worst_um"], abs=4)
        assert not found[3]["alarms"] and [a["id"] for a in found[3]["standing"]] == [a["id"] for a in found[2]["alarms"]]
        note("rolled back", 3, reason="spindle")
        back = night(4, 10, False)
        assert "after compensation 1 was taken out" in back["alarms"][0]["text"]
        add_compensations(history, name, str(folder), loop.history(folder))
        picture(history, name, [history.trend(name, "EY0C")], tmp_path / "trend.svg")
    drawn = (tmp_path / "trend.svg").read_text(encoding="utf-8")
    assert "compensation 1 written" in drawn and "compensation 1 rolled back" in drawn


@pytest.mark.long
def test_a_curve_of_nights_without_compensations_has_no_marks(tmp_path: Path) -> None:
    with opened(tmp_path / "history.db") as history:
        into(history, [plain("m", number) for number in range(3)])
        assert "compensation" not in (drawn_of(history, tmp_path / "trend.svg"))


def drawn_of(history: Any, file: Path) -> str:
    pytest.importorskip("matplotlib")
    picture(history, "m", [history.trend("m", "EY0C")], file)
    return file.read_text(encoding="utf-8")


def test_what_to_do_asks_no_more_for_what_was_done_after_the_night() -> None:
    """Half an hour after 'tango compensate --measured 1' the page still asked for it."""
    do = say("night.measure_first", number=1, target="siemens", event="written")
    alarm = {"utc": "2026-11-04T02:00:00Z", "do": do, "cause": "axis_location", "parameter": "EY0C", "text": "x"}
    written, seen_ = event("written", 3), event("kept as far as seen", 4)
    assert as_loaded(alarm, [written])["do"] == do
    later = as_loaded(alarm, [seen_, written])
    assert "was measured and kept as far as seen on 2026-11-04" in later["do"] and "--measured" not in later["do"]
    assert "--rolled-back 1" in as_loaded(alarm, [event("no help", 4), written])["do"]
