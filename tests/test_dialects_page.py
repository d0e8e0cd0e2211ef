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

from postprocessors import companions, load, names, program
from sim_controller.session import language
from tango_cnc.gate import TOUCH
from tango_cnc.plan import plan_hash

PAGE = (Path(__file__).parent.parent / "docs" / "dialects.md").read_text(encoding="utf-8")
SHOWN = "| dialect | what you see | state |"


def listed(before: str, after: str) -> set[str]:
    """the words around a list → its dialects, as names of posts."""
    text = " ".join(PAGE.split())
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
    assert said == found, f"docs/dialects.md, {what}: lacks {sorted(found - said)}, has wrongly {sorted(said - found)}"


def test_the_page_names_who_makes_a_first_step_for_positions_in_inches() -> None:
    stepping = {name for name in names() if "POSITIONS ARE IN INCHES" in text(name)}
    same(listed("shows first whether positions come in mm**, on ", ":"), stepping, "A step shows first")
    mirrored = {name for name in names() if re.search("MIRROR IMAGE OR SCALING|MIRROR OR SCALED", text(name))} - stepping
    assert "step" in PAGE.partition("Okuma makes the same step")[1]
    same({"okuma"}, mirrored, "makes the same step for the second reason")


def test_the_page_names_who_has_a_memory_for_programs_and_how_large() -> None:
    memory = {name: option.default for name in names() for option in load(name).options if option.name == "memory"}
    sized = {name for name, kb in memory.items() if kb == 512}
    same(listed("in `tango run` alike. It is 512 on ", ". State the free memory"), sized, "Split by default")
    simulated = {name for name, control in EVERY.items() if _memory(language(control.family)) == 512}
    same(listed("The simulated controls of ", " have such a memory"), simulated, "have such a memory, too")
    assert not {kb for kb in memory.values() if kb not in (0, 512, None, "none")}, "another size than those of the page"


def _memory(spoken: Any) -> int | None:
    """language of the simulated control → kB of its memory for programs; None where it has none."""
    profile = spoken.default_profile(golden().machine)
    return profile.memory if any(one.name == "memory" for one in fields(profile)) else None


def rows() -> dict[str, str]:
    """→ {dialect: what the page says that a person sees}."""
    assert PAGE.count(SHOWN) == 1
    table = PAGE.partition(SHOWN)[2].partition("\n\n")[0]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]
    return {name: sees for several, sees, _ in cells for name in several.split(", ")}


def test_the_page_says_of_every_dialect_where_its_text_for_the_finger_stands() -> None:
    same(set(rows()), set(names()), SHOWN)


@pytest.mark.parametrize("name", names())
def test_what_the_page_says_of_the_text_for_the_finger_is_in_the_program(name: str) -> None:
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
