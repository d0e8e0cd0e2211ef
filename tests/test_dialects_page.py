"""docs/dialects.md says of every dialect what its program shows, who judges it, how long it may be: a new one is added there."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.dialects import ALONE, GOLDEN, example
from support.rows import beside, command, last, listed, names_in, said, with_list, writing

from postprocessors import load, names
from sim_controller.session import language

PAGE = Path(__file__).parent.parent / "docs" / "dialects.md"
WRITE = command("tests/test_dialects_page.py")
TABLES = {  # first line → the cells of a dialect without relatives
    "| dialect | what you see | state |": "a comment: say what the control shows of it | unconfirmed |",
    "| dialect | judged by | not judged |": "a simulated control of its own language | no real control; see the header of a program |",
}


def holding(words: str) -> set[str]:
    """words of a program → the dialects whose golden program, or a file beside it, has them."""
    files = [file for name in names() for file in (GOLDEN / name).glob("*") if file.is_file()]
    return {file.parent.name for file in files if words in file.read_text("utf-8")}


def remembering() -> set[str]:
    """→ the dialects whose simulated control keeps programs in a small memory."""
    machine = example().machine
    return {name for name in ALONE if getattr(language(ALONE[name].family).default_profile(machine), "memory", 0)}


LISTS = {  # words before the list, behind it → who belongs to it
    ("**A step shows first whether positions come in mm**, on", ": where they came"): lambda: holding("POSITIONS ARE IN INCHES"),
    ("`tango run` alike. It is 512 on", ". State"): lambda: {name for name in names() if load(name).memory == 512},
    ("The simulated controls of", "have such a memory"): remembering,
}


@pytest.mark.parametrize("head", TABLES)
def test_a_table_has_every_dialect(head: str) -> None:
    text = PAGE.read_text("utf-8")
    for name in names():
        if name not in names_in(text, head) and writing():
            relatives = [other for other in names() if load(other).language == load(name).language]
            text = beside(text, head, name, relatives, f"| {name} | {TABLES[head]}")
            PAGE.write_text(text, "utf-8")
    known = set(names_in(text, head))
    assert set(names()) == known, (
        f"docs/dialects.md, {head}: no row names {sorted(set(names()) - known)}; no dialects: {sorted(known - set(names()))}. {WRITE} "
        "adds a name to the row of its relatives; look whether that row is true of it"
    )


@pytest.mark.parametrize(("before", "after"), LISTS)
def test_a_sentence_names_the_dialects_of_which_it_is_true(before: str, after: str) -> None:
    text, now = PAGE.read_text("utf-8"), listed(LISTS[before, after]())
    if said(text, before, after) != now and writing():
        text = with_list(text, before, after, now)
        PAGE.write_text(text, "utf-8")
    assert said(text, before, after) == now, (
        f"docs/dialects.md, “{before} … {after}”: it is true of {now}. {WRITE} writes these names"
    )


def test_a_name_comes_to_its_relatives_and_a_list_is_broken_anew() -> None:
    head = "| dialect | a |"
    page = f"{head}\n|---|---|\n| b, d | x |\n| `y`, `x` | z |\n\nEnd\n\n* Of one list it\n  is true on B and D. More.\n* Other\n"
    assert "| b, c, d | x |" in beside(page, head, "c", ["b", "d", "x"], "| c | new |")
    assert "| `y`, `x`, `c` | z |" in beside(page, head, "c", ["x"], "| c | new |")
    assert beside(page, head, "c", [], "| c | new |") == last(page, head, "| c | new |")
    assert "| z |\n| c | new |\n\nEnd" in last(page, head, "| c | new |")
    assert set(names_in(page, head)) == {"b", "d", "x", "y"}
    assert said(page, "it is true on", ". More") == "B and D"
    assert "* Of one list it is true on B, C and D. More.\n* Other\n" in with_list(page, "it is true on", ". More", listed("bcd"))
    text = PAGE.read_text("utf-8")
    for words in LISTS:
        assert with_list(text, *words, said(text, *words)).split() == text.split()
