"""The fit by the noise that the residuals show: the system, its robust start, its components (see the package)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, special

from ..estimate import SIGMA_FLOOR, Estimate, Noise
from ..records import Array
from ._decomposed import eigen, singular
from ._start import positive, reachable
from ._system import PLAIN, WIDER, System, beside, drifting, smooth, system
from .tails import tails, thinned

WORTH = 4.0  # twice the gain in log likelihood that a component needs
RANGE = (-20.0, 25.0)  # of the logarithm of a component's variance over the white one
COARSE = np.arange(-20.0, 25.5, 0.5)  # steps of it, and the finer ones beside the best of them
NEAR = np.arange(-0.5, 0.55, 0.05)
SCORED = 40  # steps of Fisher's scoring, at most; a handful is usual
FARTHEST = 4.0  # of a step of it
NEWTON = 12  # steps to the white scatter that fits best
HALVED = 8  # times that a step is halved before there is nothing more to gain
SAME = 0.005  # of the deviance, by which two solutions are the same
LARGEST = 1500  # touches of which the noise is taken apart
FAINT = 1e-4  # share of the largest singular value below which touches tell nothing of a direction
ROUNDS = 8  # of looking again at who fits
HALF = 0.35  # share of all touches without weight beyond which it is no matter of single touches
UNSURE = 0.01  # odds that the dropped touches of a facet are the right ones, above which none of it counts
UNKNOWN = 0.75  # leverage above which a touch is predicted by hardly anything
LOOSE = 1e-3  # least share of its variance that is left of a touch in the fit
CLOSE = 0.05  # least share of its variance by which a touch is weighed: a ball may rest on two
SHARES = 5  # steps to the weights of heavy tails, each of which leaves a third of the way
CUT = 4.5  # standard deviations beyond which a touch has no weight
PRIOR = 4.0  # touches that the common scatter counts for in that of a facet
FEWEST = 2.5  # touches to spare on a facet that is judged by its own scatter
ROUGH = 1e-3  # chance that a facet is called rough by mistake, all facets together
SURE = 3.0  # standard deviations of itself that a part of the smooth drift must have to be said of the machine
LARGE = 1e4  # standard deviations of a touch that what may have any size is taken to have
FINEST = 1e-5  # mm: residuals below this are rounding, and are left alone


def by_noise(result: Estimate, settled: bool = True) -> Estimate:
    """estimate → the same model with parameters, standard deviations and outliers by the noise that its residuals show.

    `settled`: it is where least squares leaves it, so that white noise alone asks for nothing more.
    """
    touches = result.model.touches
    if result.sigma < FINEST or result.dof < 8:
        return result
    s = system(result)
    keep = reachable(s)
    rough = np.ones(len(touches))
    group = np.where(touches.ball_index < 0, np.unique(touches.facet, return_inverse=True)[1], -1 - touches.ball_index)
    fitted = gls(s, keep, rough)
    for _ in range(ROUNDS):
        again = _fits(fitted, keep, rough, group)
        if again.sum() - len(result.values) < 4:
            break
        rough_now = _rough(result, fitted, again)
        if np.array_equal(again, keep) and np.allclose(rough_now, rough):
            break
        keep, rough = again, rough_now
        fitted = gls(s, keep, rough)
    decided = keep & ~_undecided(keep, group)
    if decided.sum() - len(result.values) < 4:  # nothing would be left to decide from
        decided = keep
    if not np.array_equal(decided, keep):
        fitted = gls(s, decided, rough)
    last, factor = _settled(s, decided, rough, fitted)
    if settled and fitted.white and keep.all() and np.all(rough == 1) and last is fitted:
        return replace(result, rejected=np.zeros(len(touches), dtype=np.bool_), noise=Noise(result.sigma))
    facets = {f: float(fitted.sigma * r) for f, r in zip(touches.facet, rough, strict=True) if r > 1}
    undecided = tuple(int(i) for i in touches.number[keep & ~decided])
    noise = Noise(
        fitted.sigma, fitted.walk, fitted.seating, facets, undecided=undecided, columns=fitted.columns, chance=fitted.chance
    )
    residuals = result.residuals + s.jacobian @ (last.change / s.scale)
    dof = result.dof - int((~decided).sum())
    return replace(
        result,
        values=result.values + last.change,
        covariance=last.covariance * factor**2,
        residuals=residuals,
        sigma=float(np.sqrt(residuals[decided] @ residuals[decided] / max(dof, 1))),
        dof=dof,
        rejected=~keep,
        unsure=keep & ~decided,
        noise=noise,
    )


def _fits(fitted: Fitted, keep: NDArray[np.bool_], rough: Array, group: NDArray[np.int64]) -> NDArray[np.bool_]:
    """fit, touches with weight, scatter of each against the common one, its facet or ball → touches no further off than by chance.

    A touch in the fit draws it to itself, one outside is judged by a fit that is uncertain there: variances σ² (1 ∓ h) with its
    leverage h (Cook and Weisberg 1982, 2.2). With few touches to spare the scatter itself is uncertain: Student's t. Of a facet
    that the fit hardly knows one touch comes back at a time, so that two that contradict each other do not both.
    """
    n, spare = int(keep.sum()), max(fitted.spare, 1.0)
    tail = min(float(special.ndtr(-CUT)), 0.25 / n * float(special.ndtr(-CUT) / special.ndtr(-3.5)))
    cut = -float(special.stdtrit(spare, tail))
    std = fitted.sigma * rough * np.sqrt(np.where(keep, np.maximum(1 - fitted.lever, LOOSE), 1 + fitted.lever))
    off = np.abs(fitted.left) / std
    inside = np.asarray(off < cut)
    for one in np.unique(group[inside & ~keep & (fitted.lever > UNKNOWN)]):
        rows = np.flatnonzero((group == one) & inside & ~keep & (fitted.lever > UNKNOWN))
        inside[rows] = False
        inside[rows[np.argmin(off[rows])]] = True
    return inside


def _undecided(keep: NDArray[np.bool_], group: NDArray[np.int64]) -> NDArray[np.bool_]:
    """touches with weight, their facet or ball → (n,) touches of which nobody can say whether they or their neighbours are wrong.

    Where a share r of all touches is wrong, those k of n on one facet that were dropped are the right ones with odds of
    (r / (1 - r))^(n - 2 k). A ball has a third of its touches along each direction.
    """
    rate = max(float((~keep).mean()), 1 / len(keep))
    found = np.zeros(len(keep), dtype=np.bool_)
    for one in np.unique(group[~keep]):
        if rate > HALF and one >= 0:
            continue  # something else is wrong
        rows = group == one
        count = rows.sum() / (3 if one < 0 else 1)
        odds = (rate / (1 - rate)) ** (count - 2 * (rows & ~keep).sum())
        found |= rows & (odds > UNSURE)
    return found


def _settled(s: System, keep: NDArray[np.bool_], rough: Array, fitted: Fitted) -> tuple[Fitted, float]:
    """system, touches with weight, their scatter against the common one, the fit by that → the last fit, factor of its standard
    deviations. Where tails are heavy, touches far off count for less, and the factor is that of Student's t.
    """
    found = tails(_standard(fitted, rough)[keep], fitted.spare)
    if found is None:
        return fitted, thinned(fitted.left / (fitted.sigma * rough), CUT)
    nu, share = found
    scatter, last = share * fitted.sigma, fitted
    for _ in range(SHARES):
        off = _standard(replace(last, sigma=scatter), rough)
        last = gls(s, keep, rough / np.sqrt((nu + 1) / (nu + off**2)), fitted.white)
        scatter = last.sigma
    return last, float(np.sqrt((nu + 3) / (nu + 1)))


def _standard(fitted: Fitted, rough: Array) -> Array:
    """→ (n,) residuals over their scatter, less where a touch draws the fit to itself."""
    return np.asarray(fitted.left / (fitted.sigma * rough * np.sqrt(np.maximum(1 - fitted.lever, CLOSE))))


@dataclass(frozen=True)
class Fitted:
    """What generalised least squares gave."""

    change: Array  # (p,) of the unknowns
    covariance: Array  # (p, p)
    left: Array  # (n,) mm, white part of every touch's residual
    sigma: float  # mm, white
    walk: float  # mm, root mean square over the touches
    seating: float
    white: bool
    residual: Array  # (n,) mm, of every touch, walk and seating in it
    lever: Array  # (n,) variance of every touch as the fit predicts it, over that of the touch
    spare: float  # touches more than what was taken out of them
    columns: Array | None = None  # (n, q) walk and seating, of which one standard deviation is 1, over sigma; None without them
    chance: float = 0.0  # mm, root mean square in `residual` of the smooth drift that chance may have made


def gls(s: System, keep: NDArray[np.bool_], rough: Array, white: bool = False) -> Fitted:
    """rows with weight, scatter of each against the common one → generalised least squares; `white`: neither walk nor seating.

    Where there is a walk, its smooth part may have any size: a warm-up is all slow functions and nothing of the fast ones, so that
    the one variance of them all would promise less drift than there is. Some of it is nearly what errors of the machine make as
    well, and comes out large by chance: `walk` counts only what is sure. The covariance has all of it.
    """
    found = _gls(s, keep, rough, white)
    p, slow = len(s.values), smooth(s)
    if not found.walk or keep.sum() <= p + slow.sum() + 8:
        return found
    weight = 1 / rough[keep, None]
    turn, seen = beside(s.walk[np.ix_(keep, slow)] * weight, _basis(s.jacobian[keep] * weight)[0], PLAIN)
    variance = found.walk**2 / float(np.mean(np.sum(s.walk**2, axis=1)))
    free = drifting(s, turn, seen, variance)
    again = _gls(free, keep, rough, False)
    change = again.change[:p]
    residual = s.gaps + s.jacobian @ (change / s.scale)
    drift = free.jacobian[:, p:]
    sure, every = _sure(drift, again.change[p:] / free.scale[p:], again.covariance[p:, p:], free.scale[p:])
    wandered = max(found.walk, float(np.sqrt(sure + again.walk**2)))
    chance = float(np.sqrt(max(every - (wandered**2 - again.walk**2), 0.0)))
    size = np.sqrt(np.mean(drift**2, axis=0))
    free_of = np.arange(drift.shape[1]) < seen.sum()
    any_size = drift * np.where(free_of, LARGE / np.maximum(size, 1e-300), WIDER * np.sqrt(variance) / again.sigma)
    columns = any_size if again.columns is None else np.hstack([again.columns, any_size])
    covariance = again.covariance[:p, :p]
    found = replace(again, change=change, covariance=covariance, residual=residual, columns=columns)
    return replace(found, walk=wandered, white=False, chance=chance)


def _sure(smooth: Array, size: Array, covariance: Array, scale: Array) -> tuple[float, float]:
    """(n, q) smooth functions, (q,) how much of each was found, its covariance over (q,) scale → mm², mean squares of what stands
    out of its uncertainty, direction by direction, and of all.
    """
    root = np.linalg.qr(smooth / np.sqrt(len(smooth)))[1]
    variance, turn = eigen(root @ (covariance / np.outer(scale, scale)) @ root.T)
    square = (turn.T @ (root @ size)) ** 2
    return float(square[square > SURE**2 * variance].sum()), float(square.sum())


def _gls(s: System, keep: NDArray[np.bool_], rough: Array, white: bool) -> Fitted:
    parts = [part for part in (s.walk, s.seats) if part.shape[1] and not white]
    weight = 1 / rough[keep]
    j, gaps = s.jacobian[keep] * weight[:, None], s.gaps[keep] * weight
    # Without the touches that fix it, the scale is a combination of columns as small as the residuals, and equal to them: it
    # would explain them all. Such directions are left to what was known before.
    p = j.shape[1]
    whole = len(j) <= LARGEST
    basis, rank = _basis(j)
    left = gaps - basis @ (basis.T @ gaps)
    sigma = max(float(np.sqrt(left @ left / max(len(j) - rank, 1))), s.least)
    if whole and parts and len(j) > p + 8:
        weighted = [part[keep] * weight[:, None] for part in parts]
        sigma, ratios = _components(left, [_seen(part, basis) for part in weighted], len(j) - rank, s.repeats)
        sigma = max(sigma, s.least)
    else:
        ratios = [0.0] * len(parts)
    used = [(part, ratio) for part, ratio in zip(parts, ratios, strict=True) if ratio > 0]
    z = np.hstack([part * np.sqrt(ratio) for part, ratio in used]) if used else np.empty((len(s.gaps), 0))
    both = np.hstack([j, z[keep] * weight[:, None]])
    known = np.hstack([s.known, np.zeros((len(s.known), z.shape[1]))])
    normal = both.T @ both + sigma**2 * known.T @ known
    q = np.arange(p, both.shape[1])
    normal[q, q] += 1.0
    # What was known before decides nothing but for what lost all its touches: a facet, a ball, and with it the scale.
    normal[np.arange(p), np.arange(p)] += sigma**2 * s.prior
    pull = both.T @ gaps + sigma**2 * known.T @ s.known_gaps
    pull[:p] += sigma**2 * s.prior * s.values
    inverse = positive(normal, np.eye(len(normal)))
    found = inverse @ pull
    change = -found[:p] * s.scale
    covariance = sigma**2 * inverse[:p, :p] * np.outer(s.scale, s.scale)
    rows = np.hstack([s.jacobian, z])
    left = s.gaps - rows @ found
    lever = np.einsum("ij,jk,ik->i", rows, inverse, rows, optimize=True) / rough**2
    size = {id(part): float(sigma * np.sqrt(ratio * np.mean(np.sum(part**2, axis=1)))) for part, ratio in used}
    return Fitted(
        change,
        covariance,
        left,
        sigma,
        size.get(id(s.walk), 0.0),
        size.get(id(s.seats), 0.0),
        not used,
        s.gaps - s.jacobian @ found[:p],
        lever,
        len(j) - float(lever[keep].sum()),
        z if used else None,
    )


def _basis(jacobian: Array) -> tuple[Array, int]:
    """(n, p) → (n, r) orthonormal basis of what the unknowns do to the touches, r."""
    basis, size = singular(jacobian)
    rank = int((size > FAINT * size[0]).sum())
    return basis[:, :rank], rank


def _seen(part: Array, basis: Array) -> Array:
    """(n, q) columns of a component, (n, r) basis of the unknowns → the columns without what unknowns stand for."""
    turn, seen = beside(part, basis)
    rows = part @ turn[:, seen]
    return np.asarray((rows - basis @ (basis.T @ rows)) @ turn[:, seen].T)


def _components(e: Array, seen: list[Array], n: int, stated: float = 0.0) -> tuple[float, list[float]]:
    """residuals and Z of each component without the unknowns, dimension, mm → white σ, variance of each over σ² (0: not worth it).

    `stated`: the repeatability. A short plan has hardly more touches to spare than Z has columns: walk or seating pass through all
    of them, and the likelihood has no end toward no white scatter. So that has to be paid for (`_white`).
    """
    gram, right, total = np.hstack(seen).T @ np.hstack(seen), np.hstack(seen).T @ e, float(e @ e)
    count = [part.shape[1] for part in seen]
    which = np.repeat(np.arange(len(seen)), count)

    def at(logs: Array) -> tuple[float, float, Array, Array]:
        """logarithms of the ratios, −∞ for none → deviance, variance, slope of the deviance, its expected curvature."""
        d = np.exp(logs / 2)[which]
        rows = np.flatnonzero(d > 0)
        flat = np.zeros(len(logs)), np.zeros((len(logs), len(logs)))
        if not len(rows):
            none, own = _white(np.array([total]), n, stated)
            return float(none[0]), float(own[0]), *flat
        inner = gram[np.ix_(rows, rows)] * np.outer(d[rows], d[rows])
        inner[np.diag_indices_from(inner)] += 1.0
        root, failed = linalg.lapack.dpotrf(inner, lower=1)
        if failed:  # a component so large that rounding has the white scatter: no such noise
            return np.inf, total / n, *flat
        half, _ = linalg.lapack.dtrtri(root, lower=1)
        half = np.tril(half)
        y = half @ (d[rows] * right[rows])
        whole, every = _white(np.array([total - float(y @ y)]), n, stated)
        variance = float(every[0])
        rest = np.eye(len(rows)) - half.T @ half  # what the touches tell of each effect
        member = (which[rows][:, None] == np.arange(len(logs))).astype(np.float64)
        told = np.diag(rest) @ member
        slope = told - (half.T @ y) ** 2 @ member / variance
        curve = member.T @ rest**2 @ member - np.outer(told, told) / n
        return float(whole[0]) + 2 * float(np.log(np.diag(root)).sum()), variance, slope, curve

    alone = [_alone(gram[np.ix_(which == k, which == k)], right[which == k], total, n, stated) for k in range(len(seen))]
    singles = []
    for one in alone:
        x = COARSE[np.argmin(one(COARSE))] + NEAR
        singles.append((float(one(x).min()), float(x[np.argmin(one(x))])))

    def best() -> tuple[float, Array]:
        """All components together, from where each is best alone, by Fisher's scoring (Longford 1987)."""
        starts = [[x for _, x in singles], *([g] * len(seen) for g in (-2.0, 1.0, 4.0))]
        x = min((np.clip(start, *RANGE) for start in starts), key=lambda x: at(x)[0])
        least, _, slope, curve = at(x)
        for _ in range(SCORED):
            step = -np.linalg.solve(curve + np.diag(np.abs(np.diag(curve)) * 1e-3 + 1e-9), slope)
            step *= min(1.0, FARTHEST / max(float(np.abs(step).max()), 1e-300))
            for _ in range(HALVED):
                tried = np.clip(x + step, *RANGE)
                found = at(tried)
                if found[0] < least:
                    break
                step = step / 2
            else:
                break
            gain, x, (least, _, slope, curve) = least - found[0], tried, found
            if gain < SAME:
                break
        return least, x

    none = np.full(len(seen), -np.inf)
    tried = [(at(none)[0], none, 0)]
    tried += [(least, np.where(np.arange(len(seen)) == k, x, none), 1) for k, (least, x) in enumerate(singles)]
    if len(seen) > 1 and any(d < tried[0][0] - WORTH for d, _, k in tried if k == 1):
        tried.append((*best(), len(seen)))
    _, logs, _ = min(tried, key=lambda item: item[0] + WORTH * item[2])
    return float(np.sqrt(at(logs)[1])), np.exp(logs).tolist()


