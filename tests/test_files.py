"""Files: what is written is read back, and whatever is wrong is said with file, line, key, what was found and what is allowed."""

from __future__ import annotations

import dataclasses
import errno
import math
import os
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from tango_cnc import files
from tango_cnc.cli import guarded, tango
from tango_cnc.files.nightly import read_nightly
from tango_cnc.records import (
    Approach,
    Artefact,
    Axis,
    Ball,
    Facet,
    Indexation,
    InputError,
    Machine,
    Obstacle,
    Probe,
    Readings,
    ScaleBar,
    Strategy,
    Surface,
    World,
)

CELL = {
    "tango.yaml": """\
tango: 1
machine: machine.yaml
artefact: artefact.yaml
strategy: strategy.yaml
terms: [S2]
controller: {post: fanuc, port: "socket://127.0.0.1:8193"}
""",
    "machine.yaml": """\
name: small
topology: wCBXfZY(S)t
axes:
  X: {kind: linear, direction: [1, 0, 0], travel: [-400, 400]}
  Y: {kind: linear, direction: [0, 1, 0], travel: [-350, 350]}
  Z: {kind: linear, direction: [0, 0, 1], travel: [-100, 800]}
  B: {kind: rotary, direction: [0, 1, 0], point: [0, 0, 0], travel: [-95, 95], rapid: 3600, clamp_time: 1.5}
  C: {kind: rotary, direction: [0, 0, 1], point: [0, 0, 0], travel: [-365, 365]}
  S: {kind: spindle, direction: [0, 0, 1], point: [0, 0, 0]}
probe: {length: 326.674, tip_radius: 3.0, repeatability: 0.0007}
""",
    "artefact.yaml": """\
name: cube
facets:
  1: {point: [100, 0, 0], normal: [1, 0, 0]}
  2: {point: [0, 100, 0], normal: [0, 1, 0]}
  top: {point: [0, 0, 20], normal: [0, 0, 1], uncertainty: 0.0005}
  11: {point: [50, 0, 72.7], normal: [0, 0, 1], ball: 1}
balls:
  1: {centre: [50, 0, 60], radius: 12.7}
  2: {centre: [-50, 0, 60], radius: 12.7}
scale_bar: {balls: [1, 2], length: 100.001, uncertainty: 0.0005}
""",
    "strategy.yaml": """\
name: two indexations
approach: {standoff: 10, search: 5, feed: 180}
indexations:
  - {S: 0, B: 0, C: 0, facets: [1, 2, top, 11]}
  - {B: 30, C: -90, facets: [top, 1]}
""",
    "world.yaml": """\
errors: {EX0C: -0.108}
stylus: {EXt: 0.01}
facets: {1: 0.02}
noise: 0.0006
effects: [{cause: thermal_drift, amplitude: 0.01, tau: 2400, direction: [0, 1, 0]}]
seed: 7
""",
    "readings.csv": """\
touch,time_s,facet,X,Y,Z,B,C,S,dX,dY,dZ,dB,dC,dS,status,cycle,day,feed
1,0.0,1,103,0,326,0,0,0,-1,0,0,0,0,0,ok,1,1,180
2,9.5,2,0,103,326,0,0,0,0,-1,0,0,0,0,ok,1,1,180
3,19.0,top,0,0,349.674,0,0,0,0,0,-1,0,0,0,ok,1,1,180
""",
}


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    for name, text in CELL.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def contents(folder: Path) -> dict[str, bytes]:
    return {str(f.relative_to(folder)): f.read_bytes() for f in sorted(folder.rglob("*")) if f.is_file()}


