"""What the best judge could do: it knows the noise, that exactly one cause is hidden, and the patterns of all of the catalogue.

It names the cause whose best pattern the readings fit best (chi-squared of what the pattern takes, by its coefficients), among
the settings that the diagnosis tries. A diagnosis knows less, so this share says about how much the touches hold.

That judge knows that there is a cause. One who does not names it only where the noise alone would reach as much in 2 of 100 runs
at most, over the whole catalogue. That is the floor of what a diagnosis can miss: not even who knows the noise names more.
Who is given the one pattern that may be there, with its setting, and pays for the whole catalogue, finds it with a power
that has a formula (chi-squared of one degree of freedom, not central).

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
FALSE = 0.02  # of runs of noise in which something is named: as the limit of the diagnosis
RUNS = 200  # of noise that set the limit
SEEN = 0.02  # least part of a pattern that the model of the machine leaves


@dataclass(frozen=True)
class Call:
    """What was hidden, what the best judge names, and how much likelier the hidden cause is than the next other one (logarithm)."""

    hidden: str
    named: str
    ahead: float
    beyond: bool  # whether noise alone names so much in 2 of 100 runs at most
    told: float  # power of a test of the one pattern that is hidden, at this limit


@dataclass(frozen=True, eq=False)
class Patterns:
    """What the model of the machine leaves of every pattern of the catalogue, (n, k) orthonormal each."""

    causes: tuple[str, ...]  # of every pattern
    columns: np.ndarray  # (n, K) of all patterns
    size: np.ndarray  # (patterns,) k

    def unlikely(self, data: np.ndarray) -> np.ndarray:
        """(n, B) in standard deviations of a touch → (patterns, B): −log of the chance that noise gives a pattern as much."""
        begins = np.concatenate([[0], np.cumsum(self.size)[:-1]])
        taken = np.add.reduceat((self.columns.T @ data) ** 2, begins, axis=0)
        return _unlikely(taken, self.size[:, None].astype(float))

    def limit(self, outside: np.ndarray, rng: np.random.Generator) -> float:
        """projector (n, n) → what the largest of all patterns reaches in `FALSE` of many runs of noise."""
        noise = outside @ rng.normal(size=(len(outside), RUNS))
        return float(np.quantile(self.unlikely(noise).max(axis=0), 1 - FALSE))


def patterns(b: blind.Bench, eye: blind.Eyes) -> Patterns:
    """bench, its eyes → patterns of the catalogue that its touches can see."""
    model = estimate(b.cell.machine, b.cell.artefact, b.clean, b.cell.terms).model
    causes, columns = [], []
    for c in named(model.touches, model.names, ()):
        left = eye.outside @ c.columns
        if np.linalg.norm(left) > SEEN * np.linalg.norm(c.columns):
            u, s, _ = np.linalg.svd(left, full_matrices=False)
            causes.append(c.cause)
            columns.append(u[:, s > 1e-6 * s[0]])
    return Patterns(tuple(causes), np.hstack(columns), np.array([q.shape[1] for q in columns]))


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
        every = patterns(b, eye)
        limit = every.limit(eye.outside, np.random.default_rng(seed))
        for _ in range(4 if touches else draws):
            hidden = _drawn(b, eye, peak, rng)
            if hidden is not None:
                noise = rng.normal(scale=blind.NOISE, size=len(hidden.change))
                found.append(_call(hidden, eye.outside, noise, every, limit))
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


def _call(hidden: blind.Visible, outside: np.ndarray, noise: np.ndarray, every: Patterns, limit: float) -> Call:
    """what is hidden, projector (n, n), noise (n,) mm, patterns, limit → what the judge says."""
    from scipy import stats

    own, left = str(hidden.effect["cause"]), outside @ hidden.change / blind.NOISE
    likely: dict[str, float] = {}
    for cause, value in zip(every.causes, every.unlikely((left + outside @ noise / blind.NOISE)[:, None])[:, 0], strict=True):
        likely[cause] = max(likely.get(cause, 0.0), float(value))
    first = max(likely, key=lambda c: likely[c])
    ahead = likely.get(own, 0.0) - max(v for c, v in likely.items() if c != own)
    told = float(stats.ncx2.sf(stats.chi2.isf(np.exp(-limit), 1), 1, float(left @ left)))
    return Call(own, first, ahead, likely[first] > limit, told)


def _unlikely(taken: np.ndarray, k: np.ndarray) -> np.ndarray:
    """chi-squared, degrees of freedom → −log of the chance of more; the first term of its expansion where it is below 1e-300."""
    from scipy import stats  # slow to load, and every worker reads this file

    log = stats.chi2.logsf(taken, k)
    further = taken / 2 - (k / 2 - 1) * np.log(np.maximum(taken, 1.0) / 2) + special.gammaln(k / 2)
    return np.asarray(np.where(np.isfinite(log), -log, further))


@dataclass(frozen=True)
class Row:
    """Shares of the draws."""

    first: float  # right name first, by a judge who knows that there is a cause
    clear: float  # ahead of every other name by 20 to 1
    floor: float  # right name first, and beyond what noise reaches
    told: float  # mean power of a test of the one pattern that is hidden


def row(touches: int, peak: float, draws: int, seed: int) -> Row:
    """touches, peak mm, draws, seed → shares."""
    found = calls(touches, peak, draws, seed)
    right = np.array([c.named == c.hidden for c in found])
    clear, beyond, told = (
        np.array([f(c) for c in found]) for f in (lambda c: c.ahead > CLEAR, lambda c: c.beyond, lambda c: c.told)
    )
    return Row(float(right.mean()), float(clear.mean()), float((right & beyond).mean()), float(told.mean()))


if __name__ == "__main__":
    one = row(int(sys.argv[1]), float(sys.argv[2]) / 1000, int(sys.argv[3]), int(sys.argv[4]) if len(sys.argv) > 4 else 61)
    print(f"{sys.argv[1]} touches, {sys.argv[2]} µm: right first {one.first:.2f}, ahead by 20 to 1 {one.clear:.2f}")
    print(f"right first and beyond what noise reaches {one.floor:.2f}; the one pattern is found {one.told:.2f}")
