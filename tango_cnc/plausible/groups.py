"""Touches without weight that have something in common: a ball, a facet, an indexation, a moment. That is a mistake, not bad luck.

A robust fit drops what does not fit. When what it dropped is all on one ball, or all on one facet from one touch on, dropping it
hides a bar of another length, a wrong tip radius, a chip.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..estimate import Estimate
from ..model import known
from ..records import Array
from ..terms import SCALES, Coefficient
from ..texts import joined, say
from .data import Remark, listed
from .since import or_moment

CHANCE = 1e-4  # that touches dropped at random fall together as much
SHARE = 0.5  # of the touches of a group that are dropped
FEWEST = 3
MANY = 4  # touches without weight of one indexation that are a reason by themselves
NEARLY = 0.8  # share of all touches without weight that they are
FEW = 0.1  # share of all touches that one indexation or one facet may make unfit
FITS = 5.0  # white standard deviations within which touches fit
CERTAIN = 3.0  # standard deviations that a bar has to be beyond what gains explain
SMALL = {"mm": (1e3, "µm"), "rad": (1e6, "µrad"), "mm/mm": (1e6, "µm/m")}  # units of coefficients for people
LONGER = 0.01  # mm: what a note on the bar says of the others is for a bar that is longer by this
LENGTH = 6e-5  # mm/mm: gains that are alike and larger speak of the bar
REACH = 400.0  # mm: what an angle does to a touch beyond its lever is half of its square times this, at most
ALONE = 0.4  # share of all touches without weight that lie in one indexation of which the angle is blamed
TURNED = math.radians(0.002)  # rad: smaller angles of one indexation are seating
EXPLAINS = 0.7  # share of the squares of an indexation that its angle takes away, or the terms lack something


def common(result: Estimate, agrees: bool = False) -> Iterator[Remark]:
    """estimate by the noise of its residuals, whether nights before predicted these touches → remarks on the step, the bar and
    touches without weight that belong together.
    """
    step, bar = list(_step(result)), list(_bar(result))
    yield from (*bar, *step)
    yield from _feed(result)
    yield from _gains(result, agrees)
    if bar or step:
        return  # the touches that have no weight belong together by that
    balls = list(_balls(result))
    yield from or_moment(result, balls or [*_indexations(result), *_facets(result)] or list(_one_indexation(result)))


def _dropped(result: Estimate) -> NDArray[np.bool_]:
    return np.zeros(len(result.residuals), dtype=np.bool_) if result.rejected is None else result.rejected


def _white(result: Estimate) -> float:
    white = result.sigma if result.noise is None else result.noise.white
    return max(white, result.model.touches.machine.probe.repeatability / 2)


def _step(result: Estimate) -> Iterator[Remark]:
    step = None if result.noise is None else result.noise.step
    if step is None:
        return
    touches = result.model.touches
    size = ", ".join(f"{c} {d * 1e3:+.1f}" for c, d in zip("XYZ", step.shift, strict=True))
    more = ""
    if any(step.turn):
        more = say("plausible.groups.turned", turn=", ".join(f"{c} {a * 1e6:+.0f}" for c, a in zip("ABC", step.turn, strict=True)))
    if step.radius:
        more = say(f"plausible.groups.tip_{'larger' if step.radius > 0 else 'smaller'}", size=f"{abs(step.radius) * 1e3:.1f}")
    change = say("plausible.groups.find_out_what_happened_then")
    at = touches.time[step.row] - touches.time.min()
    after = tuple(int(i) for i in touches.number[touches.time >= touches.time.min() + at])
    yield Remark(
        "doubtful",
        say(
            "plausible.groups.something_moved_between_touches_after",
            before=step.before,
            after=step.after,
            at=f"{at:.0f}",
            place=joined(say("plausible.or"), [_place(*one) for one in ((step.frame, step.axis), *step.instead)]),
            size=size,
            where=say(f"plausible.frame_{step.frame}", axis=step.axis),
            more=more,
        ),
        after,
        "step",
        "time_s",
        change,
        sure=True,
        moves=step.moves,
    )


def _place(frame: str, axis: str) -> str:
    """frame, letter of the axis that moved → what moved."""
    return say(f"plausible.moved_{frame}", axis=axis)


def _distance(result: Estimate) -> tuple[float, float] | None:
    """→ mm between the centres of the two balls of the bar by their own touches, all of them; its standard deviation."""
    model = result.model
    if model.bar is None:
        return None
    first = len(model.coefficients) + len(model.touches.facets)
    found, spread = [], 0.0
    white = _white(result)
    for ball in model.bar:
        rows = model.touches.ball_index == ball
        columns = list(range(first + 3 * ball, first + 3 * ball + 3))
        own = result.jacobian[: len(rows)][np.ix_(rows, columns)]
        if rows.sum() < 3 or np.linalg.cond(own) > 1e4:
            return None
        # Touches that contradict each other say nothing of the distance; a wrong radius moves all gaps of a ball alike.
        round_ball = np.hstack([own, -np.ones((len(own), 1))])
        for system in (own, round_ball) if len(own) > 4 and np.linalg.cond(round_ball) < 1e4 else (own,):
            change = np.linalg.lstsq(system, -result.residuals[rows], rcond=None)[0]
            # A gap is quadratic in a shift of the centre: half of its square over the radius.
            bent = float(change[:3] @ change[:3]) / model.touches.artefact.balls[model.touches.balls[ball]].radius
            if np.abs(result.residuals[rows] + system @ change).max() < FITS * white + bent:
                break
        else:
            return None
        key = model.touches.balls[ball]
        found.append(result.balls[key] + change[:3])
        spread += float(np.trace(np.linalg.inv(system.T @ system)[:3, :3]))
    return float(np.linalg.norm(found[0] - found[1])), white * math.sqrt(spread)


def _bar(result: Estimate) -> Iterator[Remark]:
    bar, machine = result.model.touches.artefact.scale_bar, result.model.touches.machine
    measured = _distance(result)
    if bar is None or measured is None:
        return
    length, std = measured
    off, allowed = bar.length - length, machine.tolerances.scale * bar.length
    if abs(off) - CERTAIN * std <= allowed:
        return
    change = say("plausible.groups.compare_with_certificate_bar_see")
    yield Remark(
        "implausible",
        say(
            f"plausible.groups.bar_{'long' if off > 0 else 'short'}",
            length=f"{length:.3f}",
            length2=f"{bar.length:g}",
            off=f"{abs(off):.3f}",
            allowed=f"{allowed:.3g}",
        ),
        (),
        "scale_bar",
        "scale_bar.length",
        change,
        file="artefact",
        sure=True,
    )


def _gains(result: Estimate, agrees: bool) -> Iterator[Remark]:
    """All gains rest on the bar; nothing but their being alike can speak against it, so that the result says what they rest on.

    Where nights before have found them as large, those have said what there was to say: a machine that is warm stays so.
    """
    names = [n for n in SCALES if n in result.model.names]
    bar = result.model.touches.artefact.scale_bar
    if not names or result.selection.mismatch or bar is None or result.model.bar is None:
        return
    values = np.array([result.value(n) for n in names])
    std = max(float(result.std[result.model.names.index(n)]) for n in names)
    mean = float(values.mean())
    if len(names) == 3 and abs(mean) > max(LENGTH, 8 * std) and np.ptp(values) < abs(mean) / 2:
        text = say(f"plausible.groups.gains_{'long' if mean > 0 else 'short'}", mean=f"{abs(mean) * 1000000.0:.0f}")
        change = say("plausible.groups.compare_with_certificate_bar_see")
        moves = tuple({*names, *_by_bar(result, mean * bar.length)})
        if agrees:
            yield Remark("trustworthy", text)
        else:
            yield Remark("doubtful", text, (), "scale_bar", "scale_bar.length", change, file="artefact", sure=True, moves=moves)
        return
    text = say(
        "plausible.groups.scale_rests_on_bar",
        names=joined(", ", names),
        length=f"{bar.length:.10g}",
        uncertainty=f"{bar.uncertainty:g}",
        share=f"{LONGER / bar.length * 1e6:.0f}",
        more=_with_bar(result, names),
    )
    yield Remark("trustworthy", text)


def _with_bar(result: Estimate, scales: Sequence[str]) -> str:
    """estimate, names of the scales → what else moves by more than two of its standard deviations if the bar is longer."""
    moved = _moved_by_bar(result, LONGER)
    coefficients = result.model.coefficients
    told = []
    for c, off, std in zip(coefficients, moved, result.std, strict=False):
        if c.name not in scales and abs(off) > 2 * std:
            told.append(
                (abs(off) / std, say("plausible.groups.moves_with_bar", name=result.selection.label(c.name), size=_sized(c, off)))
            )
    first = len(coefficients)
    facets = moved[first : first + len(result.model.touches.facets)]
    beyond = np.abs(facets) > 2 * result.std[first : first + len(facets)]
    more = [text for _, text in sorted(told, key=lambda one: -one[0])]
    if beyond.any():
        most = f"{float(np.abs(facets[beyond]).max()) * 1e3:.1f}"
        more.append(say("plausible.groups.facets_move_with_bar", count=int(beyond.sum()), size=most))
    return say("plausible.groups.moves_as_well", more=joined(", ", more)) if more else ""


def _sized(coefficient: Coefficient, off: float) -> str:
    """coefficient, by how much it moves in its own unit → the same with sign and unit for people."""
    factor, unit = SMALL.get(coefficient.unit, (1.0, coefficient.unit))
    return f"{off * factor:+.1f} {unit}"


def _moved_by_bar(result: Estimate, off: float) -> Array:
    """estimate, mm that the bar is longer → by how much every unknown moves (mm, rad)."""
    _, rows, uncertainty = known(result.model, result.values)  # the bar is the last of what is known
    return np.asarray(result.covariance @ rows[-1] * off / uncertainty[-1] ** 2)


def _by_bar(result: Estimate, off: float) -> list[str]:
    """estimate, mm that the bar is off → names of coefficients that this moves by more than two of their standard deviations."""
    moved = _moved_by_bar(result, off)
    count = len(result.model.coefficients)
    return [n for n, m, s in zip(result.model.names[:count], moved, result.std, strict=False) if abs(m) > 2 * s]


def _feed(result: Estimate) -> Iterator[Remark]:
    """Touches at another feed read elsewhere where the control latches late."""
    touches, keep = result.model.touches, ~_dropped(result)
    feed = touches.feed
    if not np.isfinite(feed).all() or np.ptp(feed) < 1.0:
        return
    weights = np.concatenate([np.ones(len(feed)), result.known_weights])
    weighted = result.jacobian * weights[:, None]
    basis = np.linalg.qr(weighted / np.maximum(np.linalg.norm(weighted, axis=0), 1e-300))[0]

    def free(values: Array) -> Array:
        whole = np.concatenate([values, np.zeros(len(result.known_residuals))])
        return np.asarray(whole - basis @ (basis.T @ whole))

    pattern, left = free(feed - feed.mean()), free(result.residuals)
    slope = float(pattern @ left / max(float(pattern @ pattern), 1e-300))
    explained = slope * float(pattern @ left) / max(float(left @ left), 1e-300)
    if explained < 0.5 or keep.sum() < len(feed) / 2:
        return
    moved = np.abs(slope * (np.linalg.pinv(weighted) @ np.concatenate([feed - feed.mean(), np.zeros(len(left) - len(feed))])))
    moves = tuple(c.name for c, off, std in zip(result.model.coefficients, moved, result.std, strict=False) if off > std)
    change = say("plausible.groups.measure_all_touches_at_one")
    yield Remark(
        "doubtful",
        say(
            "plausible.groups.touches_at_feed_mm_min",
            max=f"{feed.max():g}",
            slope=f"{abs(slope) * np.ptp(feed) * 1000.0:.1f}",
            min=f"{feed.min():g}",
            slope2=f"{abs(slope) * 60000.0:.2g}",
        ),
        (),
        "feed",
        "feed",
        change,
        sure=True,
        moves=moves,
    )


def _together(dropped: NDArray[np.bool_], groups: Sequence[NDArray[np.bool_]], choices: int = 1) -> list[bool]:
    """(n,) dropped, masks of groups → whether more of each were dropped than chance would (hypergeometric)."""
    n, k = len(dropped), int(dropped.sum())
    found = []
    for group in groups:
        size, own = int(group.sum()), int((group & dropped).sum())
        few = own < FEWEST or own < SHARE * size
        found.append(not few and tail(n, k, size, own) * len(groups) * choices < CHANCE)
    return found


def tail(n: int, k: int, size: int, own: int) -> float:
    """touches, those dropped, those of a group, dropped in it → chance of that many or more (hypergeometric)."""

    def ways(a: float, b: Array) -> Array:
        return np.asarray(special.gammaln(a + 1) - special.gammaln(b + 1) - special.gammaln(a - b + 1))

    i = np.arange(own, min(size, k) + 1, dtype=float)
    i = i[k - i <= n - size]
    return float(np.exp(ways(size, i) + ways(n - size, k - i) - ways(n, np.array(float(k)))).sum())


def _balls(result: Estimate) -> Iterator[Remark]:
    touches = result.model.touches
    dropped = result.unused  # of a ball with a wrong touch nobody knows which it is
    masks = [touches.ball_index == i for i in range(len(touches.balls))]
    for ball, mask, accused in zip(touches.balls, masks, _together(dropped, masks), strict=True):
        if accused:
            numbers = tuple(int(i) for i in touches.number[mask & dropped])
            change = say("plausible.groups.compare_tip_radius_ball_radius")
            yield Remark(
                "doubtful",
                say(
                    "plausible.groups.touches_on_ball_do_not",
                    count=len(numbers),
                    sum=int(mask.sum()),
                    ball=ball,
                    numbers=listed(numbers),
                    change=change,
                ),
                numbers,
                "",
                "touch",
                change,
                moves=_rest_on(result, ball, mask),
            )


def _rest_on(result: Estimate, ball: str, mask: NDArray[np.bool_]) -> tuple[str, ...]:
    """estimate, a ball whose touches do not agree, these → what the scale bar tells of the machine, where it is one of its two."""
    model = result.model
    if model.bar is None or ball not in [model.touches.balls[i] for i in model.bar]:
        return ()
    off = float(np.abs(result.residuals[: len(mask)][mask]).max())  # what stands of its touches may be as far off as the others
    return tuple(dict.fromkeys([*(n for n in SCALES if n in model.names), *_by_bar(result, off)]))


def _facets(result: Estimate) -> Iterator[Remark]:
    touches, dropped = result.model.touches, _dropped(result)
    if dropped.mean() > FEW:
        return  # so many are no chip
    masks = [(touches.facet_index == i) & (touches.ball_index < 0) for i in range(len(touches.facets))]
    for facet, mask in zip(touches.facets, masks, strict=True):
        own = np.flatnonzero(mask & dropped)
        if len(own) < FEWEST:
            continue
        place = np.arange(len(dropped))
        pieces = [mask & (place >= own[0]), mask & (place <= own[-1])]
        # Where it begins and ends was chosen after the fact: as many choices as the facet has touches.
        if not any(_together(dropped, pieces, choices=len(masks) * int(mask.sum()))):
            continue
        numbers = tuple(int(i) for i in touches.number[own])
        left = result.residuals[own]
        off, most = abs(float(np.median(left))), float(np.abs(left).max())
        both = min((left > 0).sum(), (left < 0).sum()) > 1  # a chip is on one side of where the facet was
        change = say(f"plausible.groups.look_{'at_rough_facet' if both else 'for_chip_burr_on'}", facet=facet)
        yield Remark(
            "doubtful",
            say(
                f"plausible.groups.facet_{'scatters' if both else 'elsewhere'}_in_touches",
                facet=facet,
                size=f"{(most if both else off) * 1000.0:.0f}",
                numbers=listed(numbers),
            ),
            numbers,
            "chip",
            "touch",
            change,
            sure=off < touches.artefact.tolerances.facet,  # more is no chip: its line in artefact.yaml may be wrong
        )


def _indexations(result: Estimate) -> Iterator[Remark]:
    """Touches of one indexation that all fit if one axis was turned a little further there."""
    touches, dropped = result.model.touches, _dropped(result)
    machine, white = touches.machine, _white(result)
    if dropped.mean() > FEW:
        return  # one indexation does not explain so much: the cell is wrong, and any angle fits some of it
    for index in np.unique(touches.indexation[dropped]):
        rows = touches.indexation == index
        if (rows & dropped).sum() < max(2, ALONE * dropped.sum()):
            continue  # touches elsewhere do not fit either: not this angle, the model lacks something
        best = None
        for axis in (*machine.rotary, "S"):
            lever, left = touches.lever(axis)[rows], result.residuals[rows]
            if not np.abs(lever).max(initial=0.0) > 1.0 or (np.abs(lever[dropped[rows]]) > 1.0).sum() < 2:
                continue
            angle = float(lever @ left / (lever @ lever))
            rest = float(np.abs(left - lever * angle).max())
            if angle * float(lever @ left) < EXPLAINS * float(left @ left):
                continue
            if rest < FITS * white + REACH * angle**2 / 2 and abs(angle) > TURNED and (best is None or rest < best[0]):
                best = rest, axis, angle
        if best is None:
            continue
        _, axis, angle = best
        numbers = tuple(int(i) for i in touches.number[rows])
        change = say("plausible.groups.see_whether_was_clamped_whether")
        yield Remark(
            "doubtful",
            say(
                "plausible.groups.was_from_where_readings_say",
                axis=axis,
                degrees=f"{abs(math.degrees(angle)):.4f}",
                numbers=numbers[0],
                numbers2=numbers[-1],
            ),
            numbers,
            "indexation",
            axis,
            change,
            sure=True,
        )


def _one_indexation(result: Estimate) -> Iterator[Remark]:
    """Touches without weight that are nearly all of one indexation, though no angle of one axis makes all of them fit."""
    touches, out = result.model.touches, result.unused
    for index in np.unique(touches.indexation[out]):
        rows = touches.indexation == index
        own = rows & out
        if own.sum() < max(MANY, NEARLY * out.sum()) or len({touches.facet[i] for i in np.flatnonzero(own)}) < FEWEST:
            continue
        if tail(len(out), int(out.sum()), int(rows.sum()), int(own.sum())) * (touches.indexation[-1] + 1) > CHANCE:
            continue
        numbers = tuple(int(i) for i in touches.number[own])
        axes = (*touches.machine.rotary, "S")
        first = np.flatnonzero(rows)[0]
        place = joined(", ", [f"{a} {math.degrees(float(touches.axis(a)[first])):.6g}°" for a in axes])
        which = {
            "count": len(numbers),
            "place": place,
            "first": int(touches.number[rows][0]),
            "last": int(touches.number[rows][-1]),
        }
        change = say("plausible.groups.see_whether_was_clamped_whether")
        text = say("plausible.groups.of_one_indexation", numbers=listed(numbers), **which)
        yield Remark("doubtful", text, numbers, "indexation", ", ".join(axes), change)
