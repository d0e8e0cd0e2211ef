"""No text from a file reaches a program unfiltered: whatever names a cell has, the program does what it does without them."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from postprocessors import MARK, comment, load, mark_of, names, program
from tango_cnc.files import read_cell
from tango_cnc.plan import part, plan, plan_hash
from tango_cnc.records import Plan

GOLDEN = Path(__file__).parent / "golden" / "cell"
# What ends a comment, a line, a program or a string somewhere, what begins one, and what addresses a file or a variable.
NASTY = ["(", ")", ";", "%", "\n", "\r\n", "\x00", "\x13", "\x1a", '"', "'", "#500=1", "M30", "G0 Z-999.", "[", "]", "$", "{", "}"]
NASTY += ["<<", "||", "\\", "~", "/", "O1", "N1", "END PGM", "é", "ß", "\u2028", "😀", "PROGRAM 000000000000", "=", "!", "*", "\t"]
TEXTS = st.lists(st.sampled_from(NASTY) | st.text(max_size=8), min_size=1, max_size=12).map("".join)


@cache
def golden() -> Plan:
    return part(plan(read_cell(GOLDEN)), [1, 2])


def renamed(machine: str, artefact: str, strategy: str, facet: str) -> Plan:
    """names → the plan with these names wherever a file may say one; its second touch is on the facet."""
    made = golden()
    facets = {f.id: f for f in made.artefact.facets.values() if f.id != "top"} | {
        facet: replace(made.artefact.facets["top"], id=facet)
    }
    return replace(
        made,
        machine=replace(made.machine, name=machine),
        artefact=replace(made.artefact, name=artefact, facets=facets),
        strategy=replace(made.strategy, name=strategy),
        touches=tuple(replace(t, facet=facet if t.facet == "top" else t.facet) for t in made.touches),
    )


def code(name: str, made: Plan) -> list[str]:
    """→ the lines of the program without remarks, marks aside."""
    lines = list(program(load(name), made, {}, plan_hash(made))[2]())
    for line in lines:
        assert line.isascii() and line.isprintable(), line
    text = "".join(f"{line}\n" for line in lines)
    text = text.replace(mark_of(text), "MARK").replace(plan_hash(made), "PLAN")
    return [re.sub(r"\([A-Z0-9 .+-]*\)|;[A-Z0-9 .+-]*$", "", line) for line in text.split("\n")]


@pytest.mark.few(0)
@pytest.mark.parametrize("name", names())
@settings(max_examples=10, deadline=None)
@given(machine=TEXTS, artefact=TEXTS, strategy=TEXTS, facet=TEXTS)
def test_names_change_nothing_but_remarks(name: str, machine: str, artefact: str, strategy: str, facet: str) -> None:
    assert code(name, renamed(machine, artefact, strategy, facet)) == plain(name)


@cache
def plain(name: str) -> list[str]:
    return code(name, renamed("M", "A", "S", "top"))


@pytest.mark.long
@settings(max_examples=300, deadline=None)
@given(text=TEXTS)
def test_a_remark_is_capitals_digits_blanks_and_signs(text: str) -> None:
    assert re.fullmatch(r"[A-Z0-9 .+-]{0,60}", comment(text))
    assert not MARK.search(comment(text)), "a name is not taken for the mark of the program"
