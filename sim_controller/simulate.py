"""A strategy carried out by the true machine, without a controller in between: all touches of all cycles at once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tango_cnc.records import Approach, Array, Artefact, InputError, Machine, Readings, Strategy, World

from . import clock, effects
from .probing import Rig, facet_rows, gap_along, history, home, noise, rig, undisturbed
from .roots import first_zero
from .world import Control, nominal_machine, tip_in_table

DAY = 86_400.0  # s
STILL = 1e-9  # mm or rad: less than this is rounding, not a motion
SHORTEST = 0.3  # mm nearer than the stand-off: less is no motion of a program, as some controls take none so short
PIECES = 12  # of an approach: enough for one that enters and leaves a ball of the size of the probe's tip


@dataclass(frozen=True)
class _Cycle:
    """n touches as commanded: axis positions (n, k) of stand-off, nominal contact and search end."""

    facets: tuple[str, ...]
    standoff: Array
    contact: Array
    end: Array


def simulate(
    machine: Machine,
    artefact: Artefact,
    strategy: Strategy,
    world: World,
    cycles: int = 1,
    days: int = 1,
    seed: int | None = None,
    moved: Array | None = None,
    control: Control | None = None,
) -> Readings:
    """cell, world, repetitions → what the true machine reads; `seed` overrides the world's.

    The approach is along the nominal facet normal from the stand-off to the search end. Every day starts at the home position,
    every axis last moved in the positive direction, and 24 h (or as many days as it takes) after the day before.
    `moved`, (touches of a cycle, k) mm rad: size and sense of each axis' last motion on the way that is really taken, 0 where
    that is not known. Without it the way leads straight from stand-off to stand-off. `control`: what it compensates; readings are
    then in programmed coordinates, as a control with tool centre point control on tells them.
    Raises InputError for names that do not exist and for positions outside an axis' travel.
    """
    if cycles < 1 or days < 1:
        raise InputError(f"found {cycles} cycles on {days} days; allowed: 1 or more of each")
    r = rig(machine, artefact, world, seed, control=control)
    cycle = _commanded(machine, artefact, strategy)
    _check_travel(machine, cycle)
    count = len(cycle.facets)
    once = np.tile(np.arange(count), cycles)
    rows = np.tile(once, days)
    day = np.repeat(np.arange(1, days + 1), len(once))
    rows_a_day = len(once)
    surface = facet_rows(r, cycle.facets)[rows]
    standoff, end = cycle.standoff[rows], cycle.end[rows]
    begin = _begin(cycle, strategy.approach)[rows]
    first = np.arange(len(rows)) % rows_a_day == 0
    came_from = np.where(first[:, None], home(machine), np.roll(standoff, 1, axis=0))
    direction = _directions(first, came_from, standoff, end)
    if moved is not None:
        moved = np.tile(moved, (cycles * days, 1))
        direction = np.where(moved != 0, np.sign(moved), direction)

    nothing = undisturbed(len(rows))
    s, early, miss = _contacts(r, cycle, rows, surface, standoff, end, direction, nothing)
    positions = standoff + s[:, None] * (end - standoff)
    time, day_start = _times(r, strategy, first, day, came_from, standoff, begin, positions)
    logged = tuple(cycle.facets[row] for row in rows)
    if r.effects or r.noise:
        feed = np.full(len(rows), strategy.approach.feed)
        last = _last_moves(first, came_from, standoff, begin, positions)
        last = last if moved is None else np.where(moved != 0, moved, last)
        known = history(r, surface, positions, direction, last, time, day, feed, day_start)
        change = effects.disturbance(r.effects, known, r.seed)
        assert change.gap is not None
        change = replace(change, gap=change.gap + noise(r, len(rows)))
        logged = change.facet or logged
        s, early, miss = _contacts(r, cycle, rows, surface, standoff, end, direction, change)
        positions = standoff + s[:, None] * (end - standoff)
    return Readings(
        machine.names,
        1 + np.tile(np.arange(count), cycles * days),
        time,
        logged,
        positions,
        direction,
        tuple("miss" if m else "early" if e else "ok" for m, e in zip(miss, early, strict=True)),
        np.tile(np.repeat(np.arange(1, cycles + 1), count), days),
        day,
        np.full(len(rows), strategy.approach.feed),
    )


def _commanded(machine: Machine, artefact: Artefact, strategy: Strategy) -> _Cycle:
    facets = tuple(facet for i in strategy.indexations for facet in i.facets)
    fixed = np.zeros((len(facets), len(machine.names)))
    turned = [i.position for i in strategy.indexations for _ in i.facets]
    for name in (*machine.rotary, "S"):
        fixed[:, machine.column(name)] = [position.get(name, 0.0) for position in turned]
    point = np.array([artefact.facets[f].point for f in facets])
    normal = np.array([artefact.facets[f].normal for f in facets])
    radius, approach = machine.probe.tip_radius, strategy.approach
    standoff, contact, end = (
        linear_positions(machine, fixed, point + normal * (radius + height))
        for height in (approach.standoff, 0.0, -approach.search)
    )
    return _Cycle(facets, standoff, contact, end)


def _begin(cycle: _Cycle, approach: Approach) -> Array:
    """→ (n, k) where the measuring moves begin: at the stand-off, or as near as a double touch has retreated to."""
    nearer = 0.0 if approach.find is None else approach.standoff - approach.find.retreat
    part = 1.0 if nearer < SHORTEST else 1.0 - nearer / approach.standoff
    return cycle.standoff if part == 1.0 else cycle.contact + part * (cycle.standoff - cycle.contact)


def linear_positions(machine: Machine, positions: Array, targets: Array) -> Array:
    """(n, k) mm rad with rotary columns set, (n, 3) mm tip in the table frame → (n, k) with X Y Z that put the nominal tip there.

    The tip is affine in the linear axes, whatever the rotary ones are: one 3 × 3 solution, repeated once for its rounding.
    """
    nominal, still = nominal_machine(machine), np.zeros_like(positions)
    columns = [machine.column(name) for name in machine.linear]
    result = positions.copy()
    result[:, columns] = 0.0
    at_zero = tip_in_table(nominal, result, still)
    matrix = np.empty((len(positions), 3, 3))
    for i, column in enumerate(columns):
        moved = result.copy()
        moved[:, column] = 100.0
        matrix[:, :, i] = (tip_in_table(nominal, moved, still) - at_zero) / 100.0
    for _ in range(2):
        wanted = targets - tip_in_table(nominal, result, still)
        result[:, columns] += np.linalg.solve(matrix, wanted[:, :, None])[:, :, 0]
    return result


def _check_travel(machine: Machine, cycle: _Cycle) -> None:
    for axis, column in zip(machine.axes, range(len(machine.names)), strict=True):
        if axis.travel is None:
            continue
        low, high = axis.travel
        for positions in (cycle.standoff, cycle.end):
            outside = np.flatnonzero((positions[:, column] < low - 1e-6) | (positions[:, column] > high + 1e-6))
            if outside.size:
                scale, unit = (1.0, "mm") if axis.kind == "linear" else (180 / np.pi, "deg")
                i = outside[0]
                raise InputError(
                    f"strategy: touch {i + 1} (facet {cycle.facets[i]}) needs {axis.name} = "
                    f"{positions[i, column] * scale:.3f} {unit}; "
                    f"allowed: {low * scale:g} to {high * scale:g} ({outside.size} touches outside). Run 'tango check'"
                )


def _contacts(
    r: Rig,
    cycle: _Cycle,
    rows: NDArray[np.int64],
    surface: NDArray[np.int64],
    standoff: Array,
    end: Array,
    direction: Array,
    change: effects.Disturbance,
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """→ (n,) s of contact (1 for a miss), (n,) whether before the search zone, (n,) whether missed.

    The search zone reaches as far before the nominal contact as past it.
    """
    s = first_zero(gap_along(r, standoff, end, direction, surface, change), len(rows), PIECES)
    miss = np.isnan(s)
    s = np.where(miss, 1.0, s)
    linear = [r.machine.column(name) for name in r.machine.linear]
    whole = np.linalg.norm((end - standoff)[:, linear], axis=1)
    past = np.linalg.norm((cycle.end - cycle.contact)[rows][:, linear], axis=1)
    return s, s * whole < whole - 2 * past - STILL, miss


def _directions(first: NDArray[np.bool_], came_from: Array, standoff: Array, end: Array) -> Array:
    """→ (n, k) direction of each axis' last motion: the approach, else the way to the stand-off, else what it was before."""
    approach, way = _sign(end - standoff), _sign(standoff - came_from)
    latest = np.where(approach != 0, approach, way)
    latest[first] = np.where(latest[first] != 0, latest[first], 1.0)
    row = np.where(latest != 0, np.arange(len(latest))[:, None], 0)
    return np.take_along_axis(latest, np.maximum.accumulate(row, axis=0), axis=0)


