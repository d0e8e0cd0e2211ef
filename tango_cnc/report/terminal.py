"""Facts of a report → what the terminal shows of it: the verdict, every check, and the largest parameters as bars."""

from __future__ import annotations

import textwrap
from collections.abc import Callable

from .answer import LEVELS
from .characters import SIGNS, bar, colored, width
from .checks import verdict
from .decimals import decimals
from .facts import Facts
from .may import grown, may
from .page import parameters, sentence
from .states import since_then
from .texts import Texts, texts
from .verdict import Level


def summary(found: Facts, columns: int | None = None, t: Texts | None = None, handed: Callable[[str], str] = str) -> str:
    """facts of a report, columns, texts, what makes the commands of a sentence whole → verdict, every check, and the largest
    parameters with a bar of their interval.
    """
    t = t or texts()
    columns = columns or width()
    judged = verdict(found, t)
    told = may(found, t)
    level = LEVELS[told.answer.may]
    head = f"{SIGNS[level]} {t('may.ask')} {told.answer.word}{', ' + told.answer.old if told.answer.old else ''}."
    how = t("todo.limit_none") if told.answer.may == "unknown" and found.wishes.limit is None else ""
    number = f"{told.answer.numbers}." if told.answer.numbers else ""
    moved = since_then(found, t, "may.moved_since") if grown(found) else ""  # else the pages and the report alone name it
    said = (told.answer.why, number, told.run, moved, told.cause, how, told.basis)  # what to do first stands first
    lines = _headed(head, handed(" ".join(x for x in said if x)), level, columns)
    head = f"{SIGNS[judged.level]} {t('level.' + judged.level)}:"
    lines += _headed(head, handed(sentence(judged, t, found.judgement.untrusted)), judged.level, columns)
    for check in judged.checks:
        sign = "–" if check.open else colored(SIGNS[check.level], check.level)
        lines.append(f"  {sign} {t('check.' + check.name):<12} {check.value}")
    rows = parameters(found, t, most=8)
    if rows:
        span: dict[str, float] = {}
        for r in rows:
            span[r["unit"]] = max(span.get(r["unit"], 0.0), abs(r["number"]) + r["half"])
        ends = [f"{r['value']:>9} {r['unit']:<7}" for r in rows]
        whole = [f"{end} {r['low']} … {r['high']}" for end, r in zip(ends, rows, strict=True)]
        indent = max(len(r["name"]) for r in rows) + 4
        if indent + 11 + max(map(len, whole)) <= columns:  # a number is shown whole or not at all
            ends = whole
        room = min(41, columns - indent - max(map(len, ends)))
        lines.append("")
        for r, end in zip(rows, ends, strict=True):
            drawn = bar(r["number"], r["half"], span[r["unit"]], room - 1 + room % 2)
            lines.append(f"  {r['name']:<{indent - 4}} {drawn} {end}")
        if names := ", ".join(r["name"] for r in rows if r["untrusted"]):
            lines += textwrap.wrap(f"  {SIGNS['stop']} {t('verdict.not_these', names=names)}", columns)
    return decimals("\n".join(lines), t)


def _headed(head: str, text: str, level: Level, columns: int) -> list[str]:
    """first words, what follows, level, columns → lines, the first words in the color of the level."""
    lines = textwrap.wrap(f"{head} {text}".rstrip(), columns)
    if lines[0].startswith(head):
        lines[0] = lines[0].replace(head, colored(head, level), 1)
    return lines