# Each case: in this file, instead of this text, that text stands; the complaint names that line, that key and these words.
BAD_CELLS = {
    "misspelt key": ("machine.yaml", "tip_radius", "tip_radios", 10, "probe.tip_radios", "Did you mean 'tip_radius'"),
    "key of nobody": ("tango.yaml", "terms: [S2]", "colour: red", 5, "colour", "the unknown key 'colour'"),
    "missing key": ("machine.yaml", ", travel: [-350, 350]", "", 5, "axes.Y", "no key 'travel'"),
    "missing axis": ("machine.yaml", CELL["machine.yaml"].splitlines()[7] + "\n", "", 4, "axes", "no key 'C'"),
    "same key twice": ("artefact.yaml", "  2: {point: [0, 100, 0]", "  1: {point: [0, 100, 0]", 4, "facets.1", "twice"),
    "blank at the end of a name": ("artefact.yaml", "  2: {point: [0, 100, 0]", "  '2 ': {point: [0, 100, 0]", 4, "facets.2 ", "found '2 '; allowed: a name of characters that are seen, without a blank"),
    "letters that nobody sees in a name": ("artefact.yaml", "  2: {point: [0, 100, 0]", '  "2\\u202e": {point: [0, 100, 0]', 4, "facets.2", "\\u202e'; allowed: a name of characters that are seen"),
    "text that turns what is behind it": ("machine.yaml", "name: small", 'name: "small \\u202e4711"', 1, "name", "the character U+202E"),
    "text for a number": ("machine.yaml", "length: 326.674", "length: long", 10, "probe.length", "'long'; allowed: a finite"),
    "number in quotes": ("machine.yaml", "length: 326.674", "length: '326.674'", 10, "probe.length", "in quotes; allowed: a finite number"),
    "NaN": ("machine.yaml", "repeatability: 0.0007", "repeatability: .nan", 10, "probe.repeatability", "'.nan'"),
    "infinity": ("artefact.yaml", "[100, 0, 0], normal", "[1e999, 0, 0], normal", 3, "facets.1.point[0]", "a finite number"),
    "a radius of zero": ("artefact.yaml", "60], radius: 12.7", "60], radius: 0", 8, "balls.1.radius", "greater than 0"),
    "feed with exponent": ("strategy.yaml", "feed: 180", "feed: 1e9", 2, "approach.feed", "at least 0.1 and at most 100000"),
    "stand-off on the facet": ("strategy.yaml", "standoff: 10", "standoff: 0.5", 2, "approach.standoff", "at least 2: there the probe"),
    "search without way": ("strategy.yaml", "search: 5", "search: 0.02", 2, "approach.search", "at least 0.1: a contact"),
    "negative search": ("strategy.yaml", "search: 5", "search: -5", 2, "approach.search", "greater than 0"),
    "number for a list": ("artefact.yaml", "point: [0, 100, 0]", "point: 100", 4, "facets.2.point", "a list of 3 values"),
    "two coordinates": ("artefact.yaml", "point: [0, 100, 0]", "point: [0, 100]", 4, "facets.2.point", "2 values; allowed"),
    "list for a mapping": ("tango.yaml", CELL["tango.yaml"].split("controller: ")[1], "[fanuc]", 6, "controller", "a mapping"),
    "nothing": ("machine.yaml", "name: small", "name:", 1, "name", "found nothing; allowed: a text"),
    "normal not of unit length": ("artefact.yaml", "[1, 0, 0]}", "[1, 0.1, 0]}", 3, "facets.1.normal", "of length 1.00499"),
    "direction not of unit length": ("machine.yaml", "[0, 1, 0], t", "[0, 2, 0], t", 5, "axes.Y.direction", "of length 2"),
    "facet of nobody": ("strategy.yaml", "[top, 1]", "[tap, 1]", 5, "indexations[1].facets[0]", "11). Did you mean 'top'"),
    "ball that nobody defines": ("artefact.yaml", "ball: 1", "ball: 3", 6, "facets.11.ball", "a ball of this file (1, 2)"),
    "bar from a ball to itself": ("artefact.yaml", "balls: [1, 2]", "balls: [1, 1]", 10, "scale_bar.balls", "ball 1 twice; allowed: two different"),
    "axis that the machine lacks": ("strategy.yaml", "{B: 30, C", "{B: 30, A: 0, C", 5, "indexations[1].A", "B, C, facets, S"),
    "indexation without C": ("strategy.yaml", "{B: 30, C: -90", "{B: 30", 5, "indexations[1]", "no key 'C'"),
    "indexation without facets": ("strategy.yaml", "[top, 1]", "[]", 5, "indexations[1].facets", "at least one facet"),
    "no indexation": ("strategy.yaml", CELL["strategy.yaml"].split("ions:")[1], " []", 3, "indexations", "at least one"),
    "topology": ("machine.yaml", "wCBXfZY(S)t", "wCBXfZY(S)", 2, "topology", "e.g. wCBXfZY(S)t"),
    "three rotary axes": ("machine.yaml", "wCBXfZY(S)t", "wCBXfAZY(S)t", 2, "topology", "up to two of A B C"),
    "kind of axis": ("machine.yaml", "X: {kind: linear", "X: {kind: linaer", 4, "axes.X.kind", "Did you mean 'linear'"),
    "rapid in rpm": ("machine.yaml", "rapid: 3600", "rapid: 30", 7, "axes.B.rapid", "If rpm were meant, write 10800"),
    "travel in radians": ("machine.yaml", "travel: [-95, 95]", "travel: [-1.92, 0.52]", 7, "axes.B.travel", "[-110, 29.79] deg would be meant"),
    "rapid in m/min": ("machine.yaml", "travel: [-350, 350]", "travel: [-350, 350], rapid: 30", 5, "axes.Y.rapid", "If m/min were meant, write 30000"),
    "travel upside down": ("machine.yaml", "travel: [-95, 95]", "travel: [95, -95]", 7, "axes.B.travel", "low below high"),
    "version of the format": ("tango.yaml", "tango: 1", "tango: 2", 1, "tango", "1, the version of the format"),
    "facet off its ball": ("artefact.yaml", "[50, 0, 72.7]", "[95, 0, 60]", 6, "facets.11", "a point 32.3 mm off the surface of ball 1 (45 mm from its centre, radius 12.7); allowed: within 2 mm"),
    "facet on the other ball": ("artefact.yaml", "[50, 0, 72.7]", "[-50, 0, 72.7]", 6, "facets.11", "Correct point, centre, radius or the ball's number: it lies on ball 2"),
    "normal into the ball": ("artefact.yaml", "[0, 0, 1], ball", "[0, 0, -1], ball", 6, "facets.11.normal", "180° from the direction out of the centre of ball 1; allowed: within 10°"),
    "bar of another length": ("artefact.yaml", "length: 100.001", "length: 110", 10, "scale_bar.length", "110, but the centres of balls 1 and 2 are 100 mm apart; allowed: within 4 mm"),
    "point beyond any machine": ("artefact.yaml", "[100, 0, 0], normal", "[1e18, 0, 0], normal", 3, "facets.1.point[0]", "at least -100000 and at most 100000"),
    "travel beyond any machine": ("machine.yaml", "[-350, 350]", "[-1e17, 1e17]", 5, "axes.Y.travel[0]", "at least -100000 and at most 100000"),
    "tip as large as a town": ("machine.yaml", "tip_radius: 3.0", "tip_radius: 1e6", 10, "probe.tip_radius", "at most 100000"),
    "rapid of light": ("machine.yaml", "rapid: 3600", "rapid: 1e12", 7, "axes.B.rapid", "at least 0.1 and at most 1000000"),
    "stand-off of a kilometre": ("strategy.yaml", "standoff: 10", "standoff: 1e9", 2, "approach.standoff", "at most 1000"),
    "search of a kilometre": ("strategy.yaml", "search: 5", "search: 1e6", 2, "approach.search", "at most 1000"),
    "a turn without end": ("strategy.yaml", "C: -90", "C: -1e12", 5, "indexations[1].C", "at most 100000"),
    "terms": ("tango.yaml", "[S2]", "3.5", 5, "terms", "S1, S2, S3, S4 or a list"),
    "subset that is none": ("tango.yaml", "terms: [S2]", "terms: S33", 5, "terms", "or a list of them, of coefficients (EYX2) and causes (thermal_drift). Did you mean 'S3'?"),
    "controller without post": ("tango.yaml", "post: fanuc, ", "", 6, "controller", "no key 'post'"),
    "decimal comma": ("artefact.yaml", "[100, 0, 0], normal", "[100, 0,5, 0], normal", 3, "facets.1.point", "a list of 3 values; a decimal has a point, no comma"),
    "not YAML": ("strategy.yaml", "facets: [top, 1]}", "facets: [top, 1}", 5, "", "not valid YAML"),
    "tab": ("tango.yaml", "machine: machine.yaml", "machine:\n\tx: 1", 3, "", "YAML allows no tabs: write blanks in their place"),
    "error that no machine has": ("world.yaml", "EX0C", "EX0Q", 1, "errors", "found 'EX0Q'; allowed"),
    "noise beyond any machine": ("world.yaml", "noise: 0.0006", "noise: 1e300", 4, "noise", "at least 0 and at most 100000"),
    "error beyond any machine": ("world.yaml", "EX0C: -0.108", "EX0C: 1e18", 1, "errors.EX0C", "at most 100000"),
    "stylus in capitals": ("world.yaml", "EXt", "EXT", 2, "stylus", "Did you mean 'EXt'"),
    "effect that nobody knows": ("world.yaml", "thermal_", "termal_", 5, "effects[0].cause", "Did you mean 'thermal_drift'"),
    "effect with a misspelt key": ("world.yaml", "tau:", "tao:", 5, "effects[0]", "the unknown key 'tao'"),
    "effect without cause": ("world.yaml", "cause: thermal_drift, ", "", 5, "effects[0]", "no cause"),
    "stylus offset of nobody": ("world.yaml", "EXt", "EXs", 2, "stylus", "EXt, EYt, EZt"),
    "seed that is no whole number": ("world.yaml", "seed: 7", "seed: 7.5", 6, "seed", "a whole number"),
    "term that no machine has": ("tango.yaml", "[S2]", "[S2, EYX22]", 5, "terms", "found 'EYX22'"),
    "facet offset of nobody": ("world.yaml", "facets: {1:", "facets: {one:", 3, "facets", "found 'one'; allowed: facets of artefact"),
}  # fmt: skip


