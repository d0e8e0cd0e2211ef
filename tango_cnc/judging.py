"""Readings → estimate → noise → verdict, in one place: every command that shows numbers begins here."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .asked import as_run
from .estimate import Estimate, estimate
from .files.origin import FEW, Origin, by_no_machine, changed_keys, edited_rows, hurried, look_up, other_machine
from .files.readjson import read_json
from .judgement import Judgement, Suspicion
from .noise import honest
from .plausible import judge, without_fit
from .records import Cell, InputError, Readings, TangoError, TermItem
from .texts import say

SHOWN = 3  # suspicions that a person reads


class NoFit(TangoError):
    """There is no estimate; `judgement` says what most likely is the reason."""

    def __init__(self, text: str, judgement: Judgement) -> None:
        super().__init__(text)
        self.judgement = judgement


def judged(
    cell: Cell,
    readings: Readings,
    terms: Sequence[TermItem],
    degree: int = 3,
    fit: Callable[[], Estimate] | None = None,
    source: Path | None = None,
    run: Mapping[str, Any] | None = None,
    origin: Origin | None = None,
    explain: bool = True,
) -> tuple[Estimate, Judgement]:
    """cell, readings, terms → estimate with the noise that its residuals show, and judgement; without the mistake that explains
    a bad one where `explain` is False.

    `source`: the file of the readings, which says where they come from. `run`, `origin`: what is beside it, where it was read
    before.
    Raises TangoError where there is no fit, with the mistake that most likely is the reason.
    """
    if source is not None:
        origin = origin or look_up(source)
        run = run_of(source, origin) if run is None else run
    cell = as_run(cell, run)
    try:
        result = fit() if fit is not None else estimate(cell.machine, cell.artefact, readings, terms, degree)
    except InputError:
        raise
    except TangoError as error:
        judgement = judge(cell, readings, None, run=run)
        raise NoFit(f"{error}{''.join(f'{chr(10)}{line}' for line in suspected(judgement))}", judgement) from None
    try:
        result = honest(result)
    except np.linalg.LinAlgError:
        judgement = judge(cell, readings, None, run=run)
        why = "the touches contradict each other so much that their scatter cannot be estimated"
        raise NoFit("\n".join([f"estimate: {why}", *suspected(judgement)]), judgement) from None
    judgement = judge(replace(cell, terms=tuple(terms)), readings, result, run=run, explain=explain)
    return result, judgement if origin is None else traced(judgement, origin, cell.folder)


def rows_alone(cell: Cell, readings: Readings, source: Path, run: Mapping[str, Any] | None) -> Judgement:
    """cell, readings, their file, what is beside it → what is wrong with the readings themselves, whatever is fitted to them."""
    origin = look_up(source)
    run = run_of(source, origin) if run is None else run
    return traced(without_fit(as_run(cell, run), readings, run), origin, cell.folder)


def run_of(source: Path, origin: Origin | None = None) -> dict[str, Any] | None:
    """readings.csv → what its run wrote beside it (readings.json), or which touches a simulation left out; None: neither.

    `origin`: that of these readings, where it was read before.
    """
    with suppress(InputError):
        return read_json(source.with_suffix(".json"), "what 'tango run' wrote")
    return left_out(origin or look_up(source))


def left_out(origin: Origin) -> dict[str, Any] | None:
    """origin of readings → which touches a simulation left out; None where it does not say."""
    made = origin.known.get("run")
    return made if isinstance(made, dict) and isinstance(made.get("left_out_touches"), list) else None


def traced(judgement: Judgement, origin: Origin, folder: Path) -> Judgement:
    """judgement, origin of the readings, folder of the cell → the same with what was changed since they were made."""
    reasons, remarks, source = list[str](), list[str](), origin.readings
    lines, gone = edited_rows(origin)
    if lines:
        listed = ", ".join(map(str, lines[:FEW])) + (" …" if len(lines) > FEW else "")
        reasons.append(say("judging.edited", file=source.name, count=len(lines), lines=listed))
    if gone:
        reasons.append(say("judging.gone", file=source.name, count=gone))
    if named := other_machine(origin, folder):
        then, now = named
        reasons.append(say("judging.of_another", file=source.name, then=repr(then), now=repr(now)))
    if made_by := said_of_origin(origin):
        remarks.append(made_by)
    if wall := hurried(origin):
        remarks.append(wall)
    for name, keys in changed_keys(origin, folder).items():
        listed = ", ".join(keys[:FEW]) + (" …" if len(keys) > FEW else "")
        remarks.append(f"{name} was changed since the readings were made: {listed}")
    verdict = judgement.verdict if judgement.verdict == "implausible" or not reasons else "doubtful"
    return replace(judgement, verdict=verdict, reasons=(*judgement.reasons, *reasons), remarks=(*judgement.remarks, *remarks))


def said_of_origin(origin: Origin) -> str:
    """origin of readings → what to say of who made them; nothing where a machine was measured."""
    if not origin.known:
        return f"origin unknown: nothing beside {origin.readings.name} says which program and cell it is of"
    return "readings of the simulated machine" if by_no_machine(origin.known) else ""


def made_up(readings: Path) -> bool:
    """readings.csv → whether a simulator made them."""
    return by_no_machine(look_up(readings).known)


def suspected(judgement: Judgement) -> list[str]:
    """judgement → the most likely mistakes, for people."""
    if not judgement.suspicions:
        return []
    first, *others = judgement.suspicions[:SHOWN]
    if first.kind == "missing_touches":  # the reason above says it already
        return [f"less likely: {s.text} ({_where(s)})" for s in others]
    if first.fits is False:
        most = first.text.removeprefix("less is left ")
        lines = [f"no single mistake explains the readings; the one that explains most: {most} ({_where(first)}: {first.change})"]
    else:
        lines = [f"most likely: {first.text} ({_where(first)}: {first.change})"]
    if first.before > first.after:
        lines += [f"  this leaves {first.after * 1e3:.4g} µm of {first.before * 1e3:.4g} µm (root mean square of all touches)"]
    as_well = "would leave as little" if first.fits is False else "would explain it as well"
    lines += [f"  {text} {as_well}" for text in first.equally]
    return lines + [f"less likely: {s.text} ({_where(s)})" for s in others]


def _where(suspicion: Suspicion) -> str:
    line = f" line {suspicion.line}" if suspicion.line else ""
    return f"{suspicion.file}{line}, {suspicion.key}"
