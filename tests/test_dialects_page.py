"""The lists of dialects in docs/dialects.md, asked of their programs: who makes the first step, who shows what, who splits."""

from __future__ import annotations

import re
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from support.controls import golden
from support.dialects import EVERY
from support.rows import behind, beside, command, last, names_in, sentence, with_list, writing

from postprocessors import companions, load, names, program
from sim_controller.session import language
from tango_cnc.gate import TOUCH
from tango_cnc.plan import plan_hash

FILE = Path(__file__).parent.parent / "docs" / "dialects.md"
PAGE = FILE.read_text(encoding="utf-8")
SHOWN = "| dialect | what you see | state |"
JUDGED = "| dialect | judged by | not judged |"
TABLES = {  # first line → the cells of a dialect without relatives
    SHOWN: "a comment: say what the control shows of it | unconfirmed |",
    JUDGED: "a simulated control of its own language | no real control; see the header of a program |",
}
WRITE = command("tests/test_dialects_page.py")


def listed(before: str, after: str) -> set[str]:
    """the words around a list → its dialects, as names of posts."""
    text = " ".join(FILE.read_text(encoding="utf-8").split())
    assert text.count(before) == 1, f"docs/dialects.md: {text.count(before)} times {before!r}; tests/test_dialects_page.py asks it"
    found = text.partition(before)[2].partition(after)[0]
    return {name.strip().lower() for name in re.split(r",| and ", found) if name.strip()}


@cache
def text(name: str, *options: tuple[str, Any]) -> str:
    """dialect, options → all that the control has of its program."""
    made, given = golden(), dict(options)
    lines = [*program(load(name), made, given, plan_hash(made))[2]()]
    return "\n".join([*lines, *(line for file in companions(load(name), made, given).values() for line in file)])


def same(said: set[str], found: set[str], what: str) -> None:
    assert said == found, (
        f"docs/dialects.md, {what}: lacks {sorted(found - said)}, has wrongly {sorted(said - found)}; {WRITE} writes it"
    )


def among(before: str, after: str, found: set[str], what: str) -> None:
    """the words around a list, the dialects that belong to it → nothing. Writes the list where it is asked to."""
    if writing() and listed(before, after) != found:
        FILE.write_text(with_list(FILE.read_text("utf-8"), before, after, sentence(found)), "utf-8")
    same(listed(before, after), found, what)


def test_the_page_names_who_makes_a_first_step_for_positions_in_inches() -> None:
    stepping = {name for name in names() if "POSITIONS ARE IN INCHES" in text(name)}
    among("shows first whether positions come in mm**, on ", ":", stepping, "A step shows first")
    mirrored = {name for name in names() if re.search("MIRROR IMAGE OR SCALING|MIRROR OR SCALED", text(name))} - stepping
    assert "Okuma makes the same step" in " ".join(PAGE.split())
    same({"okuma"}, mirrored, "makes the same step for the second reason")


def test_the_page_names_who_has_a_memory_for_programs_and_how_large() -> None:
    memory = {name: option.default for name in names() for option in load(name).options if option.name == "memory"}
    sized = {name for name, kb in memory.items() if kb == 512}
    among("in `tango run` alike. It is 512 on ", ". State the free memory", sized, "Split by default")
    simulated = {name for name, control in EVERY.items() if _memory(language(control.family)) == 512}
    among("The simulated controls of ", " have such a memory", simulated, "have such a memory, too")
    assert not {kb for kb in memory.values() if kb not in (0, 512, None, "none")}, "another size than those of the page"


def _memory(spoken: Any) -> int | None:
    """language of the simulated control → kB of its memory for programs; None where it has none."""
    profile = spoken.default_profile(golden().machine)
    return profile.memory if any(one.name == "memory" for one in fields(profile)) else None


def rows() -> dict[str, str]:
    """→ {dialect: what the page says that a person sees}."""
    page = FILE.read_text(encoding="utf-8")
    assert page.count(SHOWN) == 1
    table = page.partition(SHOWN)[2].partition("\n\n")[0]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]
    return {name: sees for several, sees, _ in cells for name in several.split(", ")}


@pytest.mark.parametrize("head", TABLES)
def test_a_table_of_the_page_has_every_dialect(head: str) -> None:
    """A name comes to the row of its relatives: who adds it looks whether that row is true of it."""
    for name in names():
        page = FILE.read_text("utf-8")
        if writing() and name not in names_in(page, head):
            relatives = [other for other in names() if load(other).language == load(name).language]
            FILE.write_text(beside(page, head, name, relatives, f"| {name} | {TABLES[head]}"), "utf-8")
    same(set(names_in(FILE.read_text("utf-8"), head)), set(names()), head)


@pytest.mark.parametrize("name", names())
def test_what_the_page_says_of_the_text_for_the_finger_is_in_the_program(name: str) -> None:
    assert name in rows(), f"docs/dialects.md, {SHOWN}: lacks {name}; {WRITE} writes it"
    sees = rows()[name]
    lines = [line for line in text(name).splitlines() if TOUCH in line]
    where = f"docs/dialects.md, {SHOWN}, {name}: {sees}; its program has {lines}"
    if "on the computer" in sees:
        assert not any(re.search(r"MSG|M0", line) for line in lines), where
        return
    assert lines, where
    if sees.startswith("a comment"):
        assert all(re.fullmatch(rf"\(?{TOUCH}[^()]*\)?|.*[;(] ?{TOUCH}.*", line) for line in lines), where
        assert not any(re.search(r"MSG|#3006|M00|STOP", line.partition(TOUCH)[0]) for line in lines), where
        (stop,) = re.findall(r"`show: stop` has `([^`]+)`", sees)
        assert stop in text(name, ("show", "stop")), f"{where}; with show: stop it lacks {stop}"
        return
    word = re.match(r"`([^`…]+)", sees)
    assert word is not None and any(word[1] in line.partition(TOUCH)[0] or word[1] in after for line, after in _next(name)), where


def _next(name: str) -> list[tuple[str, str]]:
    """dialect → lines with the text, each with the line behind it."""
    lines = text(name).splitlines()
    return [(line, after) for line, after in zip(lines, [*lines[1:], ""], strict=True) if TOUCH in line]


def test_a_name_comes_to_its_relatives_and_a_list_is_broken_anew() -> None:
    head = "| dialect | a |"
    page = f"{head}\n|---|---|\n| b, d | x |\n| `y`, `x` | z |\n\nEnd\n\n* Of one list it\n  is true on B and D. More.\n* Other\n"
    assert "| b, c, d | x |" in beside(page, head, "c", ["b", "d", "x"], "| c | new |")
    assert "| `y`, `x`, `c` | z |" in beside(page, head, "c", ["x"], "| c | new |")
    assert beside(page, head, "c", [], "| c | new |") == last(page, head, "| c | new |")
    assert "| z |\n| c | new |\n\nEnd" in last(page, head, "| c | new |")
    ports = f"{head}\n|---|---|\n| `serial` | x |\n| `z://` | y |\n| other | z |\n\nEnd"
    assert "| `z://` | y |\n| `a://` | w |\n| other" in behind(ports, head, "://", "| `a://` | w |")
    assert set(names_in(page, head)) == {"b", "d", "x", "y"}
    assert "* Of one list it is true on B, C and D. More.\n* Other\n" in with_list(page, "it is true on", ". More", sentence("bcd"))