@pytest.mark.few(6)
@pytest.mark.parametrize("case", BAD_CELLS)
def test_bad_cell_is_refused_in_words_and_nothing_is_written(case: str, cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name, old, new, line, key, words = BAD_CELLS[case]
    text = CELL[name]
    assert text.count(old) >= 1
    (cell / name).write_text(text.replace(old, new, 1), encoding="utf-8")
    command = "estimate" if key == "terms" else "simulate"
    refused([command, "-C", str(cell)], cell, [f"{name}:{line}:" if line else "", key, words], capsys)


BAD_READINGS = {
    "NaN": ("103,0,326", "nan,0,326", 2, "X", "'nan'; allowed: a finite number"),
    "empty value": ("103,0,326", ",0,326", 2, "X", "''; allowed: a finite number"),
    "place beyond any machine": ("0,103,326", "0,1e18,326", 3, "Y", "'1e18'; allowed: a position of at most 100000 mm or degrees"),
    "text": ("9.5", "soon", 3, "time_s", "'soon'"),
    "facet that nobody defines": (
        "19.0,top",
        "19.0,tip",
        4,
        "facet",
        "'tip'; allowed: a facet of artefact 'cube'. Did you mean 'top'",
    ),
    "status": ("-1,0,0,0,ok", "-1,0,0,0,okay", 4, "status", "'okay'; allowed: ok, miss, early"),
    "direction": ("0,0,0,-1,0,0", "0,0,0,-2,0,0", 2, "dX", "-2.0; allowed: -1, 0 or 1"),
    "half a touch": ("\n3,", "\n3.5,", 4, "touch", "a whole number"),
    "short row": (",1,1,180\n2", ",1\n2", 2, "", "found 17 values; allowed: 19 values, as many as the header names"),
    "no column": ("touch,time_s", "touch,time", 1, "header", "no column 'time_s'"),
    "column of nobody": (",feed\n", ",fed\n", 1, "header", "the unknown column 'fed'; allowed"),
    "column twice": (",dX,", ",X,", 1, "header", "the column 'X' twice"),
    "header only": (CELL["readings.csv"].split("\n", 1)[1], "", 2, "", "no rows under the header"),
    "empty file": (CELL["readings.csv"], "", None, "readings.csv", "the file is empty"),
}


@pytest.mark.parametrize("case", BAD_READINGS)
def test_bad_readings_are_refused_in_words_and_nothing_is_written(
    case: str, cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new, line, key, words = BAD_READINGS[case]
    assert old in CELL["readings.csv"]
    (cell / "readings.csv").write_text(CELL["readings.csv"].replace(old, new, 1), encoding="utf-8")
    command = ["estimate", "-C", str(cell), "--json", str(cell / "estimate.json")]
    refused(command, cell, [f"readings.csv:{line}:" if line else "", key, words], capsys)


@pytest.mark.few(8)
@pytest.mark.parametrize("name", ["tango.yaml", "machine.yaml", "artefact.yaml", "strategy.yaml", "world.yaml", "readings.csv"])
@pytest.mark.parametrize("damage", ["absent", "empty", "binary", "folder"])
def test_damaged_file_is_named(name: str, damage: str, cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = cell / name
    file.unlink()
    if damage == "empty":
        file.touch()
    elif damage == "binary":
        file.write_bytes(b"\xff\xfe\x00\x81")
    elif damage == "folder":
        file.mkdir()
    words = {"absent": "no such file", "empty": "empty", "binary": "not UTF-8", "folder": "cannot be read"}[damage]
    command = ["estimate"] if name == "readings.csv" else ["simulate"]
    refused([*command, "-C", str(cell)], cell, [name, words], capsys)


def test_the_journal_of_a_run_that_was_broken_off_is_named(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (cell / "readings.csv").unlink()
    (cell / "readings.journal").touch()
    words = ["readings.csv", "no such file", "readings.journal", "--resume", "salvage"]
    refused(["estimate", "-C", str(cell)], cell, words, capsys)


def refused(command: list[str], folder: Path, words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    before = contents(folder)
    status = guarded(tango.main, command, standalone_mode=False)
    out, err = capsys.readouterr()
    assert (status, out) == (2, "")
    assert err.startswith("tango: ") and "Traceback" not in err
    for word in words:
        assert word in err
    assert contents(folder) == before


def test_good_cell_is_read(cell: Path) -> None:
    found = files.read_cell(cell)
    assert found.machine.workpiece_branch == ("X", "B", "C")
    assert found.machine.tool_branch == ("Z", "Y", "S")
    assert found.machine.axis("B").travel == pytest.approx((math.radians(-95), math.radians(95)))
    assert found.terms == ("S2",)
    assert found.strategy.indexations[1].position == pytest.approx({"B": math.radians(30), "C": math.radians(-90), "S": 0.0})
    assert found.artefact.facets["11"].ball == "1"


def test_all_mistakes_of_a_cell_are_said_at_once(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mistakes = {  # file: what is written in place of what, and what is said of it
        "tango.yaml": [("terms: [S2]", "terms: [s2]", "terms: found 's2'; allowed: S1, S2, S3, S4, or a list")],
        "machine.yaml": [
            ("travel: [-400, 400]", "travel: [400, -400]", "axes.X.travel: found [400, -400]"),
            ("Y: {kind: linear, direction", "Y: {kind: linear, direktion", "axes.Y.direktion: found the unknown key 'direktion'"),
            ("rapid: 3600", "rapid: 30", "axes.B.rapid: found 30"),
            ("tip_radius: 3.0", 'tip_radius: "3.0"', "probe.tip_radius: found the text '3.0' in quotes"),
        ],
        "artefact.yaml": [
            ("normal: [0, 1, 0]", "normal: [0, 2, 0]", "facets.2.normal: found [0, 2, 0], of length 2"),
            ("  top:", "  1:", "facets.1: found the same key twice"),
        ],
    }
    for name, changes in mistakes.items():
        text = CELL[name]
        for old, new, _ in changes:
            assert old in text
            text = text.replace(old, new, 1)
        (cell / name).write_text(text, encoding="utf-8")
    said = [words for changes in mistakes.values() for *_, words in changes]
    refused(["check", "-C", str(cell)], cell, said, capsys)
    guarded(tango.main, ["check", "-C", str(cell)], standalone_mode=False)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == f"tango: {len(said)} mistakes:" and len(lines) == 1 + len(said)  # and nothing that only follows from one


def test_the_strategy_of_another_machine_is_one_mistake(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = CELL["strategy.yaml"].replace("B:", "A:").replace("[top, 1]", "[37, 38]")
    (cell / "strategy.yaml").write_text(other, encoding="utf-8")
    refused(["check", "-C", str(cell)], cell, ["indexations: found A, ", "Is it the strategy of another machine or table?"], capsys)
    assert "mistakes" not in str(capsys.readouterr())


@pytest.mark.parametrize("arguments", [["check", "-C"], ["nightly", "--status", "-C"]])
def test_a_cell_is_a_folder_that_exists(arguments: list[str], cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refused([*arguments, str(cell / "machine.yaml")], cell, ["machine.yaml: found a file; allowed: the folder of the cell"], capsys)
    refused([*arguments, str(cell / "nobody")], cell, ["no such file; give the folder of the cell with -C"], capsys)


def test_all_mistakes_of_nightly_yaml_are_said_at_once(cell: Path) -> None:
    text = "owner: Ann\ncheck_minutes: 3min\nlimits: {volume: -40}\ntemprature: [18, 26]\n"
    (cell / "nightly.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as raised:
        read_nightly(cell)
    said = str(raised.value)
    wanted = (
        "check_minutes: found '3min'",
        "limits.volume: found '-40'",
        "Did you mean 'temperature'",
        "'nightly: 1', the version",
    )
    assert said.startswith("4 mistakes:") and [w for w in wanted if w not in said] == []


def test_of_very_many_mistakes_the_first_are_said(cell: Path) -> None:
    wrong = "\n".join(f"  {i}: {{point: [{i}, 0], normal: [1, 0, 0]}}" for i in range(100, 130))
    (cell / "artefact.yaml").write_text(f"name: many\nfacets:\n{wrong}\n", encoding="utf-8")
    with pytest.raises(InputError) as raised:
        files.read_artefact(cell / "artefact.yaml")
    lines = str(raised.value).splitlines()
    assert (lines[0], len(lines), lines[-1]) == ("30 mistakes:", 22, "  … and 10 more")


def test_the_examples_in_the_documentation_are_read(root: Path, tmp_path: Path) -> None:
    blocks = re.findall(r"```yaml\n(.*?)```", (root / "docs" / "formats.md").read_text(encoding="utf-8"), re.DOTALL)
    for name, text in zip(["tango", "machine", "artefact", "strategy", "world"], blocks, strict=True):
        (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")
    trimesh.creation.box().export(tmp_path / "fixture.stl")
    cell = files.read_cell(tmp_path)
    assert cell.controller is not None and cell.artefact.facets["30"].surface is not None and len(cell.artefact.obstacles) == 3
    assert files.read_world(tmp_path / "world.yaml").effects[0]["tau"] == 2400


def test_missing_direction_columns_follow_from_the_positions(cell: Path) -> None:
    found = files.read_cell(cell)
    file = cell / "bare.csv"
    file.write_text(
        "time_s,touch,status,facet,C,B,Z,Y,X\n0,1,ok,1,0,0,5,0,0\n1,2,ok,1,0,0,4,0,0\n2,3,ok,2,90,0,4,0,0\n", encoding="utf-8"
    )
    readings = files.read_readings(file, found.machine, found.artefact)
    assert readings.direction.tolist() == [[0, 0, 0, 0, 0, 0], [0, 0, -1, 0, 0, 0], [0, 0, -1, 0, 1, 0]]
    assert readings.position[2, 4] == pytest.approx(math.pi / 2)


def test_interrupted_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "readings.csv"
    files.write_text(file, "old")

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match=r"No space.*readings\.csv"):  # a full disk itself names no file
        files.write_text(file, "new")
    assert contents(tmp_path) == {"readings.csv": b"old"}


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EIO, errno.EROFS])
def test_what_cannot_be_written_is_a_sentence(error: int, capsys: pytest.CaptureFixture[str]) -> None:
    def writes() -> None:
        raise OSError(error, os.strerror(error))

    assert guarded(writes) == 2
    assert f"tango: {os.strerror(error)}: not everything could be written; make room" in capsys.readouterr().err


def test_an_error_of_the_system_that_no_write_makes_is_not_hidden() -> None:
    def connects() -> None:
        raise OSError(errno.ECONNREFUSED, "Connection refused")

    with pytest.raises(OSError, match="refused"):
        guarded(connects)


# Round trips. Numbers are of a size that a machine has; texts are anything that is printed on one line.
numbers = st.floats(-1e4, 1e4).map(lambda v: round(v, 9) + 0.0)
positive = st.floats(1e-4, 1e4).map(lambda v: round(v, 9))
texts = st.text(st.characters(exclude_categories=["Z", "C"]), min_size=1, max_size=12)
vectors = st.tuples(numbers, numbers, numbers)


def is_no_round_angle_in_radians(degrees: float) -> bool:
    """3.141593 degrees are refused in files: they look like 180 degrees in radians."""
    return abs(degrees - math.radians(round(math.degrees(degrees)))) > 1e-4 or abs(degrees) < 1e-4


@st.composite
def directions(draw: st.DrawFn) -> tuple[float, float, float]:
    v = np.array(draw(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)))
    x, y, z = v / np.linalg.norm(v)
    return float(x), float(y), float(z)


@st.composite
def machines(draw: st.DrawFn) -> Machine:
    letters = draw(st.permutations([*"XYZ", *draw(st.sampled_from(["", "A", "B", "C", "AB", "AC", "BC"]))]))
    split = draw(st.integers(0, len(letters)))
    names = [*"XYZ", *sorted(set(letters) - set("XYZ")), "S"]
    axes = []
    for name in names:
        kind = "linear" if name in "XYZ" else "spindle" if name == "S" else "rotary"
        scale = 1.0 if kind == "linear" else math.pi / 180
        low, size = draw(numbers), draw(positive)
        slow = 100 if kind == "linear" else 60
        if kind == "rotary" and max(abs(low), abs(low + size)) < 7:
            low -= 14  # a travel that looks like radians is refused
        axes.append(
            Axis(
                name,
                kind,
                draw(directions()),
                draw(vectors),
                None if kind == "spindle" else (low * scale, (low + size) * scale),
                draw(st.none() | st.floats(slow, 1e5).map(lambda v, scale=scale: v * scale)),
                draw(st.none() | st.floats(0.01, 1e3)),
                draw(st.just(0.0) | st.floats(1e-4, 1e3)),
            )
        )
    topology = f"w{''.join(letters[:split])}f{''.join(letters[split:])}(S)t"
    length, radius, *stem = (draw(positive) for _ in range(5))
    probe = Probe(length, radius, draw(st.floats(1e-4, 0.1)), *stem)
    return Machine(draw(texts), topology, tuple(axes), tuple(reversed(letters[:split])), (*letters[split:], "S"), probe)


@st.composite
def artefacts(draw: st.DrawFn) -> Artefact:
    keys = draw(st.lists(texts | st.integers(0, 999).map(str), min_size=2, max_size=2, unique=True))
    balls = {key: Ball(key, draw(vectors), draw(positive)) for key in keys}
    cylinder = st.builds(Surface, st.just("cylinder"), positive, directions(), st.booleans())
    sphere = st.builds(Surface, st.just("sphere"), positive, st.none(), st.booleans())
    facets = {}
    for key in draw(st.lists(texts | st.integers(0, 999).map(str), min_size=1, max_size=5, unique=True)):
        ball, surface = draw(st.tuples(st.none() | st.sampled_from(keys), st.none()) | st.tuples(st.none(), cylinder | sphere))
        point, normal = draw(vectors), draw(directions())
        if ball is not None:  # on its surface, as near as a table is known by hand
            radius = balls[ball].radius + draw(st.floats(-0.9, 0.9)) * min(1.0, balls[ball].radius)
            x, y, z = np.array(balls[ball].centre) + radius * np.array(normal)
            point = (float(x), float(y), float(z))
        facets[key] = Facet(key, point, normal, ball, draw(st.none() | positive), surface)
    box = st.builds(Obstacle, st.just("box"), low=vectors, high=vectors)
    rod = st.builds(Obstacle, st.just("cylinder"), base=vectors, axis=directions(), radius=positive, height=positive)
    apart = math.dist(*(balls[key].centre for key in keys))
    bar = st.builds(ScaleBar, st.just((keys[0], keys[1])), st.floats(max(apart - 3.9, 1e-4), apart + 3.9), positive)
    return Artefact(draw(texts), facets, balls, draw(st.none() | bar), tuple(draw(st.lists(box | rod, max_size=2))))


@st.composite
def cells(draw: st.DrawFn) -> tuple[Machine, Artefact, Strategy]:
    machine, artefact = draw(machines()), draw(artefacts())
    angles = st.floats(-360, 360).filter(is_no_round_angle_in_radians).map(lambda v: math.radians(round(v, 6)))
    order = st.lists(st.sampled_from(list(artefact.facets)), min_size=1, max_size=4).map(tuple)
    positions = st.fixed_dictionaries({name: angles for name in (*machine.rotary, "S")})
    indexations = draw(st.lists(st.builds(Indexation, positions, order), min_size=1, max_size=4))
    return (
        machine,
        artefact,
        Strategy(
            draw(texts), draw(st.builds(Approach, st.floats(2, 1e3), st.floats(0.1, 1e3), st.floats(0.1, 3e3))), tuple(indexations)
        ),
    )


def same(a: object, b: object) -> bool:
    """Equal but for the last digits that degrees, and normals that are normalised again, cost."""
    if isinstance(a, float) and isinstance(b, float):
        return math.isclose(a, b, rel_tol=1e-12, abs_tol=1e-11)
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, dict) and isinstance(b, dict):
        return set(a) == set(b) and all(same(a[key], b[key]) for key in a)
    if isinstance(a, tuple | list) and isinstance(b, tuple | list):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return a == b


@pytest.mark.long
@settings(max_examples=30)
@given(cells())
def test_cell_round_trip(tmp_path_factory: pytest.TempPathFactory, cell: tuple[Machine, Artefact, Strategy]) -> None:
    machine, artefact, strategy = cell
    folder = tmp_path_factory.getbasetemp()
    for name, text in (
        ("machine", files.machine_text(machine)),
        ("artefact", files.artefact_text(artefact)),
        ("strategy", files.strategy_text(strategy)),
    ):
        (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
    assert same(files.read_machine(folder / "machine.yaml"), machine)
    read = files.read_artefact(folder / "artefact.yaml")
    assert same(read, artefact) and list(read.facets) == list(artefact.facets)
    assert same(files.read_strategy(folder / "strategy.yaml", machine, artefact), strategy)


names = st.sampled_from(["EX0C", "EYY1", "EBBb", "EAX0"])
effects = st.fixed_dictionaries({"cause": texts, "amplitude": numbers, "direction": st.lists(numbers, min_size=3, max_size=3)})
worlds = st.builds(
    World,
    st.dictionaries(names, st.floats(-1, 1)),
    st.dictionaries(st.sampled_from(["EXt", "EYt", "EZt"]), numbers),
    st.dictionaries(texts | st.integers(0, 99).map(str), numbers),
    st.floats(0, 1),
    st.lists(effects, max_size=2).map(tuple),
    st.integers(0, 2**31),
)


@pytest.mark.long
@given(worlds)
def test_world_round_trip(tmp_path_factory: pytest.TempPathFactory, world: World) -> None:
    file = tmp_path_factory.getbasetemp() / "world.yaml"
    file.write_text(files.world_text(world), encoding="utf-8")
    assert same(files.read_world(file), world)


@st.composite
def measured(draw: st.DrawFn) -> tuple[Machine, Artefact, Readings]:
    machine, artefact = draw(machines()), draw(artefacts())
    n, k = draw(st.integers(1, 5)), len(machine.names)

    def column(values: st.SearchStrategy[float]) -> np.ndarray:
        return np.array(draw(st.lists(values, min_size=n, max_size=n)))

    position = np.column_stack([column(numbers.map(lambda v: round(v, 6))) for _ in range(k)]) * files.degrees_of(machine)
    return (
        machine,
        artefact,
        Readings(
            machine.names,
            column(st.integers(1, 10**6)),
            column(st.floats(0, 1e6).map(lambda v: round(v, 3))),
            tuple(draw(st.lists(st.sampled_from(list(artefact.facets)), min_size=n, max_size=n))),
            position,
            np.column_stack([column(st.sampled_from([-1.0, 1.0])) for _ in range(k)]),
            tuple(draw(st.lists(st.sampled_from(["ok", "miss", "early"]), min_size=n, max_size=n))),
            column(st.integers(1, 99)),
            column(st.integers(1, 99)),
            draw(st.none() | st.builds(lambda v: np.full(n, v), st.integers(1, 999).map(float))),
            draw(st.dictionaries(texts, st.builds(lambda v: np.full(n, v), st.integers(-40, 90).map(float)), max_size=2)),
        ),
    )


@pytest.mark.long
@settings(max_examples=30)
@given(measured(), st.sampled_from([6, None]))
def test_readings_round_trip(
    tmp_path_factory: pytest.TempPathFactory, made: tuple[Machine, Artefact, Readings], decimals: int | None
) -> None:
    machine, artefact, readings = made
    file = tmp_path_factory.getbasetemp() / "readings.csv"
    file.write_text(files.readings_text(readings, decimals), encoding="utf-8")
    found = files.read_readings(file, machine, artefact)
    for field in dataclasses.fields(Readings):
        one, other = getattr(found, field.name), getattr(readings, field.name)
        if isinstance(other, np.ndarray):
            np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-8)
        elif field.name == "temperatures":
            assert list(one) == list(other) and all(np.array_equal(one[name], other[name]) for name in other)
        else:
            assert one == other


@pytest.mark.long
@given(st.sampled_from(sorted(CELL)), st.integers(0, 400), st.text(st.characters(exclude_categories=["Cs"]), max_size=6))
def test_whatever_is_typed_into_a_file_it_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, name: str, at: int, typed: str
) -> None:
    folder = tmp_path_factory.getbasetemp()
    for other, text in CELL.items():
        changed = text[: at % len(text)] + typed + text[at % len(text) :] if other == name else text
        (folder / other).write_text(changed, encoding="utf-8")
    try:
        cell = files.read_cell(folder)
        files.read_world(folder / "world.yaml")
        files.read_readings(folder / "readings.csv", cell.machine, cell.artefact)
    except InputError as error:
        assert str(folder) in str(error)


def test_a_file_that_is_no_mapping_is_told_what_was_found_and_what_is_allowed(tmp_path):
    (tmp_path / "tango.yaml").write_text("- 1\n")
    with pytest.raises(InputError, match=r"tango.yaml:1: found a list; allowed: a mapping"):
        files.read_cell(tmp_path)


def test_yaml_that_nobody_has_written_is_refused_before_it_is_read(tmp_path: Path) -> None:
    (tmp_path / "machine.yaml").write_text("- 1\n" * 100_001)
    with pytest.raises(InputError, match="400004 characters of YAML; at most 400000"):
        files.read_machine(tmp_path / "machine.yaml")


@pytest.mark.parametrize(("text", "line"), [("a: 1\n---\nb: 2\n", 2), ("a: 1\nb: *c\n", 2), ("a: [1\nb: 2\n", 2)])
def test_what_is_no_yaml_is_said_with_its_line(tmp_path: Path, text: str, line: int) -> None:
    (tmp_path / "machine.yaml").write_text(text)
    with pytest.raises(InputError, match=f"machine.yaml:{line}: not valid YAML"):
        files.read_machine(tmp_path / "machine.yaml")
