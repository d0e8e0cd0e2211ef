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
from tango_cnc.nightly.words import message


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
