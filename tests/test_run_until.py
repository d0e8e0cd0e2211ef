"""`tango run --until` ends where the goal is met: by the same count as an estimate of those readings says, and it can go on."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from tango_cnc.cli import guarded, tango
from tango_cnc.commands.demo import _controller
from tango_cnc.design.until import why_short


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    folder = tmp_path / "cell"
    assert guarded(tango.main, ["init", str(folder), "--example", "trunnion"], standalone_mode=False) == 0
    file = folder / "tango.yaml"
    file.write_text(file.read_text().replace("post: fanuc", "post: fanuc\n  gate: none"), encoding="utf-8")
    return folder


@pytest.mark.long
def test_a_run_ends_with_the_touch_that_reaches_the_goal_and_the_rest_can_be_made(
    cell: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with _controller(cell, 0.0) as port:
        asked = ["run", "-C", str(cell), "--port", f"serial://{port}", "--yes"]
        assert guarded(tango.main, [*asked, "--until", "EY0C=2,EA0C=5"], standalone_mode=False) == 0
        first = len(list(csv.DictReader((cell / "readings.csv").open(encoding="utf-8"))))
        assert 60 < first < 300  # of 393; a ball that is not complete yet counts as facets, as the estimate takes it
        assert "--until: reached" in capfd.readouterr().err
        told = cell / "estimate.json"
        assert guarded(tango.main, ["estimate", "-C", str(cell), "--json", str(told)], standalone_mode=False) == 0
        found = json.loads(told.read_text(encoding="utf-8"))["parameters"]
        assert found["EY0C"]["std"] < 2e-3 and found["EA0C"]["std"] < 5e-6
        assert guarded(tango.main, [*asked, "--resume"], standalone_mode=False) == 0
        whole = list(csv.DictReader((cell / "readings.csv").open(encoding="utf-8")))
    assert len(whole) > first and len({row["touch"] for row in whole}) == len(whole)


@pytest.mark.few(3)
@pytest.mark.parametrize("goal", ["volume", "check", "volume=3,EX0C=1", "nonsense", "EX0C=1", "volume=0"])
def test_a_goal_that_says_no_limit_is_refused_before_anything_moves(
    goal: str, cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["run", "-C", str(cell), "--port", "serial:///dev/null", "--yes", "--until", goal]
    assert guarded(tango.main, asked, standalone_mode=False) == 2
    said = capsys.readouterr().err
    assert "allowed:" in said and "--until:" in said and "--goal" not in said
    assert not (cell / "readings.csv").exists() and not (cell / "readings.journal").exists()


def test_a_goal_that_chance_kept_from_being_reached_blames_no_machine() -> None:
    """Touches that scattered exactly as stated, none missed: the sentence sent a person to look for scatter and for misses."""
    assert "Nothing is wrong with the machine" in why_short(0, 1.2, 20) and "No touch missed" in why_short(0, 1.2, 20)
    assert why_short(0, 3.0, 20).startswith("Why: touches scatter 3 times as much as machine.yaml says. ")
    assert why_short(4, 1.0, 20).startswith("Why: touches missed: 4. ") and "scatter" not in why_short(4, 1.0, 20)
    assert all("tango design" in why_short(*case) for case in ((0, 1.0, 9), (2, 1.0, 9), (2, 5.0, 9)))
