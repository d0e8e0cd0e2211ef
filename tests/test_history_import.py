"""`tango history import`: nights of old cells are nights of the cell that goes on with them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from tango_cnc.cli import tango
from tango_cnc.commands._import import imported
from tango_cnc.commands.init import write_example
from tango_cnc.history import opened
from tango_cnc.nightly.mail import message


@pytest.mark.long
def test_an_imported_night_is_one_of_the_cell_that_goes_on_with_it(tmp_path: Path) -> None:
    old, home = tmp_path / "n01", tmp_path / "home"
    write_example(old, "trunnion")
    assert CliRunner().invoke(tango, ["simulate", "-C", str(old), "--seed", "1"], standalone_mode=False).exit_code == 0
    (old / "simulated.csv").rename(old / "readings.csv")
    shutil.copytree(old, home)
    (old / "readings.json").write_text(json.dumps({"start_utc": "2026-11-19T02:00:00Z"}), encoding="utf-8")
    (home / "nightly.yaml").write_text("nightly: 1\nowner: Ann\nlimits: {volume: 300}\n", encoding="utf-8")
    with opened(tmp_path / "history.db") as history:
        ((_, record),) = imported(history, [old], home)
    assert (record["cell"], record["owner"], record["verdict"]) == (str(home), "Ann", "good")
    assert [(x["what"], x["limit"], x["passed"]) for x in record["limits"]] == [("volume", 300.0, True)]
    assert record["duration_s"] == pytest.approx(record["machine_time_s"], abs=1) and record["duration_s"] > 60
    assert record["next"] == {"kind": "check", "why": "nothing is too uncertain"}
    said = message(record, (), ())[1]
    assert f"readings of {old}" in said and "files in" not in said


@pytest.mark.long
def test_readings_of_another_machine_or_with_edited_rows_are_no_night_of_this_one(tmp_path: Path) -> None:
    old, home = tmp_path / "old", tmp_path / "home"
    write_example(old, "trunnion")
    write_example(home, "trunnion")
    assert CliRunner().invoke(tango, ["simulate", "-C", str(old), "--seed", "1"], standalone_mode=False).exit_code == 0
    for name in ("csv", "origin.json"):
        (old / f"simulated.{name}").rename(old / f"readings.{name}")
    machine, readings = old / "machine.yaml", old / "readings.csv"
    own, whole = machine.read_text(encoding="utf-8"), readings.read_text(encoding="utf-8")

    def refused(*more: str) -> str:
        words = ["history", "import", str(old), "-C", str(home), "--history", str(tmp_path / "history.db"), *more]
        found = CliRunner().invoke(tango, words, standalone_mode=False)
        return str(found.exception or "")

    machine.write_text(own.replace("name: trunnion", "name: the one beside it", 1), encoding="utf-8")
    assert "found readings of the machine 'trunnion'; allowed: those of 'the one beside it'" in refused()
    machine.write_text(own, encoding="utf-8")
    lines = whole.splitlines()
    readings.write_text("\n".join([*lines[:7], lines[7].replace("ok", "miss"), *lines[8:-1]]) + "\n", encoding="utf-8")
    assert "found 1 rows that are not as they were written (lines 8), and 1 that are gone" in refused()
    with opened(tmp_path / "history.db") as history:
        assert not history.machines(), "nothing was added"
    readings.write_text(whole, encoding="utf-8")
    assert refused() == ""


@pytest.mark.long
def test_an_imported_night_that_promises_a_diagnosis_has_it_and_looks_at_the_stylus(tmp_path: Path) -> None:
    """A stylus that creeps in its holder reads like a machine that warms up: both are named, and what to do has both."""
    home, cells = tmp_path / "home", []
    write_example(home, "trunnion")
    for number in (1, 2):
        old = Path(shutil.copytree(home, tmp_path / f"n{number}"))
        if number == 2:
            creep = "effects:\n  - {cause: stylus_creep, amplitude: 0.010, tau: 900, direction: [1, 0, 0]}"
            world = (old / "world.yaml").read_text(encoding="utf-8")
            assert "effects: []" in world
            (old / "world.yaml").write_text(world.replace("effects: []", creep), encoding="utf-8")
        words = ["simulate", "-C", str(old), "--seed", str(number)]
        assert CliRunner().invoke(tango, words, standalone_mode=False).exit_code == 0
        (old / "simulated.csv").rename(old / "readings.csv")
        (old / "readings.json").write_text(json.dumps({"start_utc": f"2026-11-{10 + number}T02:00:00Z"}), encoding="utf-8")
        cells.append(old)
    with opened(tmp_path / "history.db") as history:
        (_, good), (_, crept) = imported(history, cells, home)
    assert good["verdict"] == "good" and "diagnosis" not in good  # nobody waits for it
    assert crept["verdict"] == "doubtful" and crept["diagnosis"]["verdict"] == "unexplained"
    assert "(warm-up, surroundings, or the stylus in its holder)" in crept["headline"]
    said = "nobody can tell whether the machine drifted or the stylus tip crept sideways in its holder"
    assert crept["plausible"]["reasons"][1].startswith(said)
    told = message(crept, (), ())[1]
    assert "Look whether stylus and probe sit tight in their holders" in told and "No cause was looked for" not in told
