"""A goal as the command line has it → the criterion that chooses the plan."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..files.checked import suggestion
from ..model import STYLUS, Model
from ..records import Array, Combination, InputError
from ..report.units import shown
from ..terms import Coefficient, inter_axis
from .candidates import Candidates
from .criterion import Criterion
from .region import Levers

WORDS = ("volume", "locations", "check", "D", "A", "condition")
SEEN = 0.05  # mm at a touch: as well is known what no limit is stated for
COARSE = 10.0  # times as uncertain as a location may be what is no location
USUAL_MINUTES = {"volume": 10.0, "locations": 5.0, "check": 2.5, "D": 10.0, "A": 10.0, "condition": 10.0}


@dataclass(frozen=True)
class Goal:
    """A word of `WORDS`, or limits: coefficient → standard deviation (µm, µrad …) that is not to be exceeded."""

    word: str
    limits: Mapping[str, float]

    @property
    def text(self) -> str:
        """→ as on the command line."""
        return self.word or ",".join(f"{name}={limit:g}" for name, limit in self.limits.items())


def read(text: str, option: str = "--goal", words: Sequence[str] = WORDS) -> Goal:
    """'volume', 'EX0C=1,EA0C=5', the option, words that it takes → goal; limits in µm, µrad, µm/m as on the terminal.

    Raises InputError for anything else.
    """
    if text in WORDS:
        return Goal(text, {})
    limits = {}
    for part in text.split(","):
        name, equals, number = part.partition("=")
        try:
            limits[name.strip()] = float(number)
        except ValueError:
            equals = ""
        if not equals or not 0 < limits[name.strip()] < math.inf:
            whole = part if equals or not part.strip().isdecimal() else text  # 1,5: the comma of a number
            raise InputError(
                f"{option}: found {whole!r}; allowed: {', '.join(words)}, or limits of standard deviations such as EX0C=1,EA0C=5 "
                f"(µm, µrad, µm/m; above 0){suggestion(name.strip(), words)}"
            )
    return Goal("", limits)


def is_location(coefficient: Coefficient) -> bool:
    """coefficient → whether it is an axis location (inter-axis) error."""
    return inter_axis.PATTERN.fullmatch(coefficient.name) is not None


def volume(lever: Levers, scale: Array) -> Criterion:
    """levers at poses, (p,) scale of the unknowns → mean square of the uncertain part of the tool tip's error (I-optimal).

    What backlash adds has either sign, whatever other backlashes do: its mean square is added.
    """
    still, jumps = lever.steady * scale, lever.jumps * scale
    spread = np.einsum("mik,mil->kl", still, still) + np.diag(np.einsum("mik,mik->k", jumps, jumps))
    return Criterion("volume", spread / len(still))


def of_limits(choice: Candidates, limits: Mapping[str, float], seen: bool = False) -> Criterion:
    """candidates, limits (µm, µrad … as on the terminal) by name → worst ratio of a variance to its limit's square.

    `seen`: what has no limit is to be seen, to `SEEN` at a touch: an estimate without it would take it for what has one. So are
    the balls of a scale bar, which is not used otherwise.

    Raises InputError for a name that no plan could estimate.
    """
    model = choice.selection.model
    names = {choice.selection.label(c.name): j for j, c in enumerate(model.coefficients)}
    names |= {c.name: j for j, c in enumerate(model.coefficients)}
    rows = []
    for name, limit in limits.items():
        if name not in names:
            unseen = [c.text for c in choice.selection.unseen if c.names[0] == name]
            why = f"no plan here can see: {unseen[0]}" if unseen else "is no parameter of these terms"
            raise InputError(
                f"--goal: found {name!r}, which {why}; allowed: {', '.join(list(names)[:12])} …{suggestion(name, [*WORDS, *names])}"
            )
        row = np.zeros(len(choice.scale))
        row[names[name]] = choice.sigma * choice.scale[names[name]] * shown(model.coefficients[names[name]].unit)[0] / limit
        rows.append(row)
    if seen and rows:
        named = {names[name] for name in limits}
        for j in [*range(len(model.coefficients)), *_bar(choice)]:
            if j not in named:
                rows.append(np.eye(len(choice.scale))[j] * choice.sigma / SEEN)
    return Criterion("limits", None, np.array(rows)) if rows else Criterion("D")


def _bar(choice: Candidates) -> list[int]:
    """candidates → unknowns that are centres of the balls of a scale bar; none where facets are calibrated."""
    bar, model = choice.cell.artefact.scale_bar, choice.selection.model
    if bar is None or model.calibrated:
        return []
    centres = {f"E{c}ball{ball}" for ball in bar.balls for c in "XYZ"}
    return [j for j, name in enumerate(model.names) if name in centres]


def unseen_of_machine(choice: Candidates) -> list[Combination]:
    """candidates → the errors of the machine that are asked for and that no touch of theirs can see."""
    return sorted((one for one in choice.selection.unseen if one.names[0] not in STYLUS), key=lambda one: one.names[0])


def refuse_unseen(word: str, choice: Candidates, asked: bool) -> None:
    """goal, candidates, whether any plan sees what it asks for → nothing. Raises InputError with the reason where none does."""
    if asked:
        return
    own = unseen_of_machine(choice)
    more = f" ({len(own) - 1} more likewise: {', '.join(one.names[0] for one in own[1:5])} …)" if own[1:] else ""
    why = f": {own[0].text}{more}" if own else ""
    todo = "a cell with more (facets with an uncertainty in artefact.yaml are calibrated)" if own else "--terms with S3 or S4"
    raise InputError(
        f"--goal {word}: no plan here can see an error of the machine that this goal asks for{why}; allowed: D, A or condition, "
        f"which choose touches for what can be seen, or {todo}"
    )


def usual_limits(model: Model, reach: float) -> dict[str, float]:
    """model, mm of the part's half diagonal → of every axis location 1 µm, or the µrad that move a part's far end by 1 µm.

    Gains and backlashes are asked for too, ten times as coarsely: what is not determined at all could be in a location.
    """
    if not any(is_location(c) for c in model.coefficients):
        raise InputError("--goal locations: no axis location is among the terms; allowed: --terms with S3 or S4")
    own = [c for c in model.coefficients if c.name not in STYLUS]
    return {c.name: (1.0 if is_location(c) else COARSE) * (1.0 if c.unit == "mm" else 1e3 / reach) for c in own}


def every(choice: Candidates) -> Criterion:
    """candidates → sum of the variances of the machine's unknowns, each scaled by what it does to a touch (A-optimal)."""
    spread = np.zeros((len(choice.scale), len(choice.scale)))
    own = np.arange(len(choice.selection.model.coefficients))
    spread[own, own] = 1.0
    return Criterion("A", spread)


def ill_conditioned(choice: Candidates) -> Criterion:
    """candidates → worst variance of the scaled unknowns: what raises the smallest singular value."""
    return Criterion("condition", None, np.eye(len(choice.scale)))
