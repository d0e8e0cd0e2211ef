"""A report of readings after the newest night that says better than that night: its answer stays, and every surface says why."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.commands import said
from support.newer import PATHS, YES, measured
from support.nights import M, knock, night
from support.pages import plain_of, seen

from tango_cnc.cli import tango
from tango_cnc.report.answer import Answer, by_newer
from tango_cnc.report.newer import NewerAnswer
from tango_cnc.report.orders import by_night
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units

SAYS = "say Yes, with 50 µm at the tool tip. They take nothing back, so the answer stays No until a night has measured the machine."
ASKED = "Have a night measure the machine, or wait for the next one."
TOLD = NewerAnswer("2026-11-19T07:00:00Z", 50.0, 140.0, may="yes")


def beyond(folder: Path) -> Path:
    """A night at 274 of 140 µm with a knock of its own, and newer readings of a whole run at 50 µm."""
    limits = [{"what": "volume", "unit": "µm", "value": 274.0, "low": 272.0, "high": 276.0, "limit": 140.0, "passed": False}]
    alarm = {**knock(night(M, 8)["night"]), "do": "Ask who was at the machine. Run the full measurement."}
    return measured(folder, "yes", 50.0, False, verdict="out_of_limits", limits=limits, alarms=[alarm])[0]


@pytest.mark.few(0)
def test_a_no_says_beside_newer_readings_of_a_plain_yes_that_it_stays_and_until_when(tmp_path: Path) -> None:
    """238 touches at 07:00, 50 µm: every surface said No and "Run the full measurement", not one word that it had been run."""
    place = beyond(tmp_path / "one")
    for path in PATHS:
        text = plain_of(seen(place, path))
        assert SAYS in text and "Readings that were made after that night (" in text, path
        assert ("274 µm, 140 µm allowed" in text and "50 µm, 140" not in text) and "Run the full measurement" not in text, path
    assert ASKED in plain_of(seen(place, PATHS[0]))
    for words in (("nightly", "-C", str(place), "--status"), ("fleet", str(place), "--late", "10000")):
        text, status = said(*words)
        assert SAYS.rstrip(".") in text and status == 1, words
        told = json.loads(CliRunner().invoke(tango, [*words, "--json", "-"], catch_exceptions=False).output)
        told = told["machines"][0] if "machines" in told else told
        assert told["newer_beside"].endswith(SAYS) and not (told["newer_no"] or told["newer_but"])
    lines = seen(place, "/metrics").splitlines()
    for name, value in (("newer_no", 0), ("newer_but", 0), ("volume_valid", 1), ("newer_volume_um", 50)):
        assert f'tango_machine_{name}{{machine="{M}"}} {value}' in lines


def test_what_newer_readings_of_a_plain_yes_do_to_each_answer() -> None:
    t, u = texts(), Units()
    assert by_newer(YES, TOLD, u, t) is YES
    moving = Answer("no", t("may.not_yet"), "moved", "", "")
    assert by_newer(moving, TOLD, u, t) is moving
    open_ = by_newer(Answer("but", "Yes, but", "changed", "60 µm", t("may.changed")), TOLD, u, t)
    assert open_.beside.endswith("the answer stays Yes, but until somebody has closed what is open.") and open_.numbers == "60 µm"
    for state, why in (("changed", "may.repaired"), ("late", "may.open_old"), ("undecided", "may.undecided")):
        assert by_newer(Answer("but", "Yes, but", state, "", t(why)), TOLD, u, t).beside.endswith(
            "until a night has measured the machine."
        )
    doubt = by_newer(Answer("no", "No", "doubtful", "", t("may.doubtful")), TOLD, u, t)
    assert doubt.why.startswith("Make no parts on it: last night cannot be believed. Readings") and doubt.again
    old = by_newer(Answer("unknown", "Nobody knows", "old", "", ""), TOLD, u, t)
    assert (old.may, old.newer) == ("unknown", False) and "stays Nobody knows until" in old.beside
    assert by_night(["Look. Run the full measurement.", t("may.repaired_todo")], t) == [
        f"Look. {ASKED}",
        f"{ASKED[:-1]}: it shows whether the repair has helped.",
    ]


@pytest.mark.long
def test_the_report_of_such_readings_says_it_too_and_writes_it_for_the_pages(tmp_path: Path) -> None:
    place, run = tmp_path / "cell", CliRunner()
    assert run.invoke(tango, ["init", str(place), "--example", "trunnion"], catch_exceptions=False).exit_code == 0
    run.invoke(tango, ["simulate", "-C", str(place)], catch_exceptions=False)
    from tango_cnc.history import opened

    limits = [{"what": "volume", "unit": "µm", "value": 900.0, "low": 890.0, "high": 910.0, "limit": 500.0, "passed": False}]
    volume = {"worst_um": 900.0, "rms_um": 500.0, "std_um": 5.0}
    record = night("trunnion", 8, "out_of_limits", simulated=True, limits=limits, volume=volume)
    with opened(place / "history.db") as history:
        history.add_night(record)
    (place / "nightly.yaml").write_text("nightly: 1\nlimits: {volume: 500}\nstale_days: 100000\n", encoding="utf-8")
    text, status = said("report", "-C", str(place), "--no-diagnosis", "--no-pictures")
    assert "They take nothing back, so the answer stays No until a night has measured the machine." in text
    assert "These readings were made after it:" not in text and "Run the full measurement" not in text and status == 1
    kept = json.loads((place / "report.json").read_text(encoding="utf-8"))
    assert kept["yes_after"] == record["end_utc"] or kept["after"] == record["end_utc"]
    assert "They take nothing back" in plain_of(seen(place, "/machine/trunnion"))


def test_what_is_bold_in_the_box_is_the_order_and_not_what_newer_readings_say(tmp_path: Path) -> None:
    """Five lines in bold, down to "They take nothing back:"."""
    place = beyond(tmp_path / "one")
    for path, mark in ((PATHS[0], '<span class="first">'), (PATHS[1], "<b>"), ("/alarms", "<p><b>")):
        page = seen(place, path)
        end = page.index("They take nothing back, so")
        bold = page.rindex(mark, 0, page.index("Readings that were made after that night"))
        assert "</" in page[bold : page.index("Readings that were made after", bold)] and end > bold, path
