"""`probe_state`: who lets a program go without a look at the probe's input says so, in the profile, in the header, in the list."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
import yaml
from support.controls import GOLDEN, golden, lines_of
from support.profiles import spoken
from support.rows import beside, command, writing
from support.runs import Result

from postprocessors import load, names, unverified
from tango_cnc.commission import experiments

REMARK = "PROBE STATE NONE - THE PROGRAM DOES NOT SEE A STYLUS THAT IS DEFLECTED BEFORE A MOVE"
DOUBT = "the program does not look at the input of the probe (probe_state)"
DOCS = Path(__file__).parent.parent / "docs"
TABLE = "| dialect | what looks | leaving it out |"
NO_KEY = "cannot be left out"
WRITE = command("tests/test_probe_state.py -k dialect")


def rows() -> dict[str, str]:
    """→ {dialect: how its program is written without the look}, of docs/dialects.md: the fact that the posts are compared with."""
    table = (DOCS / "dialects.md").read_text(encoding="utf-8").split(TABLE)[1].split("\n\n")[0]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]
    return {name: out for names_, _, out in cells for name in names_.split(", ")}


def row(name: str) -> str:
    """dialect → the row of the table, as its post has it."""
    option = next((option for option in load(name).options if option.name == "probe_state"), None)
    if option is None:
        return f"| {name} | the control itself refuses to probe (unconfirmed) | {NO_KEY} |"
    flag = isinstance(option.default, bool)
    looks = "the input that you name" if option.must else "the program" if flag else f"`{option.default}`"
    out = "none" if option.must else "false" if flag else "''"
    return f"| {name} | {looks}, before every guarded move | `probe_state: {out}` |"


def missing(name: str) -> str:
    """dialect → what to do where the table has no row of it."""
    known = (
        f"its name stands in no row, which may be that of {', '.join(others)}" if (others := alike(name)) else "this row is missing"
    )
    return f"docs/dialects.md, {TABLE}: {known}; correct what looks:\n{row(name)}\n{WRITE} adds it"


def alike(name: str) -> list[str]:
    """dialect → its relatives in the table whose programs are written without the look by the same words."""
    kept = row(name).rstrip(" |").rpartition(" | ")[2]
    return [other for other, cell in rows().items() if cell == kept and load(other).language == load(name).language]


def out(name: str) -> object:
    """dialect → the value of `probe_state` with which its program need not look. Fails, with the row, where the table lacks it."""
    assert name in rows(), missing(name)
    return yaml.safe_load(rows()[name].strip("`"))["probe_state"]


ASKING = [name for name in names() if any(option.must for option in load(name).options)]
WITH_KEY = [name for name in names() if any(option.name == "probe_state" for option in load(name).options)]


def test_the_table_says_of_every_dialect_who_looks_and_how_the_look_is_left_out() -> None:
    for name in names():
        if name not in rows() and writing():
            page = beside((DOCS / "dialects.md").read_text(encoding="utf-8"), TABLE, name, alike(name), row(name))
            (DOCS / "dialects.md").write_text(page, encoding="utf-8")
        assert name in rows(), missing(name)
        assert (rows()[name] == NO_KEY) == (name not in WITH_KEY), f"docs/dialects.md: {name}: found {rows()[name]}; {row(name)}"
        assert (rows()[name] == "`probe_state: none`") == (name in ASKING), (
            f"docs/dialects.md: {name}: found {rows()[name]}. Only a post whose `probe_state` has must=True is written "
            f"without a look by the word none: {row(name)}"
        )
    assert not set(rows()) - set(names()), f"docs/dialects.md, {TABLE}: dialects that do not exist: {set(rows()) - set(names())}"


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    shutil.copytree(GOLDEN, tmp_path / "cell")
    return tmp_path / "cell"


@pytest.mark.few(2)
@pytest.mark.parametrize("name", ASKING)
@pytest.mark.parametrize("command", ["plan", "check", "commission", "locate", "run"])
def test_no_program_is_written_before_the_profile_says_it(cell: Path, name: str, command: str) -> None:
    file = cell / "tango.yaml"
    stated = spoken(file.read_text(encoding="utf-8"), f"post: {name}, port: 'socket://127.0.0.1:9'")
    file.write_text(stated.replace("probe_state: none", ""), encoding="utf-8")
    before = sorted(cell.rglob("*"))
    result = Result(command, "-C", cell, *(("--program",) if command in ("commission", "locate") else ()))
    assert (
        result.code == 2
        and "tango.yaml:5: controller.probe_state: found nothing; allowed: " in result.err
        and "State none" in result.err
    ), result.err
    assert sorted(cell.rglob("*")) == before


@pytest.mark.parametrize("name", WITH_KEY)
def test_a_profile_that_says_no_is_repeated_in_the_header_and_as_a_doubt_of_danger_one(name: str) -> None:
    text = "\n".join(lines_of(name, golden(), probe_state=out(name)))
    doubts = [doubt for doubt in unverified(load(name), {"probe_state": out(name)}) if doubt.startswith(DOUBT)]
    assert REMARK in text and len(doubts) == 1, f"postprocessors/{name}.py: its program has to say that it does not look"
    assert {e.belief for e in experiments() if e.settles.search(doubts[0])} == {"deflected"}
    assert DOUBT.upper().split(" (")[0] in text, "the doubt stands in the header, too"


def example(name: str) -> object:
    """dialect → the value of `probe_state` that the example of its page states, or else the default of its post."""
    page = DOCS / "controls" / f"{name}.md"
    stated = re.search(r"(?m)^      probe_state: ([^#\n]+)", page.read_text(encoding="utf-8") if page.is_file() else "")
    if stated:
        return yaml.safe_load(stated[1])
    assert name not in ASKING, f"docs/controls/{name}.md: {PAGE} writes a first page, with an example of probe_state"
    return next(option.default for option in load(name).options if option.name == "probe_state")


PAGE = command("tests/test_controls_pages.py")


@pytest.mark.parametrize("name", WITH_KEY)
def test_a_program_that_looks_says_nothing_of_it(name: str) -> None:
    stated = example(name)
    text = "\n".join(lines_of(name, golden(), probe_state=stated))
    assert REMARK not in text, f"docs/controls/{name}.md: state an input under probe_state:, and not the word none"
    assert not any(DOUBT in doubt for doubt in unverified(load(name), {"probe_state": stated}))


@pytest.mark.parametrize("name", sorted(set(names()) - set(WITH_KEY)))
def test_where_the_program_or_the_control_looks_in_any_case_nothing_is_said_of_it(name: str) -> None:
    assert REMARK not in "\n".join(lines_of(name, golden()))


@pytest.mark.parametrize("name", ASKING)
def test_the_page_of_each_control_that_is_asked_shows_the_key(name: str) -> None:
    file = DOCS / "controls" / f"{name}.md"
    page = file.read_text(encoding="utf-8") if file.is_file() else ""
    assert "      probe_state: " in page and re.search(r"(?m)^\| .*`probe_state`.* \|$", page), (
        f"docs/controls/{name}.md: the example lacks probe_state:, or no row says how its variable is found (| probe variable | "
        f"`probe_state`: … | unconfirmed |). Where there is no page, {PAGE} -k {name} writes a first one"
    )
