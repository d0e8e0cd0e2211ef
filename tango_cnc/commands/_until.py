"""`tango run --until`: how many touches are made before the goal is looked at again, and what is said at the end."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..files import write_text
from ..files.readjson import read_json
from ..records import Cell, InputError, LinkError

if TYPE_CHECKING:
    from ..design.until import Until
    from ..link.measure import Wanted


def wanted_by(cell: Cell, text: str) -> Until:
    """cell, --until → what is to be reached, and the plan that does. Raises InputError for a goal that says no limit."""
    from ..design import goals, until
    from ..design.propose import Wish, usual_terms
    from .check import positioning_feed

    aim = goals.read(text, "--until", ("volume=5 (µm rms)", "locations"))
    terms = usual_terms(goals.Goal(until.WORD, {}) if until.WORD in aim.limits else aim, cell.terms)
    try:
        found = until.until(cell, Wish(aim, None, terms, cell.strategy.approach, feed=positioning_feed(cell)))
    except InputError as error:  # a design has its goal from --goal
        raise InputError(str(error).replace("--goal", "--until")) from None
    if found.appended:
        click.echo(f"--until: the strategy alone does not reach {text}; {found.appended} touches are appended to it", err=True)
    return found


def run_until(
    cell: Cell, goal: Until, wanted: Wanted, run: Callable[[Wanted, int], dict[str, Any]], say: Callable[[str], object]
) -> dict[str, Any]:
    """cell, goal, what is wanted, how to make the next touches → provenance; ends when the goal is reached, or no touch is left."""
    from ..files import read_readings

    before = None
    if wanted.resume:
        origin = _made(goal, wanted, run, 0)
        before = read_readings(wanted.readings, cell.machine, cell.artefact)
    count, now = goal.ahead(before)
    while count:
        say(f"--until: {count} touches are to be made now")
        origin = _made(goal, wanted, run, count)
        wanted = replace(wanted, resume=True)
        count, now = goal.ahead(read_readings(wanted.readings, cell.machine, cell.artefact))
    text = goal.ready.wish.goal.text
    if now <= 1:
        say(f"--until: reached: the largest uncertainty is {100 * now:.0f} % of what was asked for; {_left(origin, goal)}")
    else:
        why = goal.short_of(read_readings(wanted.readings, cell.machine, cell.artefact))
        say(f"--until: not reached: the largest uncertainty is {now:.2g} times what was asked for. {why}")
    made = {"goal": text, "reached": bool(now <= 1), "ratio": now}
    _add(wanted.readings.with_suffix(".json"), {**made, "strategy": _meant(goal, len(origin["missing"]))})
    return origin | {"until": made}


def _made(goal: Until, wanted: Wanted, run: Callable[[Wanted, int], dict[str, Any]], count: int) -> dict[str, Any]:
    """goal, what is wanted, how to make touches, how many → provenance. What is on disk meanwhile says which touches are meant."""
    meant = {"goal": goal.ready.wish.goal.text, "reached": False, "ratio": None, "strategy": _meant(goal, 0)}
    try:
        origin = run(wanted, count)
    except LinkError:
        _add(wanted.readings.with_name(f"{wanted.readings.stem}.partial.json"), meant)
        raise
    _add(wanted.readings.with_suffix(".json"), meant)
    return origin


def _add(file: Path, made: Mapping[str, Any]) -> None:
    """readings.json, what a goal says of them → the same file with it; nothing where there is no file."""
    with suppress(InputError):
        whole = read_json(file, "what 'tango run' wrote") | {"until": made}
        write_text(file, json.dumps(whole, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def _meant(goal: Until, left: int) -> list[dict[str, Any]]:
    """goal, touches that were not needed → the indexations and facets that were, so that nothing counts as missing."""
    last = goal.plan.touches[len(goal.plan.touches) - left - 1].number
    found, done = [], 0
    for indexation in goal.cell.strategy.indexations:
        facets = list(indexation.facets[: max(0, last - done)])
        done += len(indexation.facets)
        if facets:
            found.append({"position": dict(indexation.position), "facets": facets})
    return found


def _left(origin: dict[str, Any], goal: Until) -> str:
    """provenance, goal → how many touches the goal did not need, and the command that makes them."""
    count = len(origin["missing"])
    how = f"tango run --resume --until {goal.ready.wish.goal.text}" if goal.appended else "tango run --resume"
    return f"{count} touches of the plan are left; '{how}' makes them" if count else "the goal needed every touch"
