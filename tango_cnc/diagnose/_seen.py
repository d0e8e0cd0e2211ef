"""Residuals against everything that is known of a touch: a test for each, before any cause is claimed; and what would tell
two causes apart.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from .. import terms as families
from ..records import Array
from ..texts import joined, say
from ..touches import Touches
from ._candidates import candidate, covariates
from ._catalogue import Chosen, columns_of
from ._explain import Explanation
from ._gain import residual_maker
from ._records import Remainder
from ._space import UNSEEN

BINS = 8
REJECTED = 0.01
NOTHING = 0.001


@dataclass(frozen=True)
class Test:
    """Lack of fit over one covariate: are the means of its bins zero?"""

    covariate: str
    variance_share: float  # of the residuals' variance that the bins take, beyond what chance takes
    p_value: float
    centre: Array  # (b,) of each bin
    mean: Array  # (b,) mm; of a shift: by how much
    band: Array  # (b,) mm, two standard deviations of such a mean when the model is right


def axes_of(touches: Touches) -> dict[str, Array]:
    """touches → every covariate (n,), numbers: time, order, positions, directions, history, temperatures."""
    result = {name: values for name, (_, values) in covariates(touches).items()}
    result["indexation"] = touches.indexation.astype(float)
    result["facet"] = np.array([list(touches.artefact.facets).index(f) for f in touches.facet], dtype=float)
    frames = (("machine", touches.machine_normal), ("table", touches.normal), ("spindle", touches.spindle_normal))
    for frame, normal in frames:
        for i, letter in enumerate("xyz"):
            if np.ptp(normal[:, i]) > 0.01:
                result[f"normal {letter}, {frame}"] = normal[:, i]
    for axis in (*touches.machine.linear, *touches.machine.rotary):
        sign = touches.sign(axis)
        if len(set(sign) - {0.0}) == 2:
            result[f"d{axis}"] = sign
        way = np.abs(np.diff(touches.axis(axis), prepend=touches.axis(axis)[:1]))
        if np.ptp(way) > 1e-3:
            result[f"way of {axis}"] = way
    return result


def seen_over(touches: Touches) -> dict[str, tuple[Array, Array]]:
    """touches → covariate: its values (n,) and how a touch sees what is looked for (n,): 1, or the normal for a shift.

    A drift of the table moves a touch by its normal: over time it is looked for as a shift in each direction of both frames.
    """
    one = np.ones(len(touches))
    result = {name: (values, one) for name, values in axes_of(touches).items()}
    for frame, normal in (("machine", touches.machine_normal), ("table", touches.normal)):
        for i, letter in enumerate("xyz"):
            if np.ptp(normal[:, i]) > 0.5:
                result[f"shift {letter}, {frame}"] = touches.time, np.where(np.abs(normal[:, i]) > 0.1, normal[:, i], 0.0)
    return result


def bins(values: Array, count: int = BINS) -> NDArray[np.int64]:
    """(n,) → (n,) number of the bin: each value its own where there are few, equal counts otherwise."""
    distinct = np.unique(np.round(values, 9))
    if len(distinct) <= 3 * count:
        return np.searchsorted(distinct, np.round(values, 9)).astype(np.int64)
    edges = np.unique(np.quantile(values, np.linspace(0, 1, count + 1)[1:-1]))
    return np.searchsorted(edges, values, side="right").astype(np.int64)


def tests(design: Array, data: Array, touches: Touches, keep: NDArray[np.bool_], certain: Array | None = None) -> tuple[Test, ...]:
    """design (n + known, p), data, touches, rows that count, weight of each row → one test a covariate, most significant first.

    Weights are those that make the scatter even: rough facets would follow everything that goes with them.
    """
    n = len(touches)
    certain = np.ones(len(design)) if certain is None else certain
    design, data, own = design * certain[:, None], data * certain, certain[:n]
    maker = residual_maker(np.hstack([design, np.eye(len(design))[:, np.flatnonzero(~keep)]]))
    left = maker @ data
    free = float(np.trace(maker))
    whole = float(left @ left)
    result = []
    for name, (values, weight) in seen_over(touches).items():
        member = bins(values)
        used = np.unique(member)
        columns = np.zeros((len(design), len(used)))
        columns[:n] = (member[:, None] == used[None, :]) * (weight * own)[:, None]
        inside = maker @ columns
        # Real positions hold the noise: what is left of a facet that the model has already is noise by its very making.
        u, s, _ = np.linalg.svd(inside / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), full_matrices=False)
        u = u[:, s > UNSEEN]
        k = u.shape[1]
        if not k or free <= k:
            continue
        taken = float(np.sum((u.T @ left) ** 2))
        rest = max(whole - taken, 1e-30)
        p = float(special.fdtrc(k, free - k, taken / k / (rest / (free - k))))
        share = max(0.0, 1 - rest / (free - k) / (whole / free))
        rows = [np.flatnonzero(keep & (member == b) & (weight != 0)) for b in used]
        parts = [weight[r] / own[r] / float(weight[r] @ weight[r]) if len(r) else weight[r] for r in rows]
        mean = np.array([float(w @ left[r]) for w, r in zip(parts, rows, strict=True)])
        sigma = np.sqrt(whole / free)
        band = np.array(
            [2 * sigma * np.sqrt(max(float(w @ maker[np.ix_(r, r)] @ w), 0.0)) for w, r in zip(parts, rows, strict=True)]
        )
        centre = np.array([values[member == b].mean() for b in used])
        result.append(Test(name, share, p, centre, mean, band))
    return tuple(sorted(result, key=lambda t: t.p_value))


def left_over(tests: Sequence[Test], explained: bool, own: Collection[str] = ()) -> list[Remainder]:
    """tests with all that was found, whether it was anything, covariates of the names → what the residuals still depend on.

    At 1 % beside something that was found, over the covariates that the names follow, and again over all (Bonferroni). Where
    nothing was, and no cause or shape was worth its price, the scatter itself may differ, and the tests believe in even scatter:
    at 1 in 1000.
    """
    wrong = [t for t in tests if t.covariate in own][:1]
    wrong = wrong if wrong and wrong[0].p_value * len(own) < REJECTED else list(tests[:1])
    asked = len(own) if wrong and wrong[0].covariate in own else len(tests)
    if not wrong or wrong[0].p_value * asked > (REJECTED if explained else NOTHING):
        return []
    worst = wrong[0]
    size = float(np.abs(worst.mean).max())
    return [Remainder(worst.covariate, "none", "lack of fit" if explained else "no pattern", size, 0.0, np.zeros(1))]


@dataclass(frozen=True)
class Extra:
    """One indexation that tells two causes apart."""

    source: int  # number of the indexation of the plan that it repeats
    spindle: float  # rad
    facets: tuple[str, ...]
    better: float  # times the difference that the present touches see (squared, in units of the noise)
    row: int  # a touch of that indexation


def extras(e: Explanation, touches: Touches, one: Chosen, others: Sequence[Chosen], most: int = 4) -> list[Extra]:
    """explanation, a cause and its alternatives → indexations, appended to the plan, that tell them apart; best first.

    The difference between the patterns that the alternative cannot imitate is what a touch has to see. Every indexation of
    the plan is tried again at the end of the test, with every orientation of the spindle.
    """
    if not others:
        return []
    spindle = sorted({round(float(s), 6) for s in touches.axis("S")} | {0.0, float(np.pi)})
    n, column = len(touches), touches.machine.column("S")
    result = []
    gap = float(np.median(np.diff(touches.time))) if n > 1 else 5.0
    for number in np.unique(touches.indexation):
        rows = np.flatnonzero(touches.indexation == number)
        for angle in spindle:
            position = touches.position[rows].copy()
            position[:, column] = angle
            index = np.concatenate([np.arange(n), rows])
            longer = taken(touches, index, position, gap)
            score = 0.0
            for other in others:
                new = _discrepancy(e, longer, one, other, rows, n)
                score += float(np.sum(new**2))
            gains = score
            result.append((gains, number, angle, rows))
    result.sort(key=lambda x: -x[0])
    base = max(sum(float(np.sum(_seen_difference(e, one, o) ** 2)) for o in others), 1e-30)
    return [
        Extra(int(number), float(angle), tuple(touches.facet[r] for r in rows), 1 + score / base, int(rows[0]))
        for score, number, angle, rows in result[:most]
    ]


def _seen_difference(e: Explanation, one: Chosen, other: Chosen) -> Array:
    mine = one.columns @ np.linalg.lstsq(one.columns, e.place.y, rcond=None)[0]
    rest = mine - other.columns @ np.linalg.lstsq(other.columns, mine, rcond=None)[0]
    return np.asarray(rest)


def _discrepancy(e: Explanation, longer: Touches, one: Chosen, other: Chosen, rows: NDArray[np.int64], n: int) -> Array:
    """→ (r,) by how much the two causes, both fitted to the touches made, disagree about the touches to come."""
    mine = candidate(longer, one.candidate.cause, one.candidate.setting).columns
    theirs = candidate(longer, other.candidate.cause, other.candidate.setting).columns
    a = np.linalg.lstsq(one.columns, e.place.y, rcond=None)[0]
    target = one.columns @ a
    b = np.linalg.lstsq(other.columns, target, rcond=None)[0]
    return np.asarray(mine[n:] @ a - theirs[n:] @ b)


def taken(touches: Touches, index: NDArray[np.int64], tail: Array, gap: float) -> Touches:
    """touches, rows, positions of the rows at the end → touches as if these had been made after the others."""
    n = len(touches)
    extra = len(index) - n
    time = np.concatenate([touches.time, touches.time[-1] + gap * np.arange(4, 4 + extra)])
    longer = np.vstack([touches.position, tail])
    return replace(touches.rows(index), number=np.arange(1, len(index) + 1), position=longer, time=time)


def separate(e: Explanation, touches: Touches, one: Chosen, others: Sequence[Chosen]) -> tuple[str, ...]:
    """explanation, a cause and its alternatives → which few touches would tell them apart, in words."""
    found = extras(e, touches, one, others, 2)
    names = joined(say("unseen_said.and"), dict.fromkeys(o.candidate.cause for o in others))
    result: list[str] = []
    for x in found:
        place = ", ".join(
            f"{a} {np.degrees(touches.position[x.row, touches.machine.column(a)]):.0f}" for a in touches.machine.rotary
        )
        facets = ", ".join(x.facets[:6]) + (" …" if len(x.facets) > 6 else "")
        result.append(
            say(
                "diagnosis_said.separate",
                indexation=x.source + 1,
                place=place,
                spindle=f"{np.degrees(x.spindle):.0f}",
                facets=facets,
                names=names,
            )
        )
    result += parted(one.candidate.cause, [o.candidate.cause for o in others])
    return tuple(dict.fromkeys(result))  # six facets stand in a proposal, so two of more facets may read alike


def parted(cause: str, others: Sequence[str]) -> list[str]:
    """name of a cause, of its alternatives → what their files say to do beside the touches of the plan, so that they differ."""
    known = families.causes()
    pairs = [(a, b) for other in others if cause in known and other in known for a, b in ((cause, other), (other, cause))]
    return [known[a].parted[b] for a, b in pairs if b in known[a].parted]


__all__ = ["Extra", "Test", "axes_of", "bins", "columns_of", "extras", "parted", "seen_over", "separate", "tests"]
