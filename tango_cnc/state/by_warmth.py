"""How much of a night a machine that is warmer may have done, and whether one cause beside it says more of that night.

A temperature that moves every error as far as it likes explains any night. What counts is how far: errors per kelvin come from
what this machine has shown, or from what machines do, and all of one night are of one size. A step of one error that no machine
makes for so few kelvins costs more than a cause of its own (Bayes factor; MacKay 1992, Kass & Raftery 1995).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import linalg

from ..records import Array
from .filter import OFF, State, per_kelvin, unknown
from .frame import Frame

SIZES = np.geomspace(1.0, 1 / 64, 13)  # times the most that a kelvin does: how much it does to all errors of one night
NEAR = 6.0  # of the evidence: what is nearer fits nearly as well


class BesideWarmth(NamedTuple):
    """A cause beside temperature: its place among those tried, whether it comes first, whether temperature fits nearly as well."""

    place: int
    first: bool
    near: bool


@dataclass(frozen=True)
class PerKelvin:
    """What a K does to each of the (q,) errors beside what the state knows, how far it may move them from that, whether an alarm
    has shown it, and {parameter: per K, standard deviation} that nights have shown without one.
    """

    mean: Array
    most: Array
    learned: bool
    shown: Mapping[str, tuple[float, float]]


def what_kelvins_do(state: State, followed: Frame, shown: Mapping[str, tuple[float, float]]) -> PerKelvin:
    """predicted state, frame, what nights have shown of parameters → what each K does to the errors of this machine.

    What nights have shown without an alarm counts for as much as it is surer than what machines do.
    """
    most, learned = per_kelvin(followed, state), not unknown(followed, state)
    mean, rates = np.zeros(len(most)), dict[str, tuple[float, float]]()
    for j, (i, m) in enumerate(zip(followed.warm, most, strict=True)):
        name = followed.selection.label(followed.names[i])
        if learned or name not in shown:
            continue
        rate, std = shown[name]
        share = float(m**2 / (m**2 + std**2))  # of what is shown, beside what machines do
        mean[j], std = share * rate, share**0.5 * std
        rates[name] = float(mean[j]), std
        most[j] = min(float(m), float(np.hypot(std, OFF * m)))
    return PerKelvin(mean, most, learned, rates)


def rival(
    due: Array, own: Array, patterns: Sequence[Array], white: Array, scale: float, learned: bool, beyond: Array
) -> BesideWarmth | None:
    """(k,) what temperature does to white innovations by what nights have shown, (k, q) what it does at most beside that, (k,)
    innovations, (k, m) patterns of other causes, variance, whether an alarm has shown what each K does, which of these causes are a
    step that no machine makes for so few → the cause that explains the night better than temperature does, or nearly as well, by
    itself or together with it; None where no cause does.

    Where nothing is known, one error may follow the temperature and no other: a cause beside it comes first for its size only.
    """
    y, a, price = white / np.sqrt(scale), own / np.sqrt(scale), np.log(len(white))
    left = y - due / np.sqrt(scale)
    gain = float(y @ y - left @ left)
    warm, found = gain + _evidence(a, left), []
    for place, pattern in enumerate(patterns):
        basis = linalg.orth(pattern)
        costs, along, both = price * basis.shape[1], basis.T @ y, basis.T @ left
        alone = float(along @ along) - costs
        together = gain + float(both @ both) - costs + _evidence(a - basis @ (basis.T @ a), left - basis @ both)
        found.append((max(alone, together - NEAR), place, alone))
    if not found:
        return None
    best, place, alone = max(found)
    if best <= warm and alone <= warm - NEAR:
        return None
    first = best > warm + NEAR and (learned or beyond[place] or alone >= best)
    return BesideWarmth(place, first or alone > warm - NEAR, best < warm + NEAR or not learned)


def _evidence(a: Array, y: Array) -> float:
    """(k, q) what each error does at most, (k,) innovations → twice the logarithm of how much likelier errors of one size, whatever
    that is, make them than none.
    """
    basis, size, _ = linalg.svd(a, full_matrices=False)
    power = (SIZES[:, None] * size) ** 2
    told = power / (1 + power) @ (basis.T @ y) ** 2 - np.sum(np.log1p(power), axis=1)
    return float(told.max())
