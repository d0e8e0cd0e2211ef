"""Plan → programs, each read back before anybody may have it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import postprocessors as posts

from .. import plan as planner
from .. import readback
from ..files.checked import read_text
from ..records import InputError, Plan
from .parts import parts
from .record import Program

KEPT = 2000  # touches of a program up to which its text, some MB, is kept: it is read several times, and made anew each time else
PLAN = re.compile(r"\bPLAN ([0-9A-F]{12})\b")
PART = re.compile(r"\bPLAN [0-9A-F]{12} PART (\d+) OF (\d+)\b")


def programs(post: posts.Post, whole: Plan, options: Mapping[str, Any], most: int | None = None) -> list[Program]:
    """post, plan, `controller` keys, touches a program may make → its programs in their order, each read back.

    Without a number of touches there are as many programs as `memory` of the profile asks for, mostly one.

    Raises InputError for options and numbers that cannot be written, and naming the line that must not reach a machine.
    """
    plans = parts(post, whole, options, most)
    plan_mark, found = planner.plan_hash(whole), []
    beside = posts.companions(post, whole, options)
    for number, plan in enumerate(plans, 1):
        part = number, len(plans)
        given = posts.of_part(post, options, part, whole.machine.stylus)
        name, mark, lines = posts.program(post, plan, given, plan_mark, part)
        lines = _kept(lines) if len(plan.touches) <= KEPT else lines
        try:
            unread = proven(post, lines, plan, posts.settings(post, given), beside)
        except InputError as error:
            raise InputError(f"{error}: nothing was written. Correct the post, or the profile under 'controller'") from None
        letters = post.record_letters(plan.machine)
        found.append(Program(name, mark, lines, plan, letters, post.summed, part, unread, beside=tuple(sorted(beside))))
    return found


def _kept(lines: Callable[[], Iterator[str]]) -> Callable[[], Iterator[str]]:
    """lines, made at each call → the same, made at the first call."""
    text = cache(lambda: tuple(lines()))
    return lambda: iter(text())


def from_file(file: Path, post: posts.Post, whole: Plan, options: Mapping[str, Any]) -> Program:
    """file of `tango plan`, post, plan, `controller` keys → its program, read back.

    Raises InputError for a program that was changed, is of another plan, is a part of one, or must not reach a machine.
    """
    text = read_text(file)
    try:
        mark = posts.mark_of(text)
    except InputError as error:
        raise InputError(f"{file}: {error}; nothing was sent") from None
    found = PLAN.search(text)
    if found is None or found[1] != planner.plan_hash(whole):
        other = found[1] if found else "none"
        raise InputError(
            f"{file}: found plan {other}; the cell makes plan {planner.plan_hash(whole)}. "
            "The files of the cell have changed since, or --obstructed is another: write the program again with 'tango plan'"
        )
    if several := PART.search(text):
        raise InputError(
            f"{file}: found part {several[1]} of {several[2]}; a part alone is no whole plan: "
            "'tango run' without --program, with the --split N of 'tango plan' if there was one, runs all parts in their order"
        )
    lines = text.splitlines()
    try:
        beside = posts.companions(post, whole, options)
        given = posts.of_part(post, options, (1, 1), whole.machine.stylus)
        unread = proven(post, lambda: iter(lines), whole, posts.settings(post, given), beside)
    except InputError as error:
        raise InputError(f"{file}: {error}: nothing was sent. Write it again with 'tango plan'") from None
    letters = post.record_letters(whole.machine)
    return Program(file.name, mark, lambda: iter(lines), whole, letters, post.summed, unread=unread, file=str(file))


def proven(
    post: posts.Post,
    lines: Callable[[], Iterator[str]],
    plan: Plan,
    settings: Mapping[str, Any],
    companions: Mapping[str, Sequence[str]],
) -> tuple[str, ...]:
    """post, its program, plan, every option, what travels with it → what nobody has read back, in sentences.

    Raises InputError naming the line of the program that must not reach a machine.
    """
    if post.language and post.language not in readback.names():
        raise InputError(f"post {post.title}: language: found {post.language!r}; allowed: {', '.join(readback.names())}, or none")
    unread = readback.check(lines, plan, settings, companions, written_in=post.language)
    return tuple(f"{what} has not been read back: nothing reads programs for {post.title}" for what in unread)
