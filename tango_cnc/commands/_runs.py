"""Repeated runs, each judged for itself: what a machine does differently from day to day is what repetitions are to show.

A fit of all runs together takes them for one machine that stands still. One that varies leaves residuals there, which look like a
drift, a knock or a switched compensation. That is no mistake in the readings: the scatter of the runs contains it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..estimate import Estimate
from ..files.origin import look_up
from ..judgement import Judgement, Suspicion
from ..judging import judged, run_of, traced
from ..plausible import ORDER, without_fit
from ..records import Cell, Readings, TangoError, TermItem
from ..texts import say

EXPLAINED = 3  # runs: as many as a person reads suspicions


def judged_apart(
    cell: Cell,
    readings: Readings,
    terms: Sequence[TermItem],
    degree: int,
    source: Path,
    together: tuple[Estimate, Judgement],
) -> tuple[Estimate, Judgement]:
    """cell, readings of several runs, terms, their file, estimate and judgement of all together → the same, of each run alone.

    The touches without weight are then those that have none in the fit of their own run. What no fit is needed to see is judged
    of all runs together: a day that repeats an earlier one, rows that somebody edited. One run, or runs that fit one machine:
    nothing changes. What explains a run that is not to be believed is looked for in the worst `EXPLAINED` of them.
    """
    estimate, whole = together
    runs = list(_runs(readings))
    if len(runs) < 2 or whole.verdict == "trustworthy":
        return together
    origin = look_up(source)
    rows = traced(without_fit(cell, readings, run_of(source, origin)), origin, cell.folder)
    reasons, untrusted, suspicions = list(rows.reasons), set[str](), list[Suspicion](rows.suspicions)
    verdicts, nothing, unused = [rows.verdict], False, set[tuple[int, int, int]]()
    first: Estimate | None = None
    of_first: tuple[str, ...] = ()
    bad = list[tuple[int, int, int, Readings]]()
    for day, cycle, one in runs:
        try:
            found, own = judged(cell, one, terms, degree, explain=False)
        except TangoError:
            return together
        if first is None:
            first, of_first = found, own.remarks
        verdicts.append(own.verdict)
        reasons += [say("repeated.of_run", day=day, cycle=cycle, text=text) for text in own.reasons]
        untrusted |= set(own.untrusted)
        nothing |= own.nothing
        bad += [(-ORDER.index(own.verdict), day, cycle, one)] if own.verdict != "trustworthy" else []
        unused |= {(day, cycle, int(n)) for n in found.model.touches.number[found.unused]}
    verdict = max(verdicts, key=ORDER.index)
    if ORDER.index(verdict) >= ORDER.index(whole.verdict) and nothing >= whole.nothing:
        return together
    for _, day, cycle, one in sorted(bad, key=lambda b: b[0])[:EXPLAINED]:
        _, own = judged(cell, one, terms, degree)
        suspicions += [replace(s, text=say("repeated.of_run", day=day, cycle=cycle, text=s.text)) for s in own.suspicions]
    touches = estimate.model.touches
    each = zip(touches.day.tolist(), touches.cycle.tolist(), touches.number.tolist(), strict=True)
    out = np.array([one in unused for one in each], dtype=np.bool_)
    assert first is not None  # there are two runs
    remarks = dict.fromkeys([*rows.remarks, *of_first, *([say("repeated.vary")] if verdict == "trustworthy" else [])])
    apart = Judgement(
        verdict,
        tuple(dict.fromkeys(reasons)),
        tuple(remarks),
        tuple(suspicions),
        tuple(label for label in _labels(estimate) if label in untrusted),
        rows.incomplete,
        nothing,
    )
    return replace(estimate, rejected=out, unsure=None, noise=first.noise), apart


def _runs(readings: Readings) -> Iterator[tuple[int, int, Readings]]:
    for day, cycle in sorted(set(zip(readings.day.tolist(), readings.cycle.tolist(), strict=True))):
        yield day, cycle, readings.rows((readings.day == day) & (readings.cycle == cycle))


def _labels(estimate: Estimate) -> list[str]:
    return [estimate.selection.label(c.name) for c in estimate.model.coefficients]
