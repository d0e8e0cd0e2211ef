"""A dialect is one file of code, also where its control is not that of its relatives: a command writes down what its simulated
control is, and every failure of a case of its own says so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support import dialects, namedcontrols, newdialect
from support.controls import golden, run_on
from support.namedcontrols import NOBODY, OPEN, complaint, differs, first, missing, unsaid, wrong

from postprocessors import load, program, with_defaults
from sim_controller.named import controls, stand_in
from sim_controller.session import language, profile
from tango_cnc.plan import plan_hash
from tango_cnc.records import InputError

NUMBERS = {"X": 1, "Y": 2, "Z": 3, "C": 5, "B": 6}
STATED = {"skip": "G31 P1", "axis_numbers": NUMBERS, "wait": "G103 P1", "probe_on": "G65 P9832", "orient": "M19 P"}


@pytest.fixture
def wotan(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> str:
    """A relative of Fanuc with several skip inputs and axes in another order, of which nobody has told the simulated control."""
    fanuc = load("fanuc")
    post = replace(fanuc, title="Wotan", options=with_defaults(fanuc.options, **STATED))

    def loaded(name: str) -> Any:
        return post if name == "wotan" else load(name)

    monkeypatch.setattr(namedcontrols, "load", loaded)
    monkeypatch.setattr("postprocessors.load", loaded)
    monkeypatch.setattr(namedcontrols, "controls", lambda: (*controls(), *controls(tmp_path)))
    monkeypatch.setattr(namedcontrols, "stand_in", lambda name: stand_in(name, tmp_path) or stand_in(name))
    monkeypatch.setitem(dialects.EVERY, "wotan", dialects.EVERY["fanuc"])
    monkeypatch.setattr(newdialect, "new", lambda: frozenset({"wotan"}))
    return "wotan"


def sections(name: str, shown: str, outcome: str = "failed") -> str:
    """dialect, what a failing test says → what is said besides."""
    report: Any = SimpleNamespace(failed=outcome == "failed", longrepr=shown, sections=[])
    item: Any = SimpleNamespace(callspec=SimpleNamespace(params={"name": name, "ignored": False}))
    step = newdialect.pytest_runtest_makereport(item)
    next(step)
    with pytest.raises(StopIteration):
        step.send(report)
    return "\n".join(f"{title}: {text}" for title, text in report.sections)


def test_a_control_that_is_missing_is_named_with_what_the_command_writes(wotan: str) -> None:
    said = differs(wotan)
    assert missing(wotan) and "sim_controller/controls/wotan.yaml" in said
    assert "TANGO_GOLDEN=write" in said and "-k wotan" in said and "skip_word: 'G31 P1'" in said and "numbered: 'XYZ-CB'" in said
    assert said in sections(wotan, "assert [] == ['ok']")
    assert not sections(wotan, said) and not sections(wotan, "", "passed") and not sections("haas", "assert [] == ['ok']")


def test_what_the_command_writes_waits_for_a_person_who_looks_it_up(wotan: str, tmp_path: Path) -> None:
    file = tmp_path / "wotan.yaml"
    file.write_text(first(wotan), encoding="utf-8")
    row = stand_in(wotan, tmp_path)
    assert row is not None and not wrong(wotan)
    own = {"skip_word": "G31 P1", "numbered": "XYZ-CB", "macros_ahead": "true", "orient": "P"}
    assert row.settings == own and row.stored == ("O9832", "M99")
    for said in ("which axis #5001", "skip_word: 'G31 P1'", "the programs that switch the probe", "under manual"):
        assert said in unsaid(wotan)
    assert unsaid(wotan) in complaint(wotan) and complaint(wotan) in sections(wotan, "assert [] == ['ok']")
    file.write_text(first(wotan).replace(OPEN, "M 4711, p. 12"), encoding="utf-8")
    assert not unsaid(wotan) and not wrong(wotan) and not sections(wotan, "assert [] == ['ok']")


def test_a_post_and_a_control_that_say_other_numbers_are_named_beside_each_other(wotan: str, tmp_path: Path) -> None:
    """The simulated control goes by its own file: nobody copies a number that is wrong from the post to it."""
    text = first(wotan).replace("XYZ-CB", "XYZBC").replace(OPEN, NOBODY).replace("O9832", "O8832")
    (tmp_path / "wotan.yaml").write_text(text, encoding="utf-8")
    numbers, stored = wrong(wotan)
    assert "so numbered: 'XYZ-CB'; the control says numbered: 'XYZBC' (the list of system variables" in numbers
    assert "O9832" in stored and "O8832" in stored and numbers in differs(wotan)
    (tmp_path / "wotan.yaml").write_text("language: macro_b\n", encoding="utf-8")
    assert len(wrong(wotan)) == len(STATED) and any("the control says no skip_word" in said for said in wrong(wotan))


def test_a_control_whose_file_is_wrong_is_refused_by_file_and_line(wotan: str, tmp_path: Path) -> None:
    (tmp_path / "wotan.yaml").write_text("language: macro_c\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"wotan\.yaml:1: language: found 'macro_c'; allowed: .*Did you mean 'macro_b'"):
        stand_in("wotan", tmp_path)
    assert "macro_c" in complaint(wotan) and "macro_c" in sections(wotan, "assert [] == ['ok']")
    assert stand_in("../wotan", tmp_path) is None and stand_in("", tmp_path) is None


def test_a_statement_of_another_language_names_the_reader(wotan: str) -> None:
    refused = "program line 64 'PRINT[TANGO*START*': no line that a program of this kind may have here. The program is not the plan"
    assert "named macro_b refuses its program" in sections(wotan, refused)
    assert not sections("fanuc", refused)


@pytest.mark.parametrize("name", controls())
def test_every_control_of_the_project_has_a_profile_and_a_post_that_goes_with_it(name: str) -> None:
    row = stand_in(name)
    assert row is not None and name in dialects.EVERY, f"sim_controller/controls/{name}.yaml: no post has this name"
    assert row.language == load(name).language and not wrong(name) and not unsaid(name)
    profile(language(row.language), dialects.example().machine, row.settings)  # refuses what it does not know


def records(spoken: str, counted: dict[str, str], options: dict[str, Any]) -> list[str]:
    """language, what its control has, options of a program → its records of the golden plan."""
    made, module = golden(), language(spoken)
    lines = list(program(load("fanuc" if spoken == "macro_b" else spoken), made, options, plan_hash(made))[2]())
    control = profile(module, made.machine, counted)
    ran = run_on(lambda motion, punch, note: module.Control(motion, control, punch, note), lines, made)
    return [line for line in ran.lines if line.startswith("P")]


@pytest.mark.parametrize("spoken", ["macro_b", "centroid"])
def test_a_control_numbers_its_axes_as_its_file_says(spoken: str) -> None:
    """With B and C the other way round and a number between that no axis has, only a program that counts so measures."""
    counted = {"numbered": "XYZ-CB"}
    assert len(records(spoken, counted, {"axis_numbers": NUMBERS})) == len(golden().touches)
    assert not records(spoken, counted, {})


def test_a_skip_move_of_another_input_does_not_notice_the_probe() -> None:
    assert len(records("macro_b", {"skip_word": "G31 P2"}, {"skip": "G31 P2"})) == len(golden().touches)
    assert not records("macro_b", {"skip_word": "G31 P2"}, {"skip": "G31 P1"})
