"""Where readings come from: what was edited, what was changed since, what is never written over; and the picture before a run."""

from __future__ import annotations

import json
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from support.commands import called

from tango_cnc.cli import guarded, tango
from tango_cnc.files import read_cell, read_readings
from tango_cnc.files.origin import (
    changed_keys,
    current,
    edited_rows,
    hurried,
    look_up,
    origin_file,
    other_machine,
    read_origin,
    set_aside,
    simulated,
    write_origin,
)


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example with simulated readings; nobody changes it."""
    folder = tmp_path_factory.mktemp("origin") / "cell"
    for command in (["init", str(folder), "--example", "three_axis_calibrated"], ["simulate", "-C", str(folder)]):
        assert guarded(tango.main, command, standalone_mode=False) == 0
    return folder


@pytest.fixture
def cell(fresh: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(fresh, tmp_path / "cell"))


@pytest.mark.few(0)
def test_a_row_edited_by_hand_is_noticed(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = cell / "simulated.csv"
    assert edited_rows(look_up(file)) == ([], 0)
    lines = file.read_text(encoding="utf-8").splitlines()
    lines[4] = lines[4].replace(",ok,", ",miss,")
    file.write_text("\n".join([*lines[:-2]]) + "\n", encoding="utf-8")
    assert edited_rows(look_up(file)) == ([5], 2)
    code, out, _ = called(capsys, "estimate", "-C", cell, "--json", "-")
    data = json.loads(out)
    assert code == 0 and data["verdict"] == "doubtful"
    assert any("1 rows are not as they were written (lines 5)" in reason for reason in data["reasons"])


@pytest.mark.long
def test_what_was_changed_since_is_said_by_key(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = cell / "machine.yaml"
    file.write_text(file.read_text(encoding="utf-8").replace("tip_radius: 3.0", "tip_radius: 3.001"), encoding="utf-8")
    assert changed_keys(look_up(cell / "simulated.csv"), cell) == {"machine.yaml": ["probe.tip_radius"]}
    assert "machine.yaml was changed since the readings were made: probe.tip_radius" in called(capsys, "estimate", "-C", cell)[1]


def test_a_second_simulation_keeps_the_first_and_the_index_says_which_is_current(
    cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = cell / "simulated.csv"
    first = file.read_text(encoding="utf-8")
    assert simulated(file)
    assert called(capsys, "simulate", "-C", cell)[0] == 0
    assert len(list(cell.glob("simulated*.csv"))) == 1  # the same again
    code, _, err = called(capsys, "simulate", "-C", cell, "--seed", 4)
    index = read_origin(file)
    assert code == 0 and index is not None and index["readings"] == "simulated.csv"
    (kept,) = index["kept"]
    assert kept in err and (cell / kept).read_text(encoding="utf-8") == first != file.read_text(encoding="utf-8")
    assert edited_rows(look_up(cell / kept)) == ([], 0)  # with its own check values


def test_the_simulator_never_writes_readings_csv(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = called(capsys, "simulate", "-C", cell, "-o", cell / "readings.csv")
    assert code == 2 and "the name of what was measured" in err and not (cell / "readings.csv").exists()
    (cell / "simulated.csv").rename(cell / "readings.csv")
    measured = (cell / "readings.csv").read_text(encoding="utf-8")
    code, out, err = called(capsys, "simulate", "-C", cell, "--seed", 5)
    assert code == 0 and "simulated.csv" in out and "stays what commands read" in err
    assert (cell / "readings.csv").read_text(encoding="utf-8") == measured
    assert current(cell) == cell / "readings.csv"


@pytest.mark.long
def test_what_was_simulated_is_said_in_every_command(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("estimate", "iso230"):
        assert "note: readings of the simulated machine" in called(capsys, command, "-C", cell)[1], command


def test_an_exchanged_header_and_a_repeated_row_are_noticed(cell: Path) -> None:
    file = cell / "simulated.csv"
    lines = file.read_text(encoding="utf-8").splitlines()
    exchanged = lines[0].replace("X,Y", "Y,X", 1)
    file.write_text("\n".join([exchanged, *lines[1:], lines[7]]) + "\n", encoding="utf-8")
    assert edited_rows(look_up(file)) == ([1, len(lines) + 1], 0)


def test_a_run_that_took_less_time_than_its_clock_is_said(cell: Path) -> None:
    run = {"program_hash": "abc", "start_utc": "2026-01-01T00:00:00Z", "end_utc": "2026-01-01T00:00:10Z"}
    write_origin(cell / "simulated.csv", cell, "measured", run=run)
    known = read_origin(cell / "simulated.csv")
    assert (
        known is not None
        and known["run"]["program_hash"] == "abc"
        and "but the run took 10 s" in hurried(look_up(cell / "simulated.csv"))
    )


def test_readings_before_are_kept(cell: Path) -> None:
    file = cell / "simulated.csv"
    text = file.read_text(encoding="utf-8")
    name = set_aside(file)
    assert name is not None and (cell / name).read_text(encoding="utf-8") == text and not file.exists()


@pytest.mark.long
def test_readings_of_others_stay_readable(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (cell / "simulated.origin.json").unlink()
    assert read_origin(cell / "simulated.csv") is None
    code, out, _ = called(capsys, "estimate", "-C", cell)
    assert code == 0 and "origin unknown" in out


def test_an_interrupted_run_says_how_to_go_on(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (cell / "simulated.csv").rename(cell / "readings.partial.csv")
    code, _, err = called(capsys, "estimate", "-C", cell)
    assert code == 2 and "the run was interrupted, and readings.partial.csv has its 96 touches" in err and "--resume" in err


@pytest.mark.long
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


def test_readings_out_of_a_spreadsheet_are_read_or_explained(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    parts = read_cell(cell)
    plain = read_readings(cell / "simulated.csv", parts.machine, parts.artefact)
    text = (cell / "simulated.csv").read_text(encoding="utf-8")
    sheet = cell / "sheet.csv"
    sheet.write_text(text.replace(",", ";").replace(".", ","), encoding="utf-8")
    assert (read_readings(sheet, parts.machine, parts.artefact).position == plain.position).all()
    sheet.write_text(text.replace(",", ";").replace(".", ",", 1).replace(".", ".000,", 1), encoding="utf-8")
    code, _, err = called(capsys, "estimate", "-C", cell, "--readings", sheet)
    assert code == 2 and "nothing between thousands" in err
    (cell / "sheet.xlsx").write_bytes(b"PK\x03\x04")
    code, _, err = called(capsys, "estimate", "-C", cell, "--readings", cell / "sheet.xlsx")
    assert code == 2 and "sheet.xlsx: found a spreadsheet; allowed: a text file. Save the sheet as CSV" in err


def test_positions_in_micrometres_are_said_to_be(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [line.split(",") for line in (cell / "simulated.csv").read_text(encoding="utf-8").splitlines()]
    linear = [rows[0].index(axis) for axis in "XYZ"]
    for row in rows[1:]:
        for i in linear:
            row[i] = f"{1000 * float(row[i]):.3f}"
    (cell / "um.csv").write_text("\n".join(map(",".join, rows)) + "\n", encoding="utf-8")
    code, _, err = called(capsys, "estimate", "-C", cell, "--readings", cell / "um.csv")
    assert code == 2 and "um.csv:2: " in err and "if X, Y, Z are in µm, divide these columns by 1000" in err
    rows[1:] = [[*row[: linear[0]], *(f"{float(row[i]) / 1000:.6f}" for i in linear), *row[linear[-1] + 1 :]] for row in rows[1:]]
    rows[7][linear[0]] = "2000000"  # one slip is no unit
    (cell / "slip.csv").write_text("\n".join(map(",".join, rows)) + "\n", encoding="utf-8")
    code, _, err = called(capsys, "estimate", "-C", cell, "--readings", cell / "slip.csv")
    assert code == 2 and "slip.csv:8: X" in err and "µm" not in err


def test_a_set_of_terms_that_there_is_not_names_all_that_may_be_stated(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = called(capsys, "estimate", "-C", cell, "--terms", "S5")
    assert code == 2 and "S1, S2, S3, S4, or a list of them, of coefficients (EYX2) and causes (thermal_drift)" in err


@pytest.mark.long
def test_readings_that_are_all_alike_get_a_sentence(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [line.split(",") for line in (cell / "simulated.csv").read_text(encoding="utf-8").splitlines()]
    alike = [rows[0], *([*row[:3], *rows[1][3:7], *row[7:]] for row in rows[1:])]
    (cell / "alike.csv").write_text("\n".join(map(",".join, alike)) + "\n", encoding="utf-8")
    for command in ("estimate", "iso230"):
        code, out, err = called(capsys, command, "-C", cell, "--readings", cell / "alike.csv")
        assert code in (1, 2) and "Traceback" not in err, command
        assert "no machine repeats every digit" in out + err or "is the same in all touches" in out + err
        best = next(line for line in (out + err).splitlines() if line.startswith("most likely"))
        assert "position of another one" in best or "is the same in all touches" in best


@pytest.mark.few(0)
def test_readings_of_another_machine_are_doubtful_and_no_check_of_this_one(
    cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = Path(shutil.copytree(cell, tmp_path / "other"))
    file = other / "machine.yaml"
    name = read_cell(other).machine.name
    file.write_text(file.read_text(encoding="utf-8").replace(f"name: {name}", "name: the machine beside it"), encoding="utf-8")
    assert other_machine(look_up(cell / "simulated.csv"), cell) is None
    assert other_machine(look_up(cell / "simulated.csv"), other) == (name, "the machine beside it")
    code, out, _ = called(capsys, "estimate", "-C", other, "--json", "-")
    data = json.loads(out)
    assert (code, data["verdict"]) == (0, "doubtful")
    assert any(f"is of the machine {name!r}, the cell is of 'the machine beside it'" in reason for reason in data["reasons"])
    full = tmp_path / "full.csv"  # of which nobody knows whose it is
    shutil.copy(cell / "simulated.csv", full)
    asked = ["design", "-C", other, "--readings", full, "--judge", cell / "simulated.csv"]
    code, _, err = called(capsys, *asked)
    assert code == 2
    assert f"simulated.csv of the machine {name!r}; allowed: a check of 'the machine beside it'" in err
    assert "found the readings of the full run itself" in called(capsys, *asked, "--despite")[2]


@pytest.mark.long
def test_a_check_made_before_its_full_run_is_none_of_it(cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    full, few = cell / "simulated.csv", tmp_path / "few.csv"
    shutil.copy(full, few)
    known = json.loads(origin_file(full).read_text(encoding="utf-8"))
    known["run"] = {"start_utc": "2020-02-03T06:00:00Z"}
    origin_file(few).write_text(json.dumps(known), encoding="utf-8")
    asked = ["design", "-C", cell, "--readings", full, "--judge", few]
    code, _, err = called(capsys, *asked)
    assert code == 2 and "of 2020-02-03 06:00 UTC, before the full run" in err and "allowed: a check made after it" in err
    assert "found the readings of the full run itself" in called(capsys, *asked, "--despite")[2]
