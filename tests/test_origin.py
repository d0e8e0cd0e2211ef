"""Where readings come from: what was edited, what was changed since, what is never written over; and the picture before a run."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from tango_cnc.cli import guarded, tango
from tango_cnc.files.origin import changed_keys, edited_rows, read_origin, set_aside, simulated


def called(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    code = guarded(tango.main, [str(a) for a in arguments], standalone_mode=False)
    out, err = capsys.readouterr()
    return code, out, err


@pytest.fixture
def cell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    folder = tmp_path / "cell"
    assert called(capsys, "init", folder, "--example", "three_axis_calibrated")[0] == 0
    assert called(capsys, "simulate", "-C", folder)[0] == 0
    return folder


def test_a_row_edited_by_hand_is_noticed(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = cell / "readings.csv"
    assert edited_rows(file) == ([], 0)
    lines = file.read_text(encoding="utf-8").splitlines()
    lines[4] = lines[4].replace(",ok,", ",miss,")
    file.write_text("\n".join([*lines[:-2]]) + "\n", encoding="utf-8")
    assert edited_rows(file) == ([5], 2)
    code, out, _ = called(capsys, "estimate", "-C", cell, "--json", "-")
    data = json.loads(out)
    assert code == 0 and data["verdict"] == "doubtful"
    assert any("1 rows are not as they were written (lines 5)" in reason for reason in data["reasons"])


def test_what_was_changed_since_is_said_by_key(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = cell / "machine.yaml"
    file.write_text(file.read_text(encoding="utf-8").replace("tip_radius: 3.0", "tip_radius: 3.001"), encoding="utf-8")
    assert changed_keys(cell / "readings.csv", cell) == {"machine.yaml": ["probe.tip_radius"]}
    assert "machine.yaml was changed since the readings were made: probe.tip_radius" in called(capsys, "estimate", "-C", cell)[1]


def test_the_simulator_writes_over_its_own_readings_only(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = cell / "readings.csv"
    assert simulated(file)
    assert called(capsys, "simulate", "-C", cell, "--seed", 4)[0] == 0
    file.write_text(file.read_text(encoding="utf-8").replace(",ok,", ",miss,", 1), encoding="utf-8")
    kept = file.read_text(encoding="utf-8")
    code, out, err = called(capsys, "simulate", "-C", cell)
    assert code == 0 and file.read_text(encoding="utf-8") == kept
    assert "simulated.csv" in out and "stays as it is" in err


def test_readings_before_are_kept(cell: Path) -> None:
    file = cell / "readings.csv"
    text = file.read_text(encoding="utf-8")
    name = set_aside(file)
    assert name is not None and (cell / name).read_text(encoding="utf-8") == text and not file.exists()


def test_readings_of_others_stay_readable(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (cell / "readings.origin.json").unlink()
    assert read_origin(cell / "readings.csv") is None
    code, _, err = called(capsys, "estimate", "-C", cell)
    assert code == 0 and "origin unknown" in err


def test_an_interrupted_run_says_how_to_go_on(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (cell / "readings.csv").rename(cell / "readings.partial.csv")
    code, _, err = called(capsys, "estimate", "-C", cell)
    assert code == 2 and "the run was interrupted, and readings.partial.csv has its 96 touches" in err and "--resume" in err


def test_the_machine_is_drawn_before_a_measurement(cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "machine.svg"
    assert called(capsys, "check", "-C", cell, "--picture", file)[0] == 0
    texts = [e.text for e in ET.fromstring(file.read_text(encoding="utf-8")).iter("{http://www.w3.org/2000/svg}text")]
    assert {"+X table", "+Y table", "+Z spindle", "tip"} <= set(texts)
    assert called(capsys, "check", "-C", cell, "--picture", tmp_path / "machine.png")[0] == 2


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("strategy.yaml", "feed: 180", "feed: 18000", "approach.feed"),
        ("machine.yaml", "repeatability: 0.0007", "repeatability: 1", "probe.repeatability"),
    ],
)
def test_slips_that_break_a_stylus_are_refused(
    file: str, old: str, new: str, said: str, cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (cell / file).read_text(encoding="utf-8")
    assert old in text
    (cell / file).write_text(text.replace(old, new), encoding="utf-8")
    code, _, err = called(capsys, "check", "-C", cell)
    assert code == 2 and said in err
