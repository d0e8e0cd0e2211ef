"""What ball bar, R-test and laser should show, against a machine that an independent program wrote out and measured."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from click.testing import CliRunner

from tango_cnc.cli import tango
from tango_cnc.estimate import Estimate
from tango_cnc.files import read_cell
from tango_cnc.instruments import (
    RARE,
    Compared,
    InstrumentReadings,
    Predicted,
    Wanted,
    compare,
    names_of,
    path_of,
    predict,
    read_measured,
)
from tango_cnc.instruments.chance import distance, slip
from tango_cnc.iso230 import ranges
from tango_cnc.records import InputError
from tests.support.instrument_truth import EXAMPLES, machine_and_estimate, predicted, shown
from tests.support.truth import Truth

NOISE = 0.3  # µm, of one reading of an instrument


@cache
def machine(example: str, seed: int) -> tuple[Truth, Estimate]:
    return machine_and_estimate(example, seed)


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["laser-X", "circle-XY", "rotary-C"])
def test_the_interval_of_every_figure_holds_what_the_instrument_shows(name: str) -> None:
    truth, result = machine("hu40t", 5)
    told = predicted(result, name)
    real = shown(truth, told)[1]
    given = [f for f in told.figures if f.value is not None and f.interval is not None]
    assert len(given) >= 3
    for f in given:
        assert f.interval is not None and f.value is not None
        assert f.interval[0] - 1e-3 <= real[f.name] <= f.interval[1] + 1e-3, f.name


@pytest.mark.long
def test_a_large_error_of_location_is_predicted_with_its_size() -> None:
    """C stands 60 µm from where it should: an R-test goes round twice that."""
    truth, result = machine("hu40t", 5)
    told = predicted(result, "rotary-C")
    real = shown(truth, told)[1]
    sizes = [(f.value, real[f.name]) for f in told.figures if f.value is not None and real[f.name] > 20]
    assert sizes, "too small to show anything"
    for value, size in sizes:
        assert value == pytest.approx(size, rel=0.25)


def file_of(truth: Truth, told: Predicted, file: Path, wrong: float = 0.0) -> Path:
    """A CSV file as the instrument's program writes it; `wrong` µm/mm or µm/rad are added."""
    reading, _ = shown(truth, told, NOISE)
    first = "angle_deg" if told.path.turns else "position_mm"
    lines = [",".join([first, "direction", *(f"{c}_um" for c in told.path.channels)])]
    for i, (c, s) in enumerate(zip(told.path.command, told.path.sense, strict=True)):
        at = math.degrees(c) if told.path.turns else c
        values = ",".join(f"{v + wrong * c:.4f}" for v in reading[:, i])
        lines.append(f"{at:.6f},{'+' if s > 0 else '-'},{values}")
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("laser-X", 0.2),
        pytest.param("circle-XY", 20.0, marks=pytest.mark.long),
        pytest.param("rotary-C", 30.0, marks=pytest.mark.long),
    ],
)
def test_a_measured_file_agrees_and_one_of_another_machine_differs(name: str, wrong: float, tmp_path: Path) -> None:
    truth, result = machine("hu40t", 5)
    before, over = predicted(result, name), ranges(result.model.touches)
    wanted, channels = Wanted(name, "rtest", before.path.radius), before.path.channels
    at_file: list[Predicted] = []

    def found(wrong: float) -> Compared:
        own = read_measured(file_of(truth, before, tmp_path / f"{wrong}.csv", wrong), channels, before.path.turns)
        if not at_file:
            path = path_of(result.model.touches.machine, over, wanted, own.command, own.sense)
            at_file.append(predict(result, path))
        return compare(at_file[0], own, 4 * NOISE)

    right, other = found(0.0), found(wrong)
    assert all(f.verdict != "differs" for f in right.figures) and right.inside > 0.9 and not right.far and other.far
    assert any(f.verdict == "agrees" for f in right.figures)
    assert any(f.verdict == "differs" for f in other.figures) and other.rms > 2 * right.rms