def _white(square: Array, n: int, stated: float) -> tuple[Array, Array]:
    """(m,) mm² left, N, mm of the stated repeatability (0: unknown) → (m,) deviance of the white scatter that fits best, its mm².

    A probe that is taken to be better than stated has to be paid for: half of the scatter costs 1, a quarter 4. With many touches
    that is nothing. The deviance of t = log σ² is convex; Newton's steps come to its end from below.
    """
    t = np.log(np.maximum(square / n, SIGMA_FLOOR**2))
    if stated <= 0:
        return n * t, np.exp(t)
    # but for the constant n, which all of them have: s e^-t is n where nothing is paid
    known, price = 2 * np.log(stated), 1 / np.log(4.0) ** 2
    left = n * np.exp(t)
    for _ in range(NEWTON):
        less = np.maximum(known - t, 0.0)
        t = t - (n - left * np.exp(-t) - 2 * price * less) / (left * np.exp(-t) + 2 * price)
    return n * t + left * np.exp(-t) - n + price * np.maximum(known - t, 0.0) ** 2, np.exp(t)


def _alone(gram: Array, right: Array, total: float, n: int, stated: float = 0.0) -> Callable[[Array], Array]:
    """Z'Z and Z'e of one component, e'e, N, mm of the stated repeatability → its deviance as a function of the logarithms of its
    variance over the white one.

    In the eigenvectors of Z'Z no matrix has to be factored again for each variance.
    """
    value, turn = eigen(gram)
    value, square = np.maximum(value, 0.0), (turn.T @ right) ** 2

    def of(x: Array) -> Array:
        ratio = np.exp(x)[:, None]
        rest = 1 + ratio * value
        left = total - np.sum(ratio * square / rest, axis=1)
        return np.asarray(_white(left, n, stated)[0] + np.sum(np.log(rest), axis=1))

    return of


