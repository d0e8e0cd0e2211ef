"""Numbers of another machine are named as such: other axes, travels, points, units, pivots elsewhere, another kind of control."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from support.closing import EXAMPLES
from support.commands import run
from support.compensated import ROOT, example, first, text

from tango_cnc.compensate import Proposal, loop, propose, targets
from tango_cnc.compensate.forms import of_another
from tango_cnc.compensate.hidden import Present
from tango_cnc.compensate.whose import of_record
from tango_cnc.records import InputError, TangoError

NOW = "2026-11-01T00:00:00Z"


def given(target: str, numbers: dict[str, float], name: str = "trunnion", settings: tuple[str, ...] = ()) -> Proposal:
    """What is proposed where a person states these numbers of the control."""
    return propose(first(name), target, settings, Present(numbers, {}), poses=64, tcp=True)


def places(target: str, name: str = "trunnion") -> dict[str, float]:
    """Every number that the target stores on this example, as a control has it that corrects nothing."""
    return dict(propose(first(name), target, poses=64).present)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("target", "place", "number", "words"),
    [
        ("siemens", "rotary axis 1 (B), X of its centre", 0.01, "axis B, which the machine 'trunnion' does not have"),
        ("siemens", "CEC B to Z at B 10 deg", 0.001, "axis B, which the machine 'trunnion' does not have"),
        ("siemens", "MD32450 $MA_BACKLASH[0] of B", 0.001, "its axes are X Y Z A C"),
        ("fanuc", "centre of B, X", 0.01, "axis B, which"),
        ("isg_csv", "EXB at B 10 deg", 0.001, "axis B, which"),
        ("isg_csv", "EA0B", 0.00001, "axis B, which"),
        ("centroid", "cnc-b.tab (B) at B 10 deg, moving up", 0.001, "axis B, which"),
        ("fanuc", "pitch X at X 900 mm", 0.001, "a point at X 900 mm, beyond the travel of X, -400 to 400 mm"),
        ("heidenhain", "A.COM A at A 150 deg", 0.001, "beyond the travel of A, -120 to 120 deg"),
        (
            "siemens",
            "ENC_COMP X at X 17.5 mm",
            0.001,
            "1 point at X 17.5 mm, and with this volume and these settings the table has 17",
        ),
        ("siemens", "setting 255 (MRZP X)", 0.01, "a place that haas stores, and not siemens"),
        ("fanuc", "joint_0.comp (X) at X 0 mm, moving up", 0.01, "a place that linuxcnc stores, and not fanuc"),
        ("haas", "$640", 0.01, "a place that grblhal stores, and not haas"),
    ],
)
def test_a_place_of_another_machine_or_control_is_named(target: str, place: str, number: float, words: str) -> None:
    with pytest.raises(InputError) as refused:
        given(target, {place: number})
    said = str(refused.value)
    assert said.startswith("--present: found ") and words in said and "allowed: " in said, said
    assert "read back from the control of the machine 'trunnion'" in said


@pytest.mark.few(1)
@pytest.mark.parametrize("target", targets.names())
def test_a_table_that_counts_increments_or_has_another_unit_is_refused(target: str) -> None:
    """12 where 0.012 mm is meant: a control that counts micrometers. Degrees and inches likewise."""
    proposal = propose(first("trunnion"), target, poses=64)
    tables = [h for h in proposal.held if not (h.tcp and h.kind == "length")]
    if not tables:  # centers alone: another zero is possible there
        assert target in ("haas", "grblhal", "fagor")
        return
    h = tables[0]
    with pytest.raises(InputError) as refused:
        given(target, {h.place: h.number(12.0 if h.kind == "length" else 0.7)})
    said = str(refused.value)
    assert h.place in said and "no machine needs more" in said and "another machine" in said, said
    rows = {other.place: other.number(1e-5) for other in tables if other.table == h.table}
    assert given(target, rows).given


def test_a_direction_of_a_machine_with_an_inclined_axis_is_refused() -> None:
    with pytest.raises(InputError, match=r"V1 \(A\), Z: found 0.707.* 45.*allowed: at most 1 deg"):
        given("siemens", {"V1 (A), Z": 0.7071})


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("name", "target"),
    [(n, t) for n in EXAMPLES for t in ("siemens", "heidenhain", "fanuc", "value_sheet", "fagor") if n != "three_axis_calibrated"],
)
def test_pivots_that_no_zero_brings_together_are_another_machine(name: str, target: str) -> None:
    """One axis 25 mm elsewhere; both 25 mm elsewhere are another zero, which is said."""
    machine = example(name)[0].machine
    try:
        proposal = propose(first(name), target, poses=64)
    except InputError as error:
        assert "allowed: " in str(error)
        return
    centers = [h for h in proposal.held if h.tcp and h.kind == "length"]
    pairs = [(a, b) for a in centers for b in centers if a.place < b.place and a.along == b.along]
    assert centers and (pairs or len(machine.rotary) == 1)
    for a, b in pairs[:1]:
        with pytest.raises(InputError, match=r"another zero moves both alike\. Either these are the numbers of another machine"):
            given(target, {a.place: a.number(25.0), b.place: b.number(0.02)}, name)
        away = given(target, {a.place: a.number(25.0), b.place: b.number(25.02)}, name)
        assert any("taken to be counted from another zero" in doubt for doubt in away.doubts)
        assert "NOTE: --present: " in text(away)
        near = given(target, {a.place: a.number(0.3), b.place: b.number(-0.3)}, name)
        assert not any("another zero" in doubt for doubt in near.doubts)


def test_a_distance_between_axes_counts_from_no_zero() -> None:
    with pytest.raises(InputError, match=r"y-offset: found [-+]52 mm.*it is a distance between axes"):
        given("linuxcnc", {"xyzac-trt-kins.y-offset": 52.0})
    with pytest.raises(InputError, match=r"xyzbc-trt-kins\.x-offset.*allowed: "):
        given("linuxcnc", {"xyzbc-trt-kins.x-offset": 0.01})


@pytest.mark.long
def test_numbers_of_other_increments_and_a_file_that_lacks_some_are_doubts() -> None:
    every = places("fanuc")
    assert not given("fanuc", every).doubts
    some = next(place for place in every if place.startswith("pitch X"))
    finer = given("fanuc", every | {some: 0.00123})
    assert len(finer.doubts) == 1 and "this control stores steps of 0.0001 mm" in finer.doubts[0]
    table = {place: number for place, number in every.items() if place.startswith("pitch X")}
    part = given("fanuc", table)
    assert len(part.doubts) == 1 and f"found {len(table)} of the {len(every)} numbers" in part.doubts[0]


def test_a_record_of_another_machine_is_named() -> None:
    cell, _ = example("trunnion")
    machine = cell.machine
    record = {"machine": "trunnion", "topology": machine.topology, "volume": {"X": [-190.0, 190.0], "A": [-90.0, 90.0]}}
    assert of_record(record, machine, machine) == ""
    longer = replace(machine, axes=tuple(replace(a, travel=(-2.0, 2.0)) if a.name == "A" else a for a in machine.axes))
    elsewhere = replace(machine, axes=tuple(replace(a, point=(0.0, 150.0, 0.0)) if a.name == "A" else a for a in machine.axes))
    along = replace(machine, axes=tuple(replace(a, point=(150.0, 0.0, 0.0)) if a.name == "A" else a for a in machine.axes))
    leaning = replace(machine, axes=tuple(replace(a, direction=(0.0, 0.6, 0.8)) if a.name == "A" else a for a in machine.axes))
    for changed, then, words in (
        ({"machine": "mill 2"}, machine, "for the machine 'mill 2', and the cell is of 'trunnion'"),
        ({"topology": "wCBXfZY(S)t"}, machine, "of the topology wCBXfZY(S)t"),
        ({"volume": {"X": [-1.0, 1.0], "B": [-1.0, 1.0]}}, machine, "with axis B, and"),
        ({"volume": {"X": [-650.0, 650.0]}}, machine, "tables up to X 650 mm, beyond the travel of X"),
        ({}, elsewhere, "the center of A 150 mm from where"),
        ({}, leaning, "the direction of A 90 deg from where"),
    ):
        assert words in of_record({**record, **changed}, machine, then)
    assert of_record(record, machine, along) == "" and of_record(record, longer, machine) == ""


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cells") / "mill"
    shutil.copytree(ROOT / "examples" / "three_axis_calibrated", folder)
    assert run("simulate", "-C", folder).exit_code == 0
    return folder


@pytest.mark.long
def test_the_file_says_of_which_machine_it_is(cell: Path, tmp_path: Path) -> None:
    own, name = tmp_path / "own.yaml", example("three_axis_calibrated")[0].machine.name
    place = next(place for place in places("siemens", "three_axis_calibrated") if place.startswith("MD32450"))
    asked = ("compensate", "-C", cell, "--target", "siemens", "--present", own, "--dry-run")
    for head in ("machine: mill 7\n", "# machine: mill 7\n", "# Machine = mill 7\n"):
        own.write_text(f"{head}{place}: 0.001\n")
        said = str(run(*asked).exception)
        assert f"found numbers of the machine 'mill 7', and the cell is of {name!r}; allowed: " in said
    own.write_text(f"machine: {name}\n{place}: 0.001\n")
    stated = run(*asked)
    assert "does not say of which machine" not in stated.output and "nobody knows whether" in stated.output
    own.write_text(f"{place}: 0.001\n")
    silent = run(*asked)
    assert f"a line 'machine: {name}' would" in silent.output and silent.exit_code == stated.exit_code
    own.write_text(f"machine: {name}\n{place}: 0.00")
    assert "a last line without an end; allowed: a whole file" in str(run(*asked).exception)


@pytest.mark.long
def test_a_folder_of_another_machine_is_no_present_state(cell: Path, tmp_path: Path) -> None:
    """Before it was taken where its tables happened to lie within the travel: what it holds would be taken off here."""
    mine, strange = tmp_path / "mill", tmp_path / "strange"
    shutil.copytree(cell, mine)
    proposal = propose(first("three_axis_calibrated"), "siemens", poses=64)
    loop.store(mine, proposal, NOW, strange)
    asked = ("compensate", "-C", mine, "--target", "siemens", "--present", strange, "--dry-run", "--despite")
    assert run(*asked).exit_code == 0
    record = json.loads((strange / loop.RECORD).read_text())
    for changed, words in (
        ({"machine": "mill 2"}, "for the machine 'mill 2'"),
        ({"topology": "wYXfZ(S)t"}, "of the topology wYXfZ(S)t"),
        ({"volume": {**record["volume"], "X": [-5000.0, 5000.0]}}, "beyond the travel of X"),
    ):
        other = {**record, **changed}
        other["digest"] = loop.digest(other)
        (strange / loop.RECORD).write_text(json.dumps(other, indent=1, ensure_ascii=False) + "\n")
        said = str(run(*asked).exception)
        assert said.startswith(f"--present: {strange}: found a compensation") and words in said, said
        if "volume" not in changed:
            assert words in str(run("compensate", "-C", mine, "--check", strange).exception)


def stored(folder: Path, name: str, target: str, settings: tuple[str, ...] = ()) -> Path:
    """Example, target → a folder as `tango compensate` writes it."""
    loop.store(folder.parent, propose(first(name), target, settings, poses=64), NOW, folder)
    return folder


def shifted(content: str) -> str:
    """The same with its pivots 25 mm elsewhere: every number after a place of a center."""
    return re.sub(r"(?m)(= ?|R|^\d{3} |rot-point |Trans [XYZ] )([-+]?0\.\d+)", lambda m: f"{m[1]}{float(m[2]) + 25:.4f}", content)


FORMS = {
    "linuxcnc": "joint_0.comp",
    "isg_csv": "volcomp.csv",
    "etalon": "etalon.txt",
    "siemens": "cec.ini",
    "heidenhain": "X.COM",
    "fanuc": "compensation.txt",
    "centroid": "cnc-x.tab",
    "value_sheet": "values.txt",
}


@pytest.mark.few(0)
@pytest.mark.parametrize("target", FORMS)
def test_a_table_of_another_machine_that_was_read_back_is_named(target: str, tmp_path: Path) -> None:
    """The file of a machine with other axes and travels, and of one with other points, in place of what was written."""
    own, file = stored(tmp_path / "own", "trunnion", target), FORMS[target]
    assert loop.check(own)["target"] == target
    more = stored(tmp_path / "a" / "more", "trunnion", target, ("points=9",)) if "points" in targets.load(target).OPTIONS else None
    for other in (stored(tmp_path / "b" / "other", "hu40t", target), more):
        if other is None:
            continue
        (own / file).write_text((other / file).read_text())
        with pytest.raises(TangoError) as refused:
            loop.check(own)
        said = str(refused.value)
        assert f"{file}:" in said and "written was" in said
        assert "This is no slip of a digit, but a file of another machine or of another compensation: " in said, said
        assert "points from" in said or "axis B, of which nothing was written" in said or "of the machine" in said, said


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("target", "file"),
    [
        ("siemens", "kinematics.mpf"),
        ("heidenhain", "kinematics.txt"),
        ("fanuc", "vectors.nc"),
        ("haas", "settings.txt"),
        ("fagor", "offsets.nc"),
        ("grblhal", "settings.txt"),
        ("linuxcnc", "compensation.hal"),
        ("iso230", "iso230.yaml"),
    ],
)
def test_a_description_with_its_pivots_elsewhere_is_named(target: str, file: str, tmp_path: Path) -> None:
    own = stored(tmp_path / "own", "trunnion", target)
    wanted = (own / file).read_text()
    elsewhere = shifted(wanted) if target != "iso230" else wanted.replace("A: {", "B: {")
    assert elsewhere != wanted
    (own / file).write_text(elsewhere)
    with pytest.raises(TangoError) as refused:
        loop.check(own)
    said = str(refused.value)
    assert "a file of another machine or of another compensation: " in said, said
    slip = re.sub(r"(\d\.\d+?)(\d)(\D)", lambda m: f"{m[1]}{(int(m[2]) + 1) % 10}{m[3]}", wanted, count=1)
    (own / file).write_text(slip)
    with pytest.raises(TangoError) as refused:
        loop.check(own)
    assert "another machine" not in str(refused.value)  # a digit is a digit


@pytest.mark.few(0)
def test_a_file_of_undo_and_of_a_neighbour_is_named(tmp_path: Path) -> None:
    """Read back from the control: what was there before, or what was proposed for the machine in the next cell."""
    mine, other = tmp_path / "mill" / loop.FOLDER, tmp_path / "mill 2" / loop.FOLDER
    own = stored(mine / "001-haas", "trunnion", "haas")
    theirs = stored(other / "004-haas", "hu40t", "haas")
    (tmp_path / "mill" / "tango.yaml").write_text("tango: 1\n")
    (own / "settings.txt").write_text((own / "undo" / "settings.txt").read_text())
    with pytest.raises(TangoError, match="It is the file of undo/, with the numbers before"):
        loop.check(own)
    (own / "settings.txt").write_text((theirs / "settings.txt").read_text())
    with pytest.raises(TangoError, match=r"It is the file of .*mill 2/compensations/004-haas, for the machine 'HU40T-like'"):
        loop.check(own, tmp_path / "mill")


def test_the_same_tables_with_other_numbers_are_of_no_other_machine() -> None:
    for file in (
        "[pitch X]\n-10 0.001\n10 0.002\n",
        "BEGIN X.COM\nNR AXISPOS BACKLASH X\n0 -10 0 0.001\n1 10 0 0.002\n[END]\n",
        "X -10 10 20 MM\n0.001 0\n0.002 0\n",
    ):
        assert of_another(file, file.replace("0.002", "0.003"), {}) == ""
        assert "from -10 to 99" in of_another(
            file, file.replace("10 0", "99 0").replace("-99", "-10").replace("10 20", "99 20"), {}
        )
        lost = of_another(
            file, file.replace("10 0.002\n", "").replace("1 10 0 0.002\n", "").replace("0.002 0\n", ""), {"X": (-5, 5)}
        )
        assert "has 1 point" in lost, lost
    assert of_another("NR ACTIVE X Y Z\n", "NR ACTIVE X Y B\n", {}) == "it has axis B, of which nothing was written"
    assert of_another("machine: mill\n", "machine: mill 2\n", {}) == "it says that it is of the machine 'mill 2'"
    assert of_another("[a]\n0 1\n1 1\n", "", {}) == "it lacks a"
