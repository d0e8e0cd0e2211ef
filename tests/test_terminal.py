"""Pictures made of characters: a trend, a bar of uncertainty, a table. They keep to the width, to NO_COLOR and to the encoding."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from support.common_parts import table, wide
from support.few import every
from support.histories import record as kept
from support.nights import into, knock, night, thirty
from support.server import cell

from tango_cnc.cli import tango
from tango_cnc.history import opened
from tango_cnc.report import characters
from tango_cnc.report.characters import Course, bar, colored, courses, ends, marks, sparkline, width
from tango_cnc.report.repeated import shortened
from tango_cnc.texts import joined, say

MACHINE = "HU40T-like"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cell(tmp_path_factory.mktemp("terminal") / "hu40t")


def called(*words: str, columns: int = 80) -> Result:
    found = CliRunner().invoke(tango, list(words), env={"COLUMNS": str(columns)})
    assert found.exception is None or isinstance(found.exception, SystemExit), found.output
    return found


class Terminal:
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("environ", "out", "wanted"),
    [
        ({"TERM": "xterm"}, Terminal(), True),
        ({"TERM": "xterm", "NO_COLOR": "1"}, Terminal(), False),
        ({"TERM": "xterm", "NO_COLOR": ""}, Terminal(), True),  # no-color.org: when it is present and not empty
        ({"TERM": "dumb"}, Terminal(), False),
        ({"TERM": "xterm"}, open(os.devnull), False),  # noqa: SIM115
    ],
)
def test_color_is_for_terminals_that_want_it(environ: dict[str, str], out: Any, wanted: bool) -> None:
    assert ("\x1b[" in colored("x", "stop", out=out, environ=environ)) == wanted


def test_a_night_with_an_alarm_is_marked_below_its_character() -> None:
    flags = [False] * 12 + [True] + [False] * 17
    assert marks(flags, 40).index("!") == 12
    assert marks(flags, 10).index("!") == 12 // 3
    assert marks([False] * 5) == ""
    assert ends(30, 10) == [2, 5, 8, 11, 14, 17, 20, 23, 26, 29]
    assert len(sparkline([float(i) for i in range(30)], 10)) == 10


def test_what_has_no_room_goes_in_its_order_and_no_number_is_cut() -> None:
    course = Course("EX0C", [float(i) for i in range(30)], 0.97, "µm", [i == 12 for i in range(30)])
    wide, middle, narrow = (courses([course], columns) for columns in (80, 50, 40))
    assert "0.00 →  29.00  ± 0.97  µm" in wide
    assert "0.00 →  29.00  µm" in middle and "±" not in middle
    assert narrow.splitlines()[0].endswith("29.00  µm") and "→" not in narrow
    for text, columns in ((wide, 80), (middle, 50), (narrow, 40)):
        assert max(map(len, text.splitlines())) <= columns
        assert text.splitlines()[1].strip() == "!"
    assert courses([], 80) == ""


def test_the_same_marks_stand_below_all_lines_once() -> None:
    alarms = [False, True, False]
    found = [Course(name, [1.0, 2.0, 3.0], 0.1, "µm", alarms) for name in ("EX0C", "EY0C")]
    assert courses(found, 80).count("!") == 1


@pytest.mark.few(2)
@pytest.mark.parametrize("columns", [40, 60, 80, 132])
def test_the_trend_of_a_history(columns: int, folder: Path) -> None:
    text = called("history", "plot", "-C", str(folder), columns=columns).stdout
    lines = text.splitlines()
    assert max(map(len, lines)) <= columns
    first = next(line for line in lines if line.startswith("EX0C"))
    assert set(first) & set(characters.BLOCKS) and "µm" in first
    assert "!" in text and "night with an alarm" in " ".join(lines)


def test_a_table_wraps_its_last_column_in_a_terminal_only() -> None:
    rows = [["night", "what"], ["2026-11-12", "nothing has changed; the largest error over the volume is 12.3 µm"]]
    assert table(rows, "<<").count("\n") == 1
    wrapped = table(rows, "<<", 60).splitlines()
    assert max(map(len, wrapped)) <= 60 and wrapped[2].startswith(" " * 12)
    below = table(rows, "<<", 32).splitlines()
    assert below[1].strip() == "2026-11-12" and below[2].startswith("    nothing")
    assert " ".join(" ".join(below).split()).endswith("over the volume is 12.3 µm")


def test_a_list_wider_than_the_terminal_is_written_as_blocks_and_no_word_is_cut() -> None:
    rows = [["machine", "last night", "verdict", "", "tool tip", "what"]]
    rows.append(
        ["HU40T-like", "2026-11-26", "out of limits", "late", "▁▂▃▄▅▆▇█▁▂▃▄▅▆  143.0", "volume is 171.5 µm, 160 µm are allowed"]
    )
    text = table(rows, "<<<<<<", 40).splitlines()
    assert max(map(len, text)) <= 40 and text[0] == "HU40T-like"
    assert [line for line in text if line.startswith("  ") and not line.startswith("    ")] == [
        *("  last night: 2026-11-26", "  verdict: out of limits", "  late", "  tool tip: ▁▂▃▄▅▆▇█▁▂▃▄▅▆  143.0"),
        "  what: volume is 171.5 µm, 160 µm are",
    ]
    assert len(table(rows, "<<<<<<", 90).splitlines()) < len(text)


@pytest.mark.parametrize(("columns", "there", "gone"), [(80, "first → last value ± 95 %", ""), (40, "its last value", "±")])
def test_the_line_below_the_curves_names_the_numbers_that_are_there(folder: Path, columns: int, there: str, gone: str) -> None:
    text = called("history", "plot", "-C", str(folder), columns=columns).stdout
    assert there in " ".join(text.split()) and (not gone or gone not in text)


def test_the_fleet_shows_the_tool_tip_of_two_weeks(folder: Path) -> None:
    line = called("fleet", str(folder)).stdout.splitlines()[-1]
    drawn = [c for c in line if c in characters.BLOCKS]
    assert len(drawn) == 14 and line.startswith(MACHINE)


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("verdict", "late", "open_alarms", "status"),
    [
        ("good", False, 0, 0),
        ("good", True, 0, 1),
        ("changed", False, 1, 1),
        ("changed", False, 0, 0),  # somebody has answered its alarm
        ("out_of_limits", False, 0, 1),
        ("doubtful", False, 0, 1),
        ("not_measured", False, 0, 1),
    ],
)
def test_a_fleet_ends_with_1_when_a_machine_needs_somebody(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, verdict: str, late: bool, open_alarms: int, status: int
) -> None:
    with opened(tmp_path / "history.db") as history:
        history.add_night(kept(1))
        (known,) = history.fleet("2026-10-01T06:00:00+00:00")
    assert known.last is not None
    now = replace(known, last=replace(known.last, verdict=verdict), late=late, alarms_open=open_alarms)
    monkeypatch.setattr("tango_cnc.commands.fleet._stale", lambda history, nights, most: 0)  # that night is of October
    monkeypatch.setattr("tango_cnc.history.History.fleet", lambda self, now_utc, late_hours: (now,))
    found = CliRunner().invoke(tango, ["fleet", "--history", str(tmp_path / "history.db")], standalone_mode=False)
    assert found.return_value == status


def test_a_fleet_is_a_folder_of_cells_and_one_that_cannot_be_read_hides_no_other(folder: Path, tmp_path: Path) -> None:
    for name in ("never", "broken"):
        assert called("init", str(tmp_path / name), "--example", "trunnion").exit_code == 0
    (tmp_path / "broken" / "machine.yaml").write_text("bad: [", encoding="utf-8")
    (tmp_path / "measured").symlink_to(folder)
    found = CliRunner().invoke(tango, ["fleet", "-C", str(tmp_path)], standalone_mode=False)
    assert found.return_value == 1 and "broken: not in the list" in found.stderr and "machine.yaml:2" in found.stderr
    assert any(line.startswith("trunnion") and "never" in line for line in found.stdout.splitlines())
    assert any(line.startswith(MACHINE) for line in found.stdout.splitlines())


@pytest.mark.long
def test_cells_that_were_copied_from_one_another_hide_no_alarm_of_each_other(tmp_path: Path) -> None:
    """Four equal machines have one name and four folders: one alarms, one has a broken history, one was never measured."""
    cells = {name: tmp_path / name for name in ("broken", "alarms", "never", "other")}
    for name, place in cells.items():
        assert called("init", str(place), "--example", "hu40t" if name == "other" else "trunnion").exit_code == 0
    (cells["broken"] / "history.db").write_bytes(b"notes, and no database at all" * 40)
    with opened(cells["alarms"] / "history.db") as history:
        doubtful = night("trunnion", 5, "doubtful", headline="the readings are not to be relied on: a chip")
        history.add_night(night("trunnion", 4, "changed", alarms=[knock("2026-10-28")]), "touch\n1\n")
        history.add_night(doubtful, "touch\n1\n")
    places = list(cells.values())
    for order in (places, places[1:] + places[:1], places[::-1]):
        found = CliRunner().invoke(tango, ["fleet", *map(str, order)], standalone_mode=False)
        lines = [" ".join(line.split()) for line in found.stdout.splitlines()]
        assert found.return_value == 1 and "broken: not in the list" in found.stderr
        assert any(
            "doubtful 1 NOBODY KNOWS: not measured for " in line and line.startswith(f"trunnion ({cells['alarms']})")
            for line in lines
        ), found.stdout
        assert any(f"trunnion ({cells['never']}) never" in line for line in lines)
        assert any(line.startswith("HU40T-like never") for line in lines)
        told = json.loads(CliRunner().invoke(tango, ["fleet", *map(str, order), "--json", "-"]).stdout)
        assert {(m["cell"], m["alarms_open"]) for m in told["machines"]} == {
            (str(cells["alarms"]), 1),
            (str(cells["never"]), 0),
            (str(cells["other"]), 0),
        }


@pytest.mark.few(1)
@pytest.mark.parametrize("hours", [30, 50])
def test_status_and_fleet_say_late_in_the_same_minute(tmp_path: Path, hours: float) -> None:
    """The last complete night was so long ago; one that measured nothing came after it."""
    assert called("init", str(tmp_path / "m"), "--example", "trunnion").exit_code == 0
    ago = lambda h: (datetime.now(UTC) - timedelta(hours=h)).strftime("%Y-%m-%dT%H:%M:%SZ")  # noqa: E731
    nothing: dict[str, Any] = {"status": "failed", "kind": "none", "touches": 0, "start_utc": ago(3), "end_utc": ago(3)}
    with opened(tmp_path / "m" / "history.db") as history:
        history.add_night(night("trunnion", 1, start_utc=ago(hours), end_utc=ago(hours)), "touch\n1\n")
        history.add_night(night("trunnion", 2, "not_measured", **nothing))
    fleet = called("fleet", str(tmp_path / "m")).stdout
    status = called("nightly", "-C", str(tmp_path / "m"), "--status").stdout
    assert ("LATE" in fleet) == ("LATE" in status) == (hours > 36)


@pytest.mark.few(1)
@pytest.mark.parametrize(("verdict", "status"), [("good", 0), ("changed", 0), ("out_of_limits", 1), ("doubtful", 1)])
def test_status_and_fleet_end_alike_after_the_same_night(tmp_path: Path, verdict: str, status: int) -> None:
    """No alarm is open: a timer that looks at the exit status of either hears of a last night that is not in order."""
    assert called("init", str(tmp_path / "m"), "--example", "trunnion").exit_code == 0
    ago = (datetime.now(UTC) - timedelta(hours=5)).strftime("%Y-%m-%dT%H:%M:%SZ")
    with opened(tmp_path / "m" / "history.db") as history:
        history.add_night(night("trunnion", 1, verdict, start_utc=ago, end_utc=ago), "touch\n1\n")
    for words in (["fleet", str(tmp_path / "m")], ["nightly", "-C", str(tmp_path / "m"), "--status"]):
        assert CliRunner().invoke(tango, words, standalone_mode=False).return_value == status


def test_bars_of_uncertainty_have_zero_in_the_middle() -> None:
    assert bar(0, 1, 2, 21)[10] == "●" and bar(2, 0, 2, 21).endswith("●") and bar(-2, 0, 2, 21).startswith("●")
    assert len(bar(1, 1, 2, 4)) == 7


@pytest.mark.long
def test_the_uncertainty_is_drawn_where_there_is_room(folder: Path) -> None:
    assert called("simulate", "-C", str(folder)).exit_code == 0
    for columns, drawn in ((120, True), (64, False)):
        lines = called("uncertainty", "-C", str(folder), columns=columns).stdout.splitlines()
        line = next(x for x in lines if x.startswith("EX0C"))
        assert ("●" in line) == drawn and len(line) <= columns


@pytest.mark.long
@pytest.mark.parametrize("encoding", every(["cp1252", "latin-1", "utf-8"], 3))
def test_no_encoding_of_the_output_is_an_error(encoding: str, folder: Path) -> None:
    """A file on Windows has no blocks: other characters stand for them."""
    environ = os.environ | {"PYTHONIOENCODING": encoding, "PYTHONUTF8": "0", "COLUMNS": "80"}
    command = [sys.executable, "-m", "tango_cnc", "history", "plot", "EX0C", "-C", str(folder)]
    done = subprocess.run(command, env=environ, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode(encoding)
    text = done.stdout.decode(encoding)
    assert ("█" in text) == (encoding == "utf-8") and ("#" in text) == (encoding != "utf-8")
    assert "?" not in text


def test_what_every_night_repeats_is_said_once() -> None:
    def standing(night: str, now: str) -> str:
        parts = {"text": say("judged.doubtful"), "who": "Ann has it", "more": "", "part": "", "gap": ""}
        return say("night.words.changed_since_night", night=night, now=now, **parts)

    def beyond(value: str, name: str) -> str:
        cause = joined("", (": ", say("changed.most", name=name, size="9 µm", share="8 µm")))
        limit = {"unit": "µm", "limit": "45", "part": "", "gap": ""}
        return say("night.words.allowed", what="volume", value=value, cause=cause, **limit)

    found = shortened([standing("2026-11-05", " (+9 µm)"), standing("2026-11-05", " (+8 µm)"), standing("2026-11-01", "")])
    assert found[0].startswith("still changed, alarm of 2026-11-05: doubtful")
    assert found[1] == "still changed since the night ending 2026-11-05 (+8 µm)"
    assert "2026-11-01: doubtful" in found[2]  # another alarm is told whole
    found = shortened(
        [beyond("52.0", "EX0C"), beyond("51.0", "EX0C"), beyond("50.0", "EY0C"), "written by hand", "written by hand"]
    )
    assert (
        "EX0C" in found[0] and found[1] == "volume is 51.0 µm, 45 µm are allowed; the same stands behind it" and "EY0C" in found[2]
    )
    assert found[3:] == ["written by hand", "written by hand"]  # what does not know its key stays as it is


@pytest.mark.long
def test_lists_of_a_simulated_machine_say_so(tmp_path: Path) -> None:
    for simulated in (True, False):
        with opened(tmp_path / f"{simulated}.db") as history:
            into(history, [{**r, "simulated": simulated} for r in thirty(MACHINE)[:9]])
        for words in (("list",), ("plot", "EX0C"), ("compare", "1"), ("show",)):
            found = called("history", *words, "--history", str(tmp_path / f"{simulated}.db"))
            assert ("SIMULATED" in found.output) == simulated, words


def test_the_width_is_that_of_the_terminal_and_forty_at_least() -> None:
    assert (width({"COLUMNS": "100"}), width({"COLUMNS": "12"})) == (100, 40)


@pytest.mark.few(2)
@pytest.mark.parametrize("columns", [40, 80])
@pytest.mark.parametrize("words", [("history", "show", "last", "-C"), ("nightly", "--status", "-C")])
def test_no_line_is_wider_than_the_terminal_and_no_word_is_cut(
    folder: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], columns: int
) -> None:
    """Lines of 120 to 235 columns were broken by the terminal, within words."""
    whole = called(*words, str(folder)).stdout
    for place in ("_common", "_nightly_status", "history"):
        monkeypatch.setattr(f"tango_cnc.commands.{place}.on_terminal", lambda: columns)
    text = called(*words, str(folder)).stdout
    long = [line for line in text.splitlines() if wide(line) > columns and len(line.split()) > 1]
    assert not long and all(word in text for word in whole.split())


def test_letters_that_take_two_columns_leave_a_table_in_line() -> None:
    text = table([["machine", "x"], ["旋盤 一号", "1"], ["lathe", "2"]], "<<")
    assert {wide(line[:-1]) for line in text.splitlines()} == {11}


def test_nothing_has_no_sign_in_a_table() -> None:
    rows = [["-0.0", "-0.00 … 0.42", "−0", "-0.05", "2026-01-01", "EX-0"]]
    assert table(rows, "<<<<<<") == "0.0  0.00 … 0.42  0  -0.05  2026-01-01  EX-0"
