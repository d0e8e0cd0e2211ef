"""`probe_state`: who lets a program go without a look at the probe's input says so, in the profile, in the header, in the list."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from support.controls import GOLDEN, golden, lines_of
from support.profiles import spoken
from support.runs import Result

from postprocessors import load, names, unverified
from tango_cnc.commission import experiments

REMARK = "PROBE STATE NONE - THE PROGRAM DOES NOT SEE A STYLUS THAT IS DEFLECTED BEFORE A MOVE"
DOUBT = "the program does not look at the input of the probe (probe_state)"
ASKING = [name for name in names() if any(option.must for option in load(name).options)]
OUT = {  # dialect → how its profile says that the program need not look
    **dict.fromkeys(("brother", "fanuc", "haas", "mazak", "mitsubishi", "okuma"), "none"),
    **{"siemens": False, "mach4": False, "fagor": ""},
}
LOOKING = {"fanuc": 1004, "haas": 1004, "okuma": "VDIN[11]", "siemens": True, "mach4": True, "fagor": "V.G.PRBST1"}


def test_the_dialects_whose_variable_is_the_builders_ask_for_it() -> None:
    assert ASKING == ["brother", "fanuc", "haas", "mazak", "mitsubishi", "okuma"]


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


@pytest.mark.parametrize("name", OUT)
def test_a_profile_that_says_no_is_repeated_in_the_header_and_as_a_doubt_of_danger_one(name: str) -> None:
    text = "\n".join(lines_of(name, golden(), probe_state=OUT[name]))
    doubts = [doubt for doubt in unverified(load(name), {"probe_state": OUT[name]}) if doubt.startswith(DOUBT)]
    assert REMARK in text and len(doubts) == 1
    assert {e.belief for e in experiments() if e.settles.search(doubts[0])} == {"deflected"}
    assert DOUBT.upper().split(" (")[0] in text, "the doubt stands in the header, too"


@pytest.mark.parametrize("name", LOOKING)
def test_a_program_that_looks_says_nothing_of_it(name: str) -> None:
    text = "\n".join(lines_of(name, golden(), probe_state=LOOKING[name]))
    assert REMARK not in text
    assert not any(DOUBT in doubt for doubt in unverified(load(name), {"probe_state": LOOKING[name]}))


@pytest.mark.parametrize("name", sorted(set(names()) - set(OUT)))
def test_where_the_program_or_the_control_looks_in_any_case_there_is_no_such_key(name: str) -> None:
    assert not any(option.name == "probe_state" for option in load(name).options)
    assert REMARK not in "\n".join(lines_of(name, golden()))


@pytest.mark.parametrize("name", ASKING)
def test_the_page_of_each_control_that_is_asked_shows_the_key(name: str) -> None:
    page = (Path(__file__).parent.parent / "docs" / "controls" / f"{name}.md").read_text(encoding="utf-8")
    assert ("      probe_state: " in page and "| probe variable |" in page) or (name == "okuma" and "| inputs |" in page)
