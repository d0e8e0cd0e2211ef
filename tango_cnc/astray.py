"""Touches of the locating cycle that met something else than their facet: which one does not count, and when that is no proof."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy import special
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from .records import Array, Facet

AGREES = 0.05  # mm between a touch and the table that was found, where nothing else is stated
DRAWN = 0.5  # mm to which a table that nobody has calibrated may have its facets beside each other
WALL = 0.95  # cosine: facets that lie as much alike may be met by the stem at once
CHANCE = 1e-3  # that touches which met something else, or facets that are not in their places, agree as well as that
LEAST = 8  # touches that have to agree
ASTRAY = 1  # touches that may have met something else than their facet: they are left out where eight others agree
TURNED = 3.0  # deg by which it may be turned then
MOST_GROWN = 0.05  # a table of so much another size is another table
FILE = "FILE"  # in messages: that of the readings; who knows its name says it instead
LOOSER = (
    "Measure distances between its facets, and compare them with artefact.yaml. "
    f"'tango locate --readings {FILE} --agrees MM' then places the table from these same touches, and nothing moves: MM is the "
    "largest difference that you have measured. Where all of them differ by the same share the table has another size: multiply "
    "all places in artefact.yaml by that share instead"
)
EITHER = (
    "Either something else was met there, or the table has another size; these touches cannot tell. {} If its width is right, take "
    "away what was met, and touch again"
)


def agreeing(
    facets: Sequence[Facet], tip: Array, radius: float, least: int, agrees: float
) -> tuple[tuple[int, ...] | None, Array, Array]:
    """facets, (n, 3) tips at their contacts, how many have to agree, to how many mm → rows that do, six unknowns, (n,) mm; None
    where too few do.

    A displaced table may meet the ball beside the facet that is meant, so up to `ASTRAY` touches are left out, the fewest that
    will do, as long as eight are left: six unknowns and two that could disagree. Where leaving out one touch or another agrees, and
    the table would stand elsewhere, neither is believed.
    """
    every = tuple(range(len(facets)))
    first: tuple[Array, Array] | None = None
    for out in range(ASTRAY + 1):
        fits = []
        for left in combinations(every, out):
            kept = tuple(row for row in every if row not in left)
            if len(kept) < least:
                continue
            found, residual = solved(facets, tip, radius, kept)
            first = first or (found, residual)
            fits.append((float(np.abs(residual[list(kept)]).max()), kept, found, residual))
        agreeing = [fit for fit in fits if fit[0] <= agrees]
        if agreeing:
            best = min(agreeing, key=lambda fit: fit[0])
            contradicted = any(
                np.abs(other[3] - best[3]).max() > agrees for other in agreeing
            )  # two answers, and nobody knows which
            contradicted |= out > 0 and two_against(facets, tip, radius, best, agrees)
            return None if contradicted else best[1], best[2], best[3]
    assert first is not None  # nothing left out
    return None, *first


def no_proof(
    facets: Sequence[Facet], tip: Array, radius: float, best: tuple[int, Array, Array], agrees: float, room: float, whole: bool
) -> str:
    """facets, their tips, the row that would be left out with what the others say, mm, mm from its point to its edge, whether every
    touch met something → why that is no proof; '' where it is one.

    Two touches that could disagree with six unknowns agree by chance once one of nine may be left out, and always where a table
    of another size can be turned so that it fits.
    """
    out, found, residual = best
    kept = [row for row in range(len(facets)) if row != out]
    if (loose := drawn(facets, tip, radius, agrees)) is not None and by_chance(residual[kept], len(facets), loose) > CHANCE:
        offered = f" {LOOSER}." if whole else ""
        return (
            f"Either it met something else, or artefact.yaml has the facets in their places to {loose:g} mm only; these touches "
            f"cannot tell.{offered} If something stood in the way, take it away and touch again"
        )
    larger, fits = grown(facets, tip, radius)
    if fits <= max(agrees, DRAWN) and abs(larger) > 1e-3:
        which = of_size(larger) if abs(larger) < MOST_GROWN else "Measure one of its widths: is it the table of artefact.yaml"
        return EITHER.format(f"{which}.")
    if (turn := math.degrees(float(np.linalg.norm(found[3:])))) > TURNED:
        return f"The others fit a table that is turned by {turn:.1f} deg, and {TURNED:g} are searched: is it that of artefact.yaml?"
    turned = Rotation.from_rotvec(found[3:])
    off, normal = tip[out] - turned.apply(facets[out].point) - found[:3], turned.apply(facets[out].normal)
    aside = float(np.linalg.norm(off - (off @ normal) * normal))
    if residual[out] < 0 and aside + radius < room:
        return (
            f"It came late although the ball must have met this facet, {aside:.0f} mm from its point: the table is not the one of "
            "artefact.yaml, or another facet is in its place there"
        )
    return ""


def of_size(larger: float) -> str:
    """by which share the table is larger than its file if all touches count → what to measure, and what to correct then."""
    return (
        f"All of them fit a table that is {abs(larger):.1%} {'larger' if larger > 0 else 'smaller'} than artefact.yaml says: "
        "measure one of its widths first. If it is so, multiply all places in artefact.yaml (balls and obstacles, too) by "
        f"{1 + larger:.4f}, and read these same touches again: 'tango locate --readings {FILE}'"
    )


def grown(facets: Sequence[Facet], tip: Array, radius: float) -> tuple[float, float]:
    """facets, their tips → by which share the table is larger than its file if all of them count, mm that are left of the worst."""
    middle = np.mean([facet.point for facet in facets], axis=0)

    def gap(x: Array) -> Array:
        turned = Rotation.from_rotvec(x[3:6])
        normal = turned.apply([facet.normal for facet in facets])
        point = turned.apply(middle + (1.0 + x[6]) * (np.array([facet.point for facet in facets]) - middle))
        gaps: Array = np.einsum("ni,ni->n", normal, tip - point - x[:3]) - radius
        return gaps

    found = least_squares(gap, np.zeros(7), x_scale=[1, 1, 1, 0.01, 0.01, 0.01, 0.01]).x
    return float(found[6]), float(np.abs(gap(found)).max())


def drawn(facets: Sequence[Facet], tip: Array, radius: float, agrees: float) -> float | None:
    """facets, their tips, mm → the mm to which a table that nobody has calibrated agrees with every touch; None beyond `DRAWN`."""
    most = float(np.abs(solved(facets, tip, radius, range(len(facets)))[1]).max())
    drawn = math.ceil(most * 10 - 1e-9) / 10
    return drawn if agrees < drawn <= DRAWN else None


def by_chance(residual: Array, touches: int, loose: float) -> float:
    """(m,) mm of the touches that count, of how many in all, mm to which facets are in their places → chance that the best m agree
    at least so well where none met anything but its facet.

    Places anywhere within ± `loose` have a standard deviation of `loose` / √3; six unknowns leave m − 6 squares (χ²), and there are
    `touches` choices of the one to leave out (Bonferroni).
    """
    square = float(residual @ residual) / (loose**2 / 3)
    return float(touches * special.chdtr(len(residual) - 6, square))


def two_against(
    facets: Sequence[Facet], tip: Array, radius: float, best: tuple[float, tuple[int, ...], Array, Array], agrees: float
) -> bool:
    """facets, tips, the fit that leaves one touch out, mm → whether that one is right where two others are wrong.

    The stem of the stylus may meet one wall at two facets: both are met early (+), and the one that is right, on the same wall or
    on the opposite one, disagrees with both. Facets of two walls are early by different lengths: that they agree with all others
    nevertheless is chance, and the nearer they agree the less of it.
    """
    agree, kept, _, residual = best
    (out,) = set(range(len(facets))) - set(kept)
    for pair in combinations(kept, 2):
        rows = tuple(sorted({*kept, out} - set(pair)))
        other = solved(facets, tip, radius, rows)[1]
        early = float(other[list(pair)].min())
        one, two = (facets[row].normal for row in pair)
        alike = abs(np.dot(one, two)) > WALL
        if (
            early > 0
            and (alike or agree > CHANCE * early)
            and np.abs(other[list(rows)]).max() <= agrees < np.abs(other - residual).max()
        ):
            return True
    return False


def solved(facets: Sequence[Facet], tip: Array, radius: float, kept: Sequence[int]) -> tuple[Array, Array]:
    """facets, their tips, rows that count → the six unknowns, (n,) mm of every touch."""
    normal, point = (np.array(f) for f in ([x.normal for x in facets], [x.point for x in facets]))

    def gap(x: Array) -> Array:
        turned = Rotation.from_rotvec(x[3:])
        gaps: Array = np.einsum("ni,ni->n", turned.apply(normal), tip - turned.apply(point) - x[:3]) - radius
        return gaps

    rows = list(kept)
    found = least_squares(lambda x: gap(x)[rows], np.zeros(6), x_scale=[1, 1, 1, 0.01, 0.01, 0.01]).x
    return found, gap(found)
