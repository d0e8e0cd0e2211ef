"""What several tests share of readback."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from postprocessors import companions, heidenhain, load, names, program, settings
from support.dialects import klartext
from tango_cnc.files import read_cell
from tango_cnc.plan import plan, plan_hash
from tango_cnc.readback import check
from tango_cnc.records import InputError, Plan

GOLDEN = Path(__file__).parents[1] / "golden"
MACRO_B = ("fanuc", *(n for n in names() if load(n).language == "macro_b" and n != "fanuc"))
Beside = Mapping[str, list[str]]  # file name → lines, of what travels with a program


@cache
def golden() -> Plan:
    return plan(read_cell(GOLDEN / "cell"))


UNGATED = {"gate": "none"}  # what is spoilt here is a touch's; test_gate.py spoils the move that proves the probe alive


def lines_of(post: str, made: Plan, **options: Any) -> list[str]:
    return list(_of_golden(post) if made is golden() and not options else _written(post, made, options))


@cache
def _of_golden(post: str) -> tuple[str, ...]:
    """→ what hundreds of tests spoil: it is written once."""
    return _written(post, golden(), {})


def _written(post: str, made: Plan, options: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(program(load(post), made, UNGATED | options, plan_hash(made))[2]())


def read_back(lines: list[str], made: Plan, post: str, beside: Beside | None = None, **options: Any) -> bool:
    """→ whether everything has been read, with what travels with the program: that of the post unless stated."""
    travels = companions(load(post), made, options) if beside is None else beside
    settled = settings(load(post), UNGATED | options)
    return not check(lambda: iter(lines), made, settled, travels, written_in=load(post).language)


def refused(lines: list[str], post: str = "fanuc", made: Plan | None = None, beside: Beside | None = None, **options: Any) -> str:
    """→ the refusal, in words; empty when there is none."""
    try:
        assert read_back(lines, made or golden(), post, beside, **options), "nobody has read it"
    except InputError as error:
        return str(error)
    return ""


def bare(post: str, made: Plan, **options: Any) -> list[str]:
    """→ the lines of a program without the block numbers that Klartext has."""
    return [re.sub(r"^\d+ ", "", line) if klartext(post) else line for line in lines_of(post, made, **options)]


def renumbered(lines: list[str]) -> list[str]:
    return list(heidenhain.numbered(iter(lines)))


def counted(post: str, lines: list[str]) -> list[str]:
    """dialect, blocks without numbers → the lines of a program, numbered where the language numbers them."""
    return renumbered(lines) if klartext(post) else lines


def changed(lines: list[str], old: str, new: str, times: int = 1) -> list[str]:
    text = "\n".join(lines)
    assert old in text
    return text.replace(old, new, times).split("\n")
