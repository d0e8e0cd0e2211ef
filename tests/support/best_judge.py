"""What the best judge could do: it knows the noise, that exactly one cause is hidden, and the patterns of all of the catalogue.

It names the cause whose best pattern the readings fit best (chi-squared of what the pattern takes, by its coefficients), among
the settings that the diagnosis tries. A diagnosis knows less, so this share says about how much the touches hold.

python tests/support/best_judge.py 61 3 100      touches, visible peak in µm, draws; 0 touches: the whole plan of HU40T
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from sim_controller.simulate import simulate
from support import blind
from support.diagnosis_parts import named
from tango_cnc.estimate import estimate
from tango_cnc.records import InputError, Strategy

CLEAR = 3.0  # natural logarithm of 20: as much likelier than the next other cause is what a name needs
SEEN = 0.02  # least part of a pattern that the model of the machine leaves


@dataclass(frozen=True)
class Call:
    """What was hidden, what the best judge names, and how much likelier the hidden cause is than the next other one (logarithm)."""

    hidden: str
    named: str
    ahead: float


def part(strategy: Strategy, touches: int, rng: np.random.Generator) -> Strategy:
    """strategy, number of touches → whole indexations of it drawn at random, at most so many touches and at least three fewer."""
    while True:
        taken, count = [], 0
        for i in rng.permutation(len(strategy.indexations)):
            size = len(strategy.indexations[i].facets)
            if count + size <= touches:
                taken.append(int(i))
                count += size
        if count >= touches - 3:
            return replace(strategy, indexations=tuple(strategy.indexations[i] for i in sorted(taken)))


def plans(touches: int, rng: np.random.Generator) -> Iterator[blind.Bench]:
    """number of touches (0: all) → benches of HU40T, each with another part of the plan."""
    whole = blind.bench()
    while True:
        if not touches:
            yield whole
            continue
        strategy = part(whole.cell.strategy, touches, rng)
        yield replace(
            whole,
            cell=replace(whole.cell, strategy=strategy),
            clean=simulate(whole.cell.machine, whole.cell.artefact, strategy, whole.world),
        )


def calls(touches: int, peak: float, draws: int, seed: int) -> list[Call]:
    """touches (0: all), visible peak mm, how many, seed → a call for each; four draws to a part of the plan."""
    rng = np.random.default_rng(seed)
    found: list[Call] = []
    for b in plans(touches, rng):
        eye = blind.eyes.__wrapped__(b)
        model = estimate(b.cell.machine, b.cell.artefact, b.clean, b.cell.terms).model
        patterns = []
        for c in named(model.touches, model.names, ()):
            left = eye.outside @ c.columns
            if np.linalg.norm(left) > SEEN * np.linalg.norm(c.columns):
                u, s, _ = np.linalg.svd(left, full_matrices=False)
                patterns.append((c.cause, u[:, s > 1e-6 * s[0]]))
        for _ in range(4 if touches else draws):
            hidden = _drawn(b, eye, peak, rng)
            if hidden is not None:
                noise = rng.normal(scale=blind.NOISE, size=len(hidden.change))
                found.append(_call(str(hidden.effect["cause"]), eye.outside @ (hidden.change + noise), patterns))
            if len(found) == draws:
                return found
    raise AssertionError("plans end")


def _drawn(b: blind.Bench, eye: blind.Eyes, peak: float, rng: np.random.Generator) -> blind.Visible | None:
    cause = str(rng.choice(blind.DRAWN))
    for _ in range(6):
        try:
            found = blind.visible(b, blind.draw(b, cause, rng), peak, eye.outside, eye.normal)
        except (InputError, ValueError, IndexError):  # a short plan has no such place
            continue
        if found is not None:
            return found
    return None


def _call(hidden: str, data: np.ndarray, patterns: list[tuple[str, np.ndarray]]) -> Call:
    likely: dict[str, float] = {}
    for cause, q in patterns:
        taken = float(np.sum((q.T @ data) ** 2)) / blind.NOISE**2
        likely[cause] = max(likely.get(cause, 0.0), _unlikely(taken, q.shape[1]))
    first = max(likely, key=lambda c: likely[c])
    return Call(hidden, first, likely.get(hidden, 0.0) - max(v for c, v in likely.items() if c != hidden))


def _unlikely(taken: float, k: int) -> float:
    """chi-squared, degrees of freedom → −log of the chance of more; the first term of its expansion where it is below 1e-300."""
    from scipy import stats  # slow to load, and every worker reads this file

    log = float(stats.chi2.logsf(taken, k))
    return -log if np.isfinite(log) else taken / 2 - (k / 2 - 1) * np.log(taken / 2) + float(special.gammaln(k / 2))


def row(touches: int, peak: float, draws: int, seed: int) -> tuple[float, float]:
    """touches, peak mm, draws, seed → shares: right name first, and ahead of every other name by 20 to 1."""
    found = calls(touches, peak, draws, seed)
    return float(np.mean([c.named == c.hidden for c in found])), float(np.mean([c.ahead > CLEAR for c in found]))


if __name__ == "__main__":
    first, clear = row(int(sys.argv[1]), float(sys.argv[2]) / 1000, int(sys.argv[3]), 61)
    print(f"{sys.argv[1]} touches, {sys.argv[2]} µm: right first {first:.2f}, ahead by 20 to 1 {clear:.2f}")
