"""`tango plan`: a program and plan.csv, or a sentence and nothing."""

from __future__ import annotations

import json
import math
import shutil
import textwrap
from pathlib import Path

import numpy as np
import pytest
from support.controls import golden, lines_of

from postprocessors import mark_of, names
from tango_cnc.cli import guarded, tango
from tango_cnc.files import read_artefact, read_cell, read_strategy
from tango_cnc.files.plan import plan_lines, read_plan, write_together
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import InputError

GOLDEN = Path(__file__).parent / "golden"


def call(*arguments: object) -> int:
    return guarded(tango.main, [str(a) for a in arguments], prog_name="tango", standalone_mode=False)


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    shutil.copytree(GOLDEN / "cell", tmp_path / "cell")
    return tmp_path / "cell"


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")


def test_program_and_plan_are_written_into_the_cell(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("plan", "-C", cell) == 0
    assert sorted(f.name for f in (cell / "program").iterdir()) == ["O7700.nc", "plan.csv"]
    assert (cell / "program" / "O7700.nc").read_text().splitlines() == lines_of("fanuc", golden(), probe_state="none")
    assert (cell / "program" / "plan.csv").read_text() == (GOLDEN / "plan.csv").read_text()
    out = capsys.readouterr().out
    assert "6 touches on 5 facets at 3 indexations" in out
    assert "unverified" in out and "print_format = 44" in out


def test_another_post_another_folder_and_the_result_as_json(cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("plan", "-C", cell, "--post", "linuxcnc", "--out", tmp_path / "out", "--json", "-") == 0
    data = json.loads(capsys.readouterr().out)
    made = plan(read_cell(cell))
    assert data["format"] == "tango-plan/1" and data["touches"] == 6 and data["indexations"] == 3
    assert data["plan_hash"] == plan_hash(made)
    assert data["program_hash"] == mark_of((tmp_path / "out" / "tango.ngc").read_text())
    assert data["moves"]["probe"] == data["moves"]["back"] == 6
    assert data["travel_used"]["C"]["from"] == -90 and data["travel_used"]["C"]["to"] == 270
    assert not (cell / "program").exists()


def test_plan_csv_is_in_degrees_and_comes_back_as_it_went(cell: Path) -> None:
    assert call("plan", "-C", cell) == 0
    known = read_cell(cell)
    made, back = plan(known), read_plan(cell / "program" / "plan.csv", known.machine)
    assert back.touch == tuple(t.number for t in made.touches) and back.facet == tuple(t.facet for t in made.touches)
    for place in ("standoff", "contact", "end"):
        np.testing.assert_allclose(getattr(back, place), [getattr(t, place) for t in made.touches], atol=1e-6)
    row = (cell / "program" / "plan.csv").read_text().splitlines()[4].split(",")
    assert float(row[2 + 3]) == -30.0 and math.degrees(back.contact[3, 3]) == pytest.approx(-30.0)


@pytest.mark.few(0)
def test_a_facet_name_that_needs_quotes_survives_plan_csv(cell: Path) -> None:
    for file in ("artefact.yaml", "strategy.yaml"):
        edit(cell / file, "top", "'a \"b\", c'")
    assert call("plan", "-C", cell) == 0
    known = read_cell(cell)
    assert read_plan(cell / "program" / "plan.csv", known.machine).facet[1] == 'a "b", c'


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("touch,facet", "touch,face", "plan.csv:1: header"),
        ("\n2,top", "\n2,top,1.0", "plan.csv:3: 21 values"),
        ("113.000000", "much", "plan.csv:2: could not convert"),
        ("113.000000", "nan", "plan.csv:2: a number that is not finite"),
    ],
)
def test_a_damaged_plan_csv_is_refused_by_line(cell: Path, old: str, new: str, message: str) -> None:
    assert call("plan", "-C", cell) == 0
    file = cell / "program" / "plan.csv"
    file.write_text(file.read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        read_plan(file, read_cell(cell).machine)


@pytest.mark.long
def test_touches_that_measure_the_probe_come_with_the_files_that_read_them(cell: Path) -> None:
    assert call("plan", "-C", cell, "--capability", "grid", "--post", "linuxcnc") == 0  # the shortest programs
    folder = cell / "capability" / "grid"
    whole = read_cell(cell)
    artefact = read_artefact(folder / "artefact.yaml")
    strategy = read_strategy(folder / "strategy.yaml", whole.machine, artefact)
    planned = (folder / "plan.csv").read_text(encoding="utf-8").splitlines()
    assert len(planned) - 1 == sum(len(i.facets) for i in strategy.indexations) > 1000
    assert not (cell / "program").exists()


def test_dry_run_prints_the_moves_and_writes_nothing(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("plan", "-C", cell, "--dry-run") == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(list(plan(read_cell(cell)).moves))
    assert lines[0].split()[:2] == ["1", "retract"] and any("index" in line and "C-90.000" in line for line in lines)
    assert not (cell / "program").exists()


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        (
            "machine.yaml",
            "travel: [-350, 350]",
            "travel: [-20, 350]",
            ["touch 3 (facet 101, indexation 1: B 0 C 0 S 0)", "Y -40.000 mm, travel -20 … 350 mm"],
        ),
        (
            "tango.yaml",
            "post: fanuc",
            "post: fanoc",
            [f"tango.yaml:5: controller.post: found 'fanoc'; allowed: {names()[0]}, ", "Did you mean 'fanuc'?"],
        ),
        ("tango.yaml", "post: fanuc", "post: fanuc, decimal: 3", ["unknown key 'decimal'", "Did you mean 'decimals'?"]),
        ("tango.yaml", "post: fanuc", "post: fanuc, decimals: 5", ["tango.yaml:5: controller.decimals: found 5; allowed: 3, 4"]),
        (
            "tango.yaml",
            "controller: {post: fanuc, probe_state: none}",
            "",
            ["no controller.post; state it there or with --post (", "linuxcnc"],
        ),
    ],
)
def test_what_is_wrong_is_said_and_nothing_is_written(
    cell: Path, capsys: pytest.CaptureFixture[str], file: str, old: str, new: str, words: list[str]
) -> None:
    edit(cell / file, old, new)
    before = {f: f.read_bytes() for f in cell.rglob("*")}
    assert call("plan", "-C", cell) == 2
    error = capsys.readouterr().err
    assert all(word in error for word in words), error
    assert {f: f.read_bytes() for f in cell.rglob("*")} == before


