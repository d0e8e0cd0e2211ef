"""Conforms, does not conform, cannot tell: decisions that take the measurement uncertainty into account.

ISO 14253-1:2017: conformity is proved when the probability that the true value lies inside the limits is at least `probability`
(0.95 by default), non-conformity when the probability that it lies outside is. In between nobody can tell, and the
uncertainty, not the machine, has to be improved first. For one limit and a normal distribution this is the guard band
g = 1.65 u.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy import special

from .files.checked import complaint, load, suggestion
from .records import Array, InputError

Verdict = Literal["conforms", "does not conform", "cannot tell"]


@dataclass(frozen=True)
class Limits:
    """What is allowed, in the coefficient's own unit (mm, rad, mm/mm …); infinite where there is no limit."""

    low: float
    high: float


@dataclass(frozen=True)
class ConformityDecision:
    """One measurand against its limits."""

    name: str
    value: float
    std: float
    limits: Limits
    inside: float | None  # probability that the true value lies inside the limits; None where the result is in doubt
    verdict: Verdict
    uses: str = "one run"  # whose uncertainty: of one run, of the mean of repeated runs, or of the prediction of the next run


def read_limits(file: Path, known: Sequence[str]) -> dict[str, Limits]:
    """limits.yaml (`EX0C: 0.01` for ±0.01, or `[low, high]`, null for none), names that exist → limits by name.

    Values in mm and rad as in world.yaml. Raises InputError for unknown names and empty ranges.
    """
    node = load(file).fields(["limits"])["limits"]
    result = {}
    for name, child in node.items():
        if name not in known:
            raise complaint(file, child.line, child.path, f"{name!r}", f"{', '.join(known)}.{suggestion(name, list(known))}")
        plain = child.plain()
        if isinstance(plain, list):
            ends = [default if item is None else item for item, default in zip(plain, (-math.inf, math.inf), strict=False)]
            numeric = len(plain) == 2 and all(isinstance(e, (int, float)) and not isinstance(e, bool) for e in ends)
            none_at_all = numeric and not math.isfinite(float(ends[0])) and not math.isfinite(float(ends[1]))
            if not numeric or none_at_all or not float(ends[0]) < float(ends[1]):
                raise child.wrong("[low, high] with low below high; null for no limit on one side", str(plain))
            result[name] = Limits(float(ends[0]), float(ends[1]))
        else:
            size = child.number(above=0)
            result[name] = Limits(-size, size)
    if not result:
        raise node.wrong("at least one name with its limits", "none")
    return result


def decide(
    name: str, value: float, std: float, limits: Limits, probability: float = 0.95, dof: float = math.inf
) -> ConformityDecision:
    """estimate, its standard uncertainty, limits → decision for a normal (or, for finite dof, Student) distribution.

    Raises InputError for a probability that is not above one half.
    """
    _check(probability)
    if std == 0:
        inside = float(limits.low <= value <= limits.high)
    else:
        high, low = (limits.high - value) / std, (limits.low - value) / std
        inside = float(_below(high, dof) - _below(low, dof))
    return ConformityDecision(name, value, std, limits, inside, _verdict(inside, probability))


def decide_from(name: str, values: Array, value: float, limits: Limits, probability: float = 0.95) -> ConformityDecision:
    """estimate and (T,) Monte Carlo values of the measurand → decision by their own distribution (JCGM 106:2012, 7).

    Raises InputError for a probability that is not above one half.
    """
    _check(probability)
    inside = float(np.mean((values >= limits.low) & (values <= limits.high)))
    return ConformityDecision(name, value, float(np.std(values)), limits, inside, _verdict(inside, probability))


def guard_band(std: float, probability: float = 0.95, dof: float = math.inf) -> float:
    """standard uncertainty → g, by which an acceptance limit lies inside its tolerance limit (ISO 14253-1:2017; 1.65 u)."""
    _check(probability)
    return float(-std * (special.stdtrit(dof, 1 - probability) if math.isfinite(dof) else special.ndtri(1 - probability)))


def _check(probability: float) -> None:
    if not 0.5 < probability < 1:
        raise InputError(f"conformance probability: found {probability:g}; allowed: above 0.5 and below 1, 0.95 by ISO 14253-1")


def _below(x: float, dof: float) -> float:
    """x, degrees of freedom → probability that Student's t, or a normal number where they are infinite, is below x."""
    return float(special.stdtr(dof, x) if math.isfinite(dof) else special.ndtr(x))


def _verdict(inside: float, probability: float) -> Verdict:
    if inside >= probability:
        return "conforms"
    return "does not conform" if inside <= 1 - probability else "cannot tell"


def undecided(decision: ConformityDecision) -> ConformityDecision:
    """decision on a result that is in doubt → none: no probability stands that rests on a model or a budget found wanting."""
    return replace(decision, inside=None, verdict="cannot tell")


def all_conform(decisions: Sequence[ConformityDecision]) -> bool:
    """decisions → whether every one of them is `conforms` (and there is one)."""
    return bool(decisions) and all(d.verdict == "conforms" for d in decisions)


def as_json(decisions: Sequence[ConformityDecision]) -> Mapping[str, object]:
    """decisions → plain data by name; a missing limit is null."""

    def end(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return {
        d.name: {
            "limits": [end(d.limits.low), end(d.limits.high)],
            "probability_inside": d.inside,
            "verdict": d.verdict,
            "uses": d.uses,
        }
        for d in decisions
    }
