"""What came of the plan in the air → proofs: one experiment fails, others are open where the program did not get to them."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from . import experiments as folder
from .experiment import Experiment, Seen, Verdict


@dataclass(frozen=True)
class Judged:
    """One experiment and what came of it."""

    experiment: Experiment
    verdict: Verdict


def experiments() -> tuple[Experiment, ...]:
    """→ all of them, the most dangerous belief first: the files of `experiments/`."""
    found = [
        importlib.import_module(f"{folder.__name__}.{m.name}").EXPERIMENT
        for m in pkgutil.iter_modules(folder.__path__)
        if not m.name.startswith("_")
    ]
    return tuple(sorted(found, key=lambda experiment: (experiment.danger, experiment.belief)))


def judge(seen: Seen) -> list[Judged]:
    """what came of it → every experiment with its verdict. A program that stopped blames one belief: that of its text.

    Without a text that is known, the one is blamed whose judge sees the trouble first, by danger.
    """
    every = experiments()
    blamed = next((e for e in every if seen.said and e.stops.search(seen.said.upper())), None)
    judged = []
    for experiment in every:
        verdict = experiment.judge(seen)
        if blamed is not None and experiment is blamed:
            verdict = Verdict("FAIL", f"the program stopped: {seen.said}")
        elif blamed is not None and verdict.verdict == "FAIL":
            verdict = Verdict("OPEN", f"the program stopped before: {seen.said}")
        judged.append(Judged(experiment, verdict))
    return judged


def remaining(unverified: Iterable[str], proven: Mapping[str, str]) -> tuple[list[str], list[Experiment]]:
    """list of what is unverified, {belief: verdict} → what of the list no proof settles, and the beliefs without PASS by danger."""
    passed = [e for e in experiments() if proven.get(e.belief) == "PASS"]
    left = [text for text in unverified if not any(e.settles.search(text) for e in passed)]
    return left, [e for e in experiments() if proven.get(e.belief) != "PASS"]


def ordered(unverified: Sequence[str]) -> list[tuple[int, str, str]]:
    """list of what is unverified → (danger, text, how to check it), the most dangerous first; 9 where no experiment knows it."""
    rows = []
    for text in unverified:
        own = next((e for e in experiments() if e.settles.search(text)), None)
        rows.append((own.danger if own else 9, text, own.check if own else ""))
    return sorted(rows, key=lambda row: row[0])