@pytest.mark.long
def test_from_a_cell_to_a_prediction_and_a_comparison_on_the_command_line(tmp_path: Path) -> None:
    runner, cell = CliRunner(), tmp_path / "cell"
    assert runner.invoke(tango, ["init", str(cell), "--example", "hu40t"]).exit_code == 0
    assert runner.invoke(tango, ["simulate", "-C", str(cell)]).exit_code == 0
    call = ["predict", "-C", str(cell), "--test", "circle-XY", "--json", "-"]
    data = json.loads(runner.invoke(tango, call).stdout)
    assert data["format"] == "tango-test/1" and len(data["readings"]) == 144
    lines = ["angle_deg;direction;radial_um"]
    lines += [f"{r['angle_deg']:.6f};{r['direction']};{r['um'][0] + 40:.3f}".replace(".", ",") for r in data["readings"]]
    file = tmp_path / "ballbar.csv"
    file.write_text("\n".join(lines), encoding="utf-8")
    done = runner.invoke(tango, [*call, "--measured", str(file)], standalone_mode=False)
    found = json.loads(done.stdout)["compared"]
    by_name = {f["name"]: f for f in found["figures"]}
    assert done.return_value == 1 and by_name["mean radial deviation"]["verdict"] == "differs"
    assert by_name["circular deviation, positive"]["verdict"] == "agrees"
    rad = tmp_path / "rad.csv"
    told = [f"{math.radians(r['angle_deg']):.6f},{r['direction']},{r['um'][0]:.3f}" for r in data["readings"]]
    rad.write_text("\n".join(["angle_deg,direction,radial_um", *told]), encoding="utf-8")
    done = runner.invoke(tango, [*call, "--measured", str(rad), "--instrument-um", "0.5"], standalone_mode=False)
    assert "commands are in rad" in json.loads(done.stdout)["compared"]["slip"] and done.return_value == 1
    for wrong in (["predict"], ["predict", str(file), "--test", "K1"], ["predict", str(file), "--radius", "50"]):
        assert runner.invoke(tango, [*wrong, "-C", str(cell)]).exit_code != 0


def test_a_ball_on_the_axis_of_a_fork_head_is_brought_away_by_tilting_the_head() -> None:
    one = read_cell(EXAMPLES / "fork_head").machine
    over = {"X": (-300.0, 300.0), "Y": (-300.0, 300.0), "Z": (0.0, 400.0), "A": (-1.4, 1.4), "C": (-3.0, 3.0)}
    with pytest.raises(InputError, match=r"tilt A, e\.g\. --at A=45"):
        path_of(one, over, Wanted("rotary-C", "rtest", at={"A": 0.0}))
    there = path_of(one, over, Wanted("rotary-C", "rtest", at={"A": math.pi / 4}))
    assert "mm from C" in there.text


def test_names_that_a_machine_cannot_make_are_refused_with_those_it_can() -> None:
    two_at_table = read_cell(EXAMPLES / "trunnion").machine
    assert {"K1", "BK1", "BK2"} <= set(names_of(two_at_table))
    assert "AK1" in names_of(read_cell(EXAMPLES / "fork_head").machine) or "CK1" in names_of(
        read_cell(EXAMPLES / "fork_head").machine
    )
    over = {n: (-100.0, 100.0) for n in two_at_table.names}
    for wanted in (Wanted("AK1"), Wanted("laser-B"), Wanted("circle-XY", "theodolite")):
        with pytest.raises(InputError, match="allowed"):
            path_of(two_at_table, over, wanted)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "angle_deg,radial_um\n0,1\n",
        "angle_deg,direction,radial_um\n0,sideways,1\n",
        "angle_deg,direction,radial_um\n0,+,much\n",
        "angle_deg,direction,radial_um\n0,+,nan\n",
        "angle_deg,direction,radial_um\n0,+\n",
        "angle_deg,direction,radial_um\n0,+,1\n",
    ],
)
def test_a_file_that_is_none_is_refused_by_name(text: str, tmp_path: Path) -> None:
    file = tmp_path / "ballbar.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"ballbar\.csv"):
        read_measured(file, ("radial",), True)