def _last_moves(first: NDArray[np.bool_], came_from: Array, standoff: Array, begin: Array, positions: Array) -> Array:
    """→ (n, k) mm rad, signed length of each axis' last motion; 0 before the first one of a day."""
    approach, way = positions - begin, standoff - came_from
    latest = np.where(np.abs(approach) > STILL, approach, np.where(np.abs(way) > STILL, way, np.nan))
    latest[first] = np.nan_to_num(latest[first])
    row = np.where(np.isnan(latest), 0, np.arange(len(latest))[:, None])
    return np.take_along_axis(latest, np.maximum.accumulate(row, axis=0), axis=0)


def _sign(change: Array) -> Array:
    return np.where(np.abs(change) > STILL, np.sign(change), 0.0)


def _times(
    r: Rig,
    strategy: Strategy,
    first: NDArray[np.bool_],
    day: NDArray[np.int64],
    came_from: Array,
    standoff: Array,
    begin: Array,
    positions: Array,
) -> tuple[Array, Array]:
    """→ (n,) s of every contact, (n,) s at which its day began: back to the stand-off, index, over to the next, approach.

    Of a double touch the way to the contact comes first at its own feed, then back to the stand-off and to where measuring begins.
    """
    machine = r.machine
    linear = np.array([axis.kind == "linear" for axis in machine.axes])
    way = np.where(np.abs(standoff - came_from) > STILL, standoff - came_from, 0.0)
    back = np.where(first[:, None], 0.0, np.roll(positions - standoff, 1, axis=0))
    seconds = clock.rapid_time(machine, back) + clock.rapid_time(machine, way * ~linear) + clock.rapid_time(machine, way * linear)
    seconds += clock.feed_time(np.linalg.norm((positions - begin)[:, linear], axis=1), strategy.approach.feed)
    if strategy.approach.find is not None:
        found = positions - standoff
        seconds += clock.feed_time(np.linalg.norm(found[:, linear], axis=1), strategy.approach.find.feed)
        seconds += clock.rapid_time(machine, found) + clock.rapid_time(machine, begin - standoff)
    elapsed = np.cumsum(seconds.reshape(day[-1], -1), axis=1)
    period = DAY * max(1.0, np.ceil(elapsed.max() / DAY))
    start = (day - 1) * period
    return elapsed.ravel() + start, start