@pytest.mark.few(0)
def test_an_earlier_program_stays_when_the_new_one_is_refused(cell: Path) -> None:
    assert call("plan", "-C", cell) == 0
    before = {f.name: f.read_bytes() for f in (cell / "program").iterdir()}
    edit(cell / "machine.yaml", "travel: [-350, 350]", "travel: [-20, 350]")
    assert call("plan", "-C", cell) == 2
    assert {f.name: f.read_bytes() for f in (cell / "program").iterdir()} == before


def test_files_are_replaced_together_or_not_at_all(tmp_path: Path) -> None:
    first, second = tmp_path / "a", tmp_path / "b"
    first.write_text("old")

    def failing() -> list[str]:
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_together({first: lambda: ["new"], second: failing})
    assert first.read_text() == "old" and [f.name for f in tmp_path.iterdir()] == ["a"]
    write_together({first: lambda: ["new"], second: lambda: ["x", "y"]})
    assert (first.read_text(), second.read_text()) == ("new\n", "x\ny\n")


def contents(folder: Path) -> dict[Path, bytes | None]:
    """Every file of a folder and what it holds; None for a folder."""
    return {f: f.read_bytes() if f.is_file() else None for f in folder.rglob("*")}


def test_a_folder_in_the_place_of_one_file_keeps_the_others_as_they_were(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("old")
    (tmp_path / "b").mkdir()
    before = contents(tmp_path)
    for files in ("a", "b"), ("new/a", "new/deep/a", "b"):
        with pytest.raises(IsADirectoryError):
            write_together({tmp_path / name: lambda: ["new"] for name in files})
        assert contents(tmp_path) == before


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--out", "cell", "--capability", "grid"], "--out: found cell/strategy.yaml, which is read here"),
        (["--picture", "cell/solid.png"], "--picture: found cell/solid.png, which is read here"),
        (["--json", "cell/machine.yaml"], "--json: found cell/machine.yaml, which is read here"),
        (["--json", "cell/../cell/readings.csv"], "--json: found cell/../cell/readings.csv, which is read here"),
        (["--post", "./own.py", "--json", "own.py"], "--json: found own.py, which is read here"),
        (["--json", "cell/program/plan.csv"], "--json: found cell/program/plan.csv, a file of the program itself"),
        (["--json", "a.png", "--picture", "a.png"], "a.png, which --"),
        (["--json", "."], "--json: found ., which is a folder"),
        (["--json", ""], "--json: found ''; allowed: the name of a file"),
        (["--json", "cell/tango.yaml/a"], "cell/tango.yaml is a file; allowed: a file in a folder"),
        (["--out", "cell/tango.yaml"], "cell/tango.yaml is a file; allowed: a file in a folder"),
        (["--post", "fanuk", "--picture", "a.png"], "--post: found 'fanuk'"),
        (["--post", "./bad.py", "--picture", "a.png", "--json", "a.json"], "bad.py:5: ZeroDivisionError: division by zero"),
        (["--post", "cell/tango.yaml"], f"--post: found 'cell/tango.yaml', which does not end in .py; allowed: {names()[0]}, "),
    ],
)
def test_a_refused_run_leaves_every_file_as_it_was(
    cell: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], options: list[str], words: str
) -> None:
    monkeypatch.chdir(cell.parent)
    (cell / "readings.csv").write_text("measured", encoding="utf-8")
    (cell / "artefact.yaml").rename(cell / "solid.png")  # any name is one of the cell's when tango.yaml says so
    edit(cell / "tango.yaml", "artefact.yaml", "solid.png")
    Path("own.py").write_text(OWN, encoding="utf-8")
    Path("bad.py").write_text(OWN.replace('"ours")', "1 / 0)"), encoding="utf-8")
    before = contents(cell.parent)
    assert call("plan", "-C", "cell", *options) == 2
    assert words in capsys.readouterr().err
    assert contents(cell.parent) == before


