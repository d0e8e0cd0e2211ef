"""The post on the page that shows how to write one: copied by a stranger, it works as those of this project do."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from support.profiles import spoken

from postprocessors import load, mark_of, unverified
from tango_cnc.cli import guarded, tango
from tango_cnc.files import read_cell
from tango_cnc.plan import plan

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "dialects.md").read_text(encoding="utf-8").partition("## Writing one")[2]


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """A cell with the file from the page in it."""
    shutil.copytree(ROOT / "tests" / "golden" / "cell", tmp_path / "cell")
    found = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert len(found) == 1
    (tmp_path / "cell" / "acme.py").write_text(found[0], encoding="utf-8")
    return tmp_path / "cell"


def call(*arguments: object) -> int:
    return guarded(tango.main, [str(a) for a in arguments], prog_name="tango", standalone_mode=False)


def test_its_program_has_every_touch_between_two_marks(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("plan", "-C", cell, "--post", cell / "acme.py") == 0
    said = capsys.readouterr().out
    assert "has not been read back" in said and "a probe that is off stops nothing" in said
    text = (cell / "program" / "TANGO.nc").read_text()
    made, mark = plan(read_cell(cell)), mark_of(text)
    printed = [line for line in text.splitlines() if line.startswith("PRINT")]
    assert printed[0] == f'PRINT "TANGO START {mark} 6"' and printed[-1] == f'PRINT "TANGO END {mark} 6"'
    assert [re.match(r'PRINT "P(\d+) H#1 X#X', line)[1] for line in printed[1:-1]] == list("123456")  # type: ignore[index]
    moves = [line.split()[0] for line in text.splitlines() if line.startswith(("G131", "G130", "G1 ", 'PRINT "P'))]
    wanted = {"probe": ["G130", "G1", "PRINT"]}
    assert moves == [word for move in made.moves if move.kind != "index" for word in wanted.get(move.kind, ["G131"])]
    assert "G91\nG1 X-1.5 F3000.\nG90\n" in text


def test_its_options_are_those_of_the_cell(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (cell / "tango.yaml").write_text(
        spoken((cell / "tango.yaml").read_text(), "post: ./acme.py, unclamp: {B: M11}, clamp: {B: M10}, probe_on: M80")
    )
    assert call("plan", "-C", cell) == 0
    text = (cell / "program" / "TANGO.nc").read_text()
    assert "M80\n" in text and "M11\nG53 G0 B-30.\nM10\n" in text
    post = load(str(cell / "acme.py"))
    assert len(unverified(post, {"clamp": {}, "probe_on": ""})) == len(unverified(post, {})) - 2
    (cell / "tango.yaml").write_text((cell / "tango.yaml").read_text().replace("clamp: {B", "clamp: {A"))
    assert call("plan", "-C", cell) == 2
    assert "allowed: a word such as M10 for B, C" in capsys.readouterr().err


def test_a_step_that_is_forgotten_is_named(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = cell / "acme.py"
    file.write_text(file.read_text(encoding="utf-8").replace("def record(", "def recorded("), encoding="utf-8")
    assert call("plan", "-C", cell, "--post", file) == 2
    assert "missing 1 required keyword-only argument: 'record'" in capsys.readouterr().err


def test_a_default_of_an_option_that_the_family_has_not_names_those_that_it_has(
    cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The word that ends a program is a field of the words of the family: KeyError: 'end' was all that was said."""
    (cell / "relative.py").write_text(
        "from postprocessors._base import Post, with_defaults\nfrom postprocessors._macro_b import OPTIONS, steps\n"
        "from postprocessors._macro_b_text import Words\n"
        'POST = Post(title="A", extension="nc", options=with_defaults(OPTIONS, end="M2"), doubts=("a",), **steps(Words()))\n'
    )
    assert call("plan", "-C", cell, "--post", cell / "relative.py") == 2
    said = capsys.readouterr().err
    assert "found end; allowed: alarm, axis_numbers" in said and "is a field of the words of the family" in said