def _rough(result: Estimate, fitted: Fitted, keep: NDArray[np.bool_]) -> Array:
    """→ (n,) scatter of each touch's facet against the common one, 1 where nothing speaks for more.

    A facet is judged by the touches that the unknowns left over on it, Σ (1 − h), against the median of all facets (F test).
    """
    facets = np.array(result.model.touches.facet)
    names, place = np.unique(facets[keep], return_inverse=True)
    spare = np.bincount(place, np.clip(1 - fitted.lever[keep], 0.0, 1.0)).astype(np.float64)
    judged = spare >= FEWEST
    if not judged.any():
        return np.ones(len(facets))
    square = np.bincount(place, fitted.left[keep] ** 2)
    count = np.maximum(spare, FEWEST)
    usual = count * (1 - 2 / (9 * count)) ** 3  # median of χ² (Wilson and Hilferty 1931)
    common = _middle((square / usual)[judged], spare[judged])
    ratio = square / (count * max(common, SIGMA_FLOOR**2))
    rest = max(float(spare[judged].sum()) / 2, 1.0)  # a median is worth some half of the touches
    chance = special.fdtrc(count, rest, ratio)
    wild = judged & (chance < ROUGH / len(names)) & (ratio > 2)
    size = dict(zip(names, np.where(wild, np.sqrt((ratio * count + PRIOR) / (count + PRIOR)), 1.0), strict=True))
    return np.array([size.get(f, 1.0) for f in facets])


def _middle(values: Array, weight: Array) -> float:
    """(k,) values, (k,) weights → weighted median."""
    order = np.argsort(values)
    return float(values[order][np.searchsorted(np.cumsum(weight[order]), weight.sum() / 2)])