def test_a_folder_named_plan_csv_leaves_the_earlier_program(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (cell / "program" / "plan.csv").mkdir(parents=True)
    (cell / "program" / "O7700.nc").write_text("earlier")
    assert call("plan", "-C", cell) == 2
    assert "plan.csv, which is a folder" in capsys.readouterr().err
    assert (cell / "program" / "O7700.nc").read_text() == "earlier"


@pytest.mark.parametrize(
    ("controller", "options", "words"),
    [
        ("post: fanuc", ["--post", "nonsense"], "--post: found 'nonsense'"),
        ("post: nonsense", [], "controller.post: found 'nonsense'"),
        ("post: fanuc, misses: 0", [], "controller.misses: found 0; allowed: 1 … 20"),
        ("post: fanuc, clampp: 3", [], "unknown key 'clampp'"),
    ],
)
def test_a_dry_run_looks_at_post_and_options(
    cell: Path, capsys: pytest.CaptureFixture[str], controller: str, options: list[str], words: str
) -> None:
    edit(cell / "tango.yaml", "post: fanuc", controller)
    assert call("plan", "-C", cell, "--dry-run", *options) == 2
    said = capsys.readouterr()
    assert words in said.err and not said.out


def test_a_cell_without_control_has_a_dry_run(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    edit(cell / "tango.yaml", "controller: {post: fanuc, probe_state: none}", "")
    assert call("plan", "-C", cell, "--dry-run") == 0
    assert "retract" in capsys.readouterr().out


@pytest.mark.few(6)
@pytest.mark.parametrize(
    ("command", "words"),
    [
        (["simulate", "-o", "cell/strategy.yaml"], "--output: found cell/strategy.yaml, which is read here"),
        (["simulate", "-o", "cell/world.yaml"], "--output: found cell/world.yaml, which is read here"),
        (["simulate", "--world", "w.yaml", "-o", "w.yaml"], "--output: found w.yaml, which --world names too"),
        (["simulate", "--json", "."], "--json: found ., which is a folder"),
        (["estimate", "--json", "cell/machine.yaml"], "--json: found cell/machine.yaml, which is read here"),
        (["estimate", "--readings", "r.csv", "--json", "r.csv"], "--json: found r.csv, which --readings names too"),
        (["run", "--transcript", "cell/machine.yaml"], "--transcript: found cell/machine.yaml, which is read here"),
        (["run", "--readings", "cell/machine.yaml"], "--readings: found cell/machine.yaml, which is read here"),
        (["run", "--json", "r.csv"], "no controller.port"),
        (["capability", "grid", "--budget", "cell/machine.yaml"], "--budget: found cell/machine.yaml, which is read here"),
    ],
)
def test_other_commands_keep_what_they_read_too(
    cell: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: list[str], words: str
) -> None:
    monkeypatch.chdir(cell.parent)
    for file in ("w.yaml", "r.csv", "cell/world.yaml"):
        Path(file).write_text("noise: 0\n", encoding="utf-8")
    before = contents(cell.parent)
    assert call(command[0], "-C", "cell", *command[1:]) == 2
    assert words in capsys.readouterr().err
    assert contents(cell.parent) == before


@pytest.mark.few(0)
def test_options_of_the_cell_belong_to_its_post(cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """macros: is a word of the Fanuc post; another post is not asked to know it."""
    edit(cell / "tango.yaml", "post: fanuc", "post: fanuc, macros: called, probe_on: G65 P9832")
    assert call("plan", "-C", cell) == 0
    text = (cell / "program" / "O7700.nc").read_text()
    assert "G65 P7702" in text and "\nG65 P9832\n" in text and "UNVERIFIED PROBE ON" not in text
    assert "WARNING" not in capsys.readouterr().err
    assert call("plan", "-C", cell, "--post", "linuxcnc", "--out", tmp_path / "out") == 0
    assert (
        "tango.yaml states macros, probe_on, probe_state for fanuc: the program for linuxcnc is made without them"
        in capsys.readouterr().err
    )


OWN = """
from dataclasses import replace
from postprocessors import load

POST = replace(load("linuxcnc"), title="Ours", extension="txt", stem=lambda job: "ours")
"""


@pytest.mark.few(0)
def test_a_post_of_ones_own_works_by_path(cell: Path) -> None:
    (cell / "mypost.py").write_text(OWN)
    assert call("plan", "-C", cell, "--post", cell / "mypost.py") == 0
    assert (cell / "program" / "ours.txt").exists()
    edit(cell / "tango.yaml", "post: fanuc, probe_state: none", "post: ./mypost.py")
    (cell / "program" / "ours.txt").unlink()
    assert call("plan", "-C", cell) == 0, "in tango.yaml the path starts from the cell"
    assert (cell / "program" / "ours.txt").exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("from postprocessors._base import Post\nPOST = Post(title='x', extension='y')\n", "TypeError: .*missing .*'probe'"),
        ("POST = 3\n", "defines no POST"),
        ("POST = (\n", "SyntaxError"),
        (None, f"--post: found '.*mypost.py', which is no file; allowed: {names()[0]}, "),
    ],
)
def test_a_post_of_ones_own_that_is_none_is_refused(
    cell: Path, capsys: pytest.CaptureFixture[str], text: str | None, words: str
) -> None:
    import re

    if text is not None:
        (cell / "mypost.py").write_text(textwrap.dedent(text))
    assert call("plan", "-C", cell, "--post", cell / "mypost.py") == 2
    assert re.search(words, capsys.readouterr().err)
    assert not (cell / "program").exists()


def test_touches_that_a_straight_stylus_cannot_make_can_be_left_out(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    edit(cell / "strategy.yaml", "C: -90, facets: [top, 3]", "C: -90, facets: [top, 5, 3]")
    assert call("plan", "-C", cell, "--obstructed", "refuse") == 2
    assert "touch 5 (facet 5, indexation 2: B -30 C -90 S 0): the facet faces 120° away" in capsys.readouterr().err
    assert call("plan", "-C", cell, "--obstructed", "leave-out") == 0
    captured = capsys.readouterr()
    assert "left out: touch 5 (facet 5" in captured.err and "1 touch of the strategy left out" in captured.out
    assert read_plan(cell / "program" / "plan.csv", read_cell(cell).machine).touch == (1, 2, 3, 4, 6, 7)


def test_plan_lines_stream(cell: Path) -> None:
    assert next(plan_lines(plan(read_cell(cell)))).startswith("touch,facet,standoff_X,")