def test_nasty_names_do_not_reach_its_program(cell: Path) -> None:
    machine = cell / "machine.yaml"
    machine.write_text(re.sub(r"(?m)^name:.*$", 'name: "mill) M30 (G0 Z-9 PROGRAM 012345678901"', machine.read_text()))
    assert call("plan", "-C", cell, "--post", cell / "acme.py") == 0
    text = (cell / "program" / "TANGO.nc").read_text()
    assert text.splitlines()[0] == "(TANGO MILL M30 G0 Z-9 PROGRAM-012345678901)"
    mark_of(text)


def test_a_mistake_in_it_is_told_with_its_line_and_nothing_is_written(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (cell / "acme.py").read_text().replace('job.options["reset"]', 'job.options["rest"]')
    (cell / "acme.py").write_text(text)
    line = next(number for number, each in enumerate(text.splitlines(), 1) if '"rest"' in each)
    assert call("plan", "-C", cell, "--post", cell / "acme.py") == 2
    assert f"acme.py:{line}: KeyError: 'rest'" in capsys.readouterr().err
    assert not (cell / "program").exists()


def test_a_dry_run_looks_at_it_and_at_its_options(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As the page tells to begin."""
    assert call("plan", "-C", cell, "--post", cell / "acme.py", "--dry-run") == 0
    assert "retract" in capsys.readouterr().out
    file = cell / "tango.yaml"
    file.write_text(spoken(file.read_text(), "post: ./acme.py, clamp: {A: M10}"))
    assert call("plan", "-C", cell, "--dry-run") == 2
    assert "allowed: a word such as M10 for B, C" in capsys.readouterr().err
    (cell / "acme.py").write_text("raise SystemExit(0)\n")
    assert call("plan", "-C", cell, "--post", cell / "acme.py", "--dry-run") == 2
    assert "acme.py: cannot be read: SystemExit: 0" in capsys.readouterr().err


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'stem=lambda job: "TANGO"',
            "stem=lambda job: job.nothing",
            r"acme.py:\d+: AttributeError: 'Job' object has no .*'nothing'",
        ),
        (
            'stem=lambda job: "TANGO"',
            'stem=lambda job: "../TANGO"',
            "ACME 3000: stem gave '../TANGO'; allowed: a file name without",
        ),
        ('stem=lambda job: "TANGO"', "stem=lambda job: None", "ACME 3000: stem gave None; allowed: a file name without"),
        ("options=OPTIONS,", "options=OPTIONS, finish=lambda lines: 1 / 0,", r"acme.py:\d+: ZeroDivisionError"),
        ("options=OPTIONS,", "options=OPTIONS, companions=lambda job: 1 / 0,", r"acme.py:\d+: ZeroDivisionError"),
        (
            "def record(job, leg):",
            "def record(job):",
            r"acme.py: record\(\) takes 1 positional argument but 2 were given; a step is a function of job",
        ),
        ('    yield f"G131', '    return f"G131', "acme.py: a step gave the text 'G131 "),
        ('    yield f"G131', '    word = f"G131', "acme.py: 'NoneType' object is not iterable; a step is a function of job"),
        ('    yield "M30"', "    yield 30", "post ACME 3000: a step gave 30; allowed: lines of text"),
        ('    yield "M30"', '    yield "M30\\x13"', r"post ACME 3000: the line 'M30\\x13' has characters that no control reads"),
        ('    yield "M30"', '    yield "M30 \u00fc"', "post ACME 3000: the line 'M30 \u00fc' has characters that no control reads"),
    ],
)
def test_a_step_that_is_none_is_told_so(cell: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, words: str) -> None:
    text = (cell / "acme.py").read_text()
    assert old in text
    (cell / "acme.py").write_text(text.replace(old, new, 1))
    assert call("plan", "-C", cell, "--post", cell / "acme.py") == 2
    assert re.search(words, capsys.readouterr().err)
    assert not (cell / "program").exists()
