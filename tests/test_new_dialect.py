"""A dialect whose control is not that of its relatives: every failure of a case of its own says where that control is described."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from support import dialects, newdialect
from support.dialects import differs, lacking

from postprocessors import load
from postprocessors._base import with_defaults

NUMBERS = {name: i for i, name in enumerate("XYZABC", 1)}


@pytest.fixture
def acme(monkeypatch: pytest.MonkeyPatch) -> str:
    """A relative of Fanuc with several skip inputs and axes by their letters, of which nobody has told the simulated control."""
    fanuc = load("fanuc")
    post = replace(fanuc, title="Acme", options=with_defaults(fanuc.options, skip="G31 P1", axis_numbers=NUMBERS))
    monkeypatch.setattr(dialects, "load", lambda name: post if name == "acme" else load(name))
    monkeypatch.setattr("postprocessors.load", lambda name: post if name == "acme" else load(name))
    monkeypatch.setitem(dialects.EVERY, "acme", dialects.EVERY["fanuc"])
    monkeypatch.setattr(newdialect, "new", lambda: frozenset({"acme"}))
    return "acme"


def sections(name: str, shown: str, outcome: str = "failed") -> str:
    """dialect, what a failing test says → what is said besides."""
    report: Any = SimpleNamespace(failed=outcome == "failed", longrepr=shown, sections=[])
    item: Any = SimpleNamespace(callspec=SimpleNamespace(params={"name": name, "ignored": False}))
    step = newdialect.pytest_runtest_makereport(item)
    next(step)
    with pytest.raises(StopIteration):
        step.send(report)
    return "\n".join(f"{title}: {text}" for title, text in report.sections)


def test_a_row_that_is_missing_is_named_with_the_defaults_that_it_has_to_go_with(acme: str) -> None:
    said = differs(acme)
    assert "sim_controller/languages/macro_b/profile.py: CONTROLS" in said
    assert "skip: 'G31 P1' (field skip_word of Profile)" in said and "(field lettered or axes of Profile)" in said
    assert said in sections(acme, "assert [] == ['ok']")
    assert not sections(acme, said) and not sections(acme, "", "passed") and not sections("haas", "assert [] == ['ok']")


def test_a_statement_of_another_language_names_the_reader(acme: str) -> None:
    refused = "program line 64 'PRINT[TANGO*START*': no line that a program of this kind may have here. The program is not the plan"
    assert "named macro_b refuses its program" in sections(acme, refused)
    assert not sections("fanuc", refused)


def test_every_dialect_of_the_project_has_told_its_simulated_control() -> None:
    assert not any(map(lacking, dialects.EVERY))
    assert lacking("haas") == {} and load("haas").options != load("fanuc").options
