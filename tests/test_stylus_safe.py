"""Inputs that would break a stylus are refused with file, line and what to write; all commands leave out the same touches."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from support.trust_parts import run_of

from tango_cnc import plan as planner
from tango_cnc.asked import asked
from tango_cnc.cli import tango
from tango_cnc.files import machine_text, read_cell, read_machine, strategy_text
from tango_cnc.files.normals import inward
from tango_cnc.files.strategy import OBSTRUCTED
from tango_cnc.records import InputError

EXAMPLES = sorted(f.parent for f in (Path(__file__).parents[1] / "examples").glob("*/tango.yaml"))
HU40T = next(f for f in EXAMPLES if f.name == "hu40t")


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    return Path(shutil.copytree(HU40T, tmp_path / "cell"))


def change(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")


def told(command: str, cell: Path, *more: str) -> Result:
    return CliRunner().invoke(tango, [command, "-C", str(cell), *more])


def refused(cell: Path) -> str:
    with pytest.raises(InputError) as caught:
        read_cell(cell)
    return str(caught.value)


def test_a_measuring_feed_is_what_the_probe_stands(cell: Path) -> None:
    change(cell / "machine.yaml", "repeatability: 0.0007", "repeatability: 0.0007, max_feed: 150")
    assert "strategy.yaml:2: approach.feed: found 180; allowed: at most 150 mm/min (machine.yaml: probe.max_feed)" in refused(cell)
    change(cell / "strategy.yaml", "feed: 180.0", "feed: 100.0, find: {feed: 1500, retreat: 6}")
    assert "approach.find.feed: found 1500; allowed: at most 150 mm/min" in refused(cell)


def test_a_probe_that_stands_more_is_written_and_read_again(cell: Path) -> None:
    change(cell / "machine.yaml", "repeatability: 0.0007", "repeatability: 0.0007, max_feed: 5000")
    change(cell / "strategy.yaml", "feed: 180.0", "feed: 4000.0")
    machine = read_cell(cell).machine
    (cell / "machine.yaml").write_text(machine_text(machine), encoding="utf-8")
    assert read_machine(cell / "machine.yaml") == machine


def test_positioning_is_not_faster_than_the_machine(cell: Path) -> None:
    change(cell / "tango.yaml", "  post:", "  positioning_feed: 30000\n  post:")
    text = refused(cell)
    assert "controller.positioning_feed: found '30000'; allowed: at most 24000 mm/min, the rapid of X in machine.yaml" in text


@pytest.mark.parametrize(
    ("written", "meant"),
    [("0.5236", "30"), ("0.524", "30"), ("-1.570796", "-90"), ("1.57", "90"), ("3.14159", "180"), ("0.0175", "")],
)
def test_radians_are_noticed(written: str, meant: str, cell: Path) -> None:
    change(cell / "strategy.yaml", "- B: 30.0", f"- B: {written}")
    if not meant:  # one degree in four digits may as well be meant
        read_cell(cell)
        return
    text = refused(cell)
    assert f"strategy.yaml:4: indexations[0].B: found '{written}'" in text
    assert f"This is {meant}° in radians: write {meant};" in text


@pytest.mark.parametrize("degrees", ["1", "1.5", "1.6", "0.25", "2.25", "0", "3.13", "30.5236", "6.1"])
def test_small_angles_stay_degrees(degrees: str, cell: Path) -> None:
    change(cell / "strategy.yaml", "- B: 30.0", f"- B: {degrees}")
    assert read_cell(cell).strategy.indexations[0].position["B"] == pytest.approx(float(degrees) * 0.017453292519943295)


def test_a_travel_in_radians_is_noticed(cell: Path) -> None:
    change(cell / "machine.yaml", "travel: [-95, 95]", "travel: [-1.5708, 1.5708]")
    assert "axes.B.travel[0]: found '-1.5708'" in refused(cell)


@pytest.mark.parametrize("command", ["check", "plan", "simulate", "run"])
def test_a_normal_into_the_table_is_refused(command: str, cell: Path) -> None:
    change(cell / "artefact.yaml", "normal: [1.0, 0.0, 0.0]", "normal: [-1.0, 0.0, 0.0]")
    before = sorted(f.name for f in cell.iterdir())
    result = told(command, cell)
    assert isinstance(result.exception, InputError)
    text = str(result.exception)
    assert "artefact.yaml:37: facets.13.normal: found [-1, 0, 0], which points into the table" in text
    assert text.endswith("allowed: [1, 0, 0], out of the material")
    assert sorted(f.name for f in cell.iterdir()) == before


@pytest.mark.parametrize("folder", EXAMPLES, ids=lambda f: f.name)
def test_no_facet_of_an_example_points_into_its_table(folder: Path) -> None:
    assert not inward(read_cell(folder).artefact)


@pytest.fixture
def facing_away(cell: Path) -> Path:
    """A cell of two indexations; the first also touches facets that face away from the spindle there."""
    change(cell / "strategy.yaml", "facets: [3, 5, 8, 9, 10, 11,", "facets: [3, 5, 6, 13, 8, 9, 10, 11,")
    text = (cell / "strategy.yaml").read_text(encoding="utf-8")
    (cell / "strategy.yaml").write_text("- B:".join(text.split("- B:")[:3]), encoding="utf-8")
    return cell


@pytest.mark.long
def test_what_a_strategy_leaves_out_is_left_out_by_check_plan_and_simulate(facing_away: Path) -> None:
    cell = facing_away
    whole = sum(len(i.facets) for i in read_cell(cell).strategy.indexations)
    change(cell / "strategy.yaml", "approach:", "obstructed: leave-out\napproach:")
    known = read_cell(cell)
    numbers = [t.number for t in planner.plan(known).touches]
    assert len(numbers) < whole
    assert f"{len(numbers)} of {whole} touches" in told("check", cell).output
    result = told("simulate", cell)
    assert result.exit_code == 0, result.output
    with (cell / "simulated.csv").open(encoding="utf-8") as file:
        assert [int(row["touch"]) for row in csv.DictReader(file)] == numbers
    left = run_of(cell / "simulated.csv")  # beside the readings, so that no command takes them for missing
    assert left is not None and asked(known, left).made == set(numbers)
    assert strategy_text(known.strategy).splitlines()[2] == "obstructed: leave-out"


def test_what_a_strategy_refuses_is_refused_by_plan_and_simulate(facing_away: Path) -> None:
    cell = facing_away
    change(cell / "strategy.yaml", "approach:", "obstructed: refuse\napproach:")
    for command in ("plan", "simulate"):
        result = told(command, cell)
        assert isinstance(result.exception, InputError) and "cannot be made with a straight probe" in str(result.exception)
    assert told("plan", cell, "--obstructed", "leave-out", "--dry-run").exit_code == 0
    assert not (cell / "simulated.csv").exists()


def test_every_word_of_obstructed_is_one_that_plan_knows(cell: Path) -> None:
    assert tuple(planner.OBSTRUCTED) == OBSTRUCTED and OBSTRUCTED[0] == planner.USUAL
    change(cell / "strategy.yaml", "approach:", "obstructed: leave_out\napproach:")
    assert "did you mean" in refused(cell).lower()


def test_an_endless_axis_has_a_key_of_its_own(cell: Path) -> None:
    change(cell / "machine.yaml", "travel: [-365, 365]", "endless: true")
    machine = read_cell(cell).machine
    assert machine.axis("C").travel is None
    (cell / "machine.yaml").write_text(machine_text(machine), encoding="utf-8")
    assert read_machine(cell / "machine.yaml") == machine
    assert planner.plan(read_cell(cell)).touches


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("C: {kind: rotary,", "C: {kind: rotary, endless: true,", "either travel or endless: true"),
        ("travel: [-365, 365]", "endless: false", "no key 'travel'"),
        (
            "X: {kind: linear, direction: [1, 0, 0], travel: [-400, 400]",
            "X: {kind: linear, direction: [1, 0, 0], endless: true",
            "key",
        ),
    ],
)
def test_travel_or_endless_and_only_where_an_axis_turns(old: str, new: str, text: str, cell: Path) -> None:
    change(cell / "machine.yaml", old, new)
    assert text in refused(cell)