@pytest.mark.parametrize(("example", "test"), [("hu40t", "rotary-C"), ("trunnion", "rotary-A"), ("fork_head", "rotary-A")])
def test_a_ball_bar_is_told_along_which_way_of_the_table_it_reads_ahead(example: str, test: str) -> None:
    """The way that the tool goes on the table for a positive command, by a second program: against the turn of a turned table."""
    truth, machine = Truth(EXAMPLES / example, 1, size=0.0), read_cell(EXAMPLES / example).machine
    over = {a: (-200.0, 200.0) for a in machine.linear} | {a: (-1.5, 1.5) for a in machine.rotary}
    path = path_of(machine, over, Wanted(test, "ballbar", at={a: 0.0 for a in machine.rotary}))
    place = {a: path.position[int(np.argmin(np.abs(path.command))), i] for i, a in enumerate(machine.names)}
    pose = {a: np.array([v, v + 1e-4 * (a == test[-1])]) for a, v in place.items()}
    tip = truth.tool_in_table(pose, {a: np.zeros(2) for a in pose}, errors=False)[:, :3, 3]
    ahead = (tip[1] - tip[0]) / np.linalg.norm(tip[1] - tip[0])
    printed = [float(v) for v in path.text.partition("tangential is positive along [")[2].partition("]")[0].split(",")]
    assert printed == pytest.approx(ahead.tolist(), abs=0.006)


def test_a_true_file_is_called_different_as_seldom_as_stated_where_one_error_moves_all_readings() -> None:
    """A gain that is known badly is one draw: its rms is twice what is expected in one file of twenty."""
    rng, n, count = np.random.default_rng(5), 40, 2000
    way = np.linspace(-1.0, 1.0, n)
    root = np.column_stack([12.0 * way, 0.5 * np.eye(n)])
    told = cast(Predicted, SimpleNamespace(covariance=root @ root.T, free=np.eye(n), value=np.zeros((1, n))))
    expected = distance(told, 0.0)
    files = rng.normal(size=(count, n + 1)) @ root.T
    called = np.mean([expected.chance(f) < RARE for f in files])
    allowed = np.sqrt(np.mean(np.diag(told.covariance)))
    before = np.mean([np.sqrt(np.mean(f**2)) > 2 * allowed for f in files])
    assert called < 2.2 * RARE < before
    other = files + 5.0 * np.sin(6 * way)  # µm, along what is known well: the badly known gain hides it no longer
    assert np.mean([expected.chance(f) < RARE for f in other]) > 0.95


def test_a_unit_and_a_mirrored_channel_are_named_by_how_much_nearer_they_are() -> None:
    rng, n = np.random.default_rng(6), 36
    shape = np.stack([4 * np.sin(np.linspace(0, 6, n)), 6 * np.cos(np.linspace(0, 9, n))])
    spread = 0.8 * np.eye(2 * n)
    path = SimpleNamespace(channels=("radial", "axial"))
    told = cast(Predicted, SimpleNamespace(covariance=spread, free=np.eye(2 * n), value=shape, path=path))
    expected, read = distance(told, 0.0), shape + 0.8 * rng.normal(size=(2, n))
    assert slip(told, read, expected) == ""
    assert "channel axial looks mirrored" in slip(told, read * [[1.0], [-1.0]], expected)
    assert "channels radial and axial look mirrored" in slip(told, -read, expected)
    assert "in mm" in slip(told, read / 1000, expected)
    assert slip(told, read + 5.0, expected) == ""


@pytest.mark.long
def test_a_unit_and_a_mirrored_channel_are_named() -> None:
    truth, result = machine("hu40t", 5)
    told = predicted(result, "rotary-C")
    reading = shown(truth, told, NOISE)[0]

    def said(read: np.ndarray) -> tuple[str, bool]:
        found = compare(told, InstrumentReadings(told.path.command, told.path.sense, read, 1), 4 * NOISE)
        return found.slip, found.far

    assert said(reading) == ("", False)
    text, far = said(reading / 1000)
    assert "are they in mm?" in text
    for i, name in enumerate(told.path.channels):
        sign = np.ones((3, 1))
        sign[i] = -1.0
        text, far = said(sign * reading)
        assert f"the measured channel {name} looks mirrored" in text and far
