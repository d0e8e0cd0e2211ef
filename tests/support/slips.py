"""Mistakes that people make when they set up a cell or hand readings over; each with the answer that a judge accepts.

Written from what goes wrong in shops and without reading how the program looks for it. A slip takes a sound cell, its readings
and a generator, and gives both back as they would be on disk, with the answer; `None` where the machine has no room for it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tango_cnc.records import Artefact, Cell, Readings

Rng = np.random.Generator


@dataclass(frozen=True)
class Answer:
    """What must be named: one of `kinds`, and in text or key this `word`; `touches` where single touches are meant."""

    kinds: tuple[str, ...]
    word: str = ""


Spoilt = tuple[Cell, Readings, Answer] | None
Slip = Callable[[Cell, Readings, Rng], Spoilt]
SLIPS: dict[str, Slip] = {}


def slip(call: Slip) -> Slip:
    SLIPS[call.__name__] = call
    return call


def _machine(cell: Cell, **fields: Any) -> Cell:
    return replace(cell, machine=replace(cell.machine, **fields))


def _axis(cell: Cell, name: str, **fields: Any) -> Cell:
    axes = tuple(replace(a, **fields) if a.name == name else a for a in cell.machine.axes)
    return _machine(cell, axes=axes)


def _probe(cell: Cell, **fields: float) -> Cell:
    return _machine(cell, probe=replace(cell.machine.probe, **fields))


def _facet(cell: Cell, name: str, **fields: Any) -> Cell:
    facets = {**cell.artefact.facets, name: replace(cell.artefact.facets[name], **fields)}
    return replace(cell, artefact=replace(cell.artefact, facets=facets))


def _columns(readings: Readings, change: Callable[[np.ndarray], None]) -> Readings:
    position = np.array(readings.position)
    change(position)
    return replace(readings, position=position)


def _minus(v: tuple[float, float, float]) -> tuple[float, float, float]:
    return -v[0], -v[1], -v[2]


def _plain(cell: Cell, readings: Readings, least: int = 3) -> list[str]:
    """Facets that are no part of a ball and are touched often enough to be noticed."""
    facets = cell.artefact.facets
    return [f for f in facets if facets[f].ball is None and readings.facet.count(f) >= least]


def _turned(cell: Cell, readings: Readings) -> list[str]:
    return [n for n in cell.machine.rotary if np.ptp(readings.position[:, cell.machine.column(n)]) > 0.3]


# machine.yaml


def _sense(name: str) -> Slip:
    def spoil(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
        letters = [*cell.machine.linear, *cell.machine.rotary]
        if name.isdigit() and int(name) >= len(cell.machine.rotary):
            return None
        letter = cell.machine.rotary[int(name)] if name.isdigit() else name
        assert letter in letters
        wrong = _axis(cell, letter, direction=_minus(cell.machine.axis(letter).direction))
        return wrong, readings, Answer(("sense",), f"{letter} ")

    return spoil


SLIPS |= {
    f"sense of {what}": _sense(name)
    for name, what in (("X", "X"), ("Y", "Y"), ("Z", "Z"), ("0", "first rotary axis"), ("1", "second rotary axis"))
}


@slip
def directions_of_X_and_Y_exchanged(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    x, y = cell.machine.axis("X"), cell.machine.axis("Y")
    return (
        _axis(_axis(cell, "X", direction=y.direction), "Y", direction=x.direction),
        readings,
        Answer(("axes_exchanged",), "X and Y"),
    )


@slip
def rotary_axis_about_another_base_vector(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    if not (turned := _turned(cell, readings)):
        return None
    name = turned[int(rng.integers(len(turned)))]
    own = np.array(cell.machine.axis(name).direction)
    others = [tuple(e) for e in np.eye(3).tolist() if abs(np.dot(e, own)) < 0.5]
    wrong = _axis(cell, name, direction=others[int(rng.integers(len(others)))])
    return wrong, readings, Answer(("axis_direction",), f"{name} ")


@slip
def rotary_axes_in_the_wrong_order(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    for branch in ("workpiece_branch", "tool_branch"):
        axes = list(getattr(cell.machine, branch))
        turning = [i for i, n in enumerate(axes) if n in cell.machine.rotary]
        if len(turning) == 2:
            i, j = turning
            axes[i], axes[j] = axes[j], axes[i]
            return _machine(cell, **{branch: tuple(axes)}), readings, Answer(("chain_order",))
    return None


@slip
def rotary_axis_on_the_wrong_side(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    machine = cell.machine
    if not (turned := _turned(cell, readings)):
        return None
    name = turned[-1]
    work, tool = [[n for n in b if n != name] for b in (machine.workpiece_branch, machine.tool_branch)]
    if name in machine.workpiece_branch:
        tool.insert(len(tool) - 1, name)
    else:
        work.append(name)
    return _machine(cell, workpiece_branch=tuple(work), tool_branch=tuple(tool)), readings, Answer(("chain_order",))


@slip
def tip_diameter_for_radius(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    return _probe(cell, tip_radius=2 * cell.machine.probe.tip_radius), readings, Answer(("tip_radius",))


@slip
def another_tip(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    return _probe(cell, tip_radius=float(rng.choice([1.0, 1.5, 2.0, 2.5, 4.0]))), readings, Answer(("tip_radius",))


@slip
def another_stylus(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    off = float(rng.choice([-50.0, -20.0, 20.0, 50.0, 100.0]))
    return _probe(cell, length=cell.machine.probe.length + off), readings, Answer(("stylus_length",))


@slip
def stylus_to_the_end_of_its_ball(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    probe = cell.machine.probe
    return _probe(cell, length=probe.length + probe.tip_radius), readings, Answer(("stylus_length",))


@slip
def stylus_in_inches(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    return _probe(cell, length=cell.machine.probe.length / 25.4), readings, Answer(("stylus_length",))


def _pivot(which: int, size: float) -> Slip:
    def spoil(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
        turned = _turned(cell, readings)
        if which >= len(turned):
            return None
        name = turned[which]
        axis = cell.machine.axis(name)
        d = np.array(axis.direction)
        across = rng.normal(size=3)
        across -= (across @ d) * d
        shift = size * across / np.linalg.norm(across)
        x, y, z = (np.array(axis.point) + shift).tolist()
        return _axis(cell, name, point=(x, y, z)), readings, Answer(("pivot",), name)

    return spoil


SLIPS |= {f"pivot of rotary axis {i + 1} off by {size:g} mm": _pivot(i, size) for i in (0, 1) for size in (4.0, 25.0)}


@slip
def pivots_and_stylus_in_metres(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    axes = tuple(replace(a, point=tuple(c / 1000 for c in a.point)) for a in cell.machine.axes)
    probe = replace(cell.machine.probe, length=cell.machine.probe.length / 1000, tip_radius=cell.machine.probe.tip_radius / 1000)
    return _machine(cell, axes=axes, probe=probe), readings, Answer(("unit",), "machine.yaml")


# artefact.yaml


def _scaled(artefact: Artefact, factor: float) -> Artefact:
    facets = {
        k: replace(
            f,
            point=tuple(c * factor for c in f.point),
            surface=None if f.surface is None else replace(f.surface, radius=f.surface.radius * factor),
        )
        for k, f in artefact.facets.items()
    }
    balls = {k: replace(b, centre=tuple(c * factor for c in b.centre), radius=b.radius * factor) for k, b in artefact.balls.items()}
    bar = artefact.scale_bar and replace(artefact.scale_bar, length=artefact.scale_bar.length * factor)
    return replace(artefact, facets=facets, balls=balls, scale_bar=bar)


@slip
def table_in_inches(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    return replace(cell, artefact=_scaled(cell.artefact, 1 / 25.4)), readings, Answer(("unit",), "artefact.yaml")


@slip
def table_in_metres(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    return replace(cell, artefact=_scaled(cell.artefact, 1e-3)), readings, Answer(("unit",), "artefact.yaml")


@slip
def two_facets_exchanged(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    names = _plain(cell, readings)
    one, other = (names[int(i)] for i in rng.choice(len(names), 2, replace=False))
    facets = dict(cell.artefact.facets)
    facets[one], facets[other] = replace(facets[other], id=one), replace(facets[one], id=other)
    spoilt = replace(cell, artefact=replace(cell.artefact, facets=facets))
    return spoilt, readings, Answer(("facet_names",), " ")


@slip
def numbers_of_facets_shifted(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    facets = cell.artefact.facets
    plain = [f for f in facets if facets[f].ball is None]
    shifted = {name: replace(facets[before], id=name) for name, before in zip(plain, [plain[-1], *plain[:-1]], strict=True)}
    spoilt = replace(cell, artefact=replace(cell.artefact, facets={**facets, **shifted}))
    return spoilt, readings, Answer(("facet_names",))


@slip
def one_normal_inward(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    names = _plain(cell, readings)
    name = names[int(rng.integers(len(names)))]
    return _facet(cell, name, normal=_minus(cell.artefact.facets[name].normal)), readings, Answer(("facet_place",), f" {name} ")


@slip
def all_normals_inward(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    facets = {k: replace(f, normal=_minus(f.normal)) for k, f in cell.artefact.facets.items()}
    if any(f.ball is not None for f in facets.values()):
        return None  # refused when the file is read: normals on a ball are checked against its centre
    return replace(cell, artefact=replace(cell.artefact, facets=facets)), readings, Answer(("facet_place", "tip_radius"))


@slip
def sign_of_a_coordinate(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    names = _plain(cell, readings)
    choices = [
        (f, i) for f in names for i in range(3) if abs(cell.artefact.facets[f].point[i] * cell.artefact.facets[f].normal[i]) > 5
    ]
    if not choices:
        return None
    name, i = choices[int(rng.integers(len(choices)))]
    point = list(cell.artefact.facets[name].point)
    point[i] = -point[i]
    return _facet(cell, name, point=tuple(point)), readings, Answer(("facet_place",), f" {name} ")


@slip
def a_digit_of_a_coordinate(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    names = _plain(cell, readings)
    name = names[int(rng.integers(len(names)))]
    facet = cell.artefact.facets[name]
    i = int(np.argmax(np.abs(facet.normal)))
    point = list(facet.point)
    point[i] += float(rng.choice([-100.0, -30.0, -10.0, -3.0, 3.0, 10.0, 30.0, 100.0]))
    return _facet(cell, name, point=tuple(point)), readings, Answer(("facet_place",), f" {name} ")


@slip
def normal_along_another_axis(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    names = _plain(cell, readings)
    name = names[int(rng.integers(len(names)))]
    own = np.array(cell.artefact.facets[name].normal)
    others = [tuple(e) for e in (*np.eye(3).tolist(), *(-np.eye(3)).tolist()) if abs(np.dot(e, own)) < 0.8]
    normal = others[int(rng.integers(len(others)))]
    return _facet(cell, name, normal=normal), readings, Answer(("facet_place",), f" {name} ")


def _moved(artefact: Artefact, matrix: np.ndarray, shift: np.ndarray) -> Artefact:
    def point(v: Any) -> Any:
        return tuple((matrix @ np.array(v) + shift).tolist())

    def direction(v: Any) -> Any:
        return tuple((matrix @ np.array(v)).tolist())

    facets = {
        k: replace(
            f,
            point=point(f.point),
            normal=direction(f.normal),
            surface=f.surface
            if f.surface is None or f.surface.axis is None
            else replace(f.surface, axis=direction(f.surface.axis)),
        )
        for k, f in artefact.facets.items()
    }
    balls = {k: replace(b, centre=point(b.centre)) for k, b in artefact.balls.items()}
    return replace(artefact, facets=facets, balls=balls, obstacles=())


@slip
def table_turned_by_a_quarter(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    sign = float(rng.choice([-1.0, 1.0]))
    quarter = np.array([[0.0, -sign, 0.0], [sign, 0.0, 0.0], [0.0, 0.0, 1.0]])
    # Where C carries the table, C counted from another zero is one and the same.
    return replace(cell, artefact=_moved(cell.artefact, quarter, np.zeros(3))), readings, Answer(("table_placement", "zero_offset"))


@slip
def table_upside_down_in_its_frame(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    mirror = np.diag([1.0, 1.0, -1.0])
    return replace(cell, artefact=_moved(cell.artefact, mirror, np.zeros(3))), readings, Answer(("table_placement",))


@slip
def table_mirrored(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    mirror = np.diag([-1.0, 1.0, 1.0])
    return replace(cell, artefact=_moved(cell.artefact, mirror, np.zeros(3))), readings, Answer(("table_placement",))


@slip
def origin_of_the_table_elsewhere(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    shift = rng.choice([-1.0, 1.0], 3) * rng.uniform(5, 40, 3)
    return replace(cell, artefact=_moved(cell.artefact, np.eye(3), shift)), readings, Answer(("table_placement",))


@slip
def origin_of_the_table_at_another_height(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    shift = np.array([0.0, 0.0, float(rng.choice([-1, 1])) * rng.uniform(5, 60)])
    return replace(cell, artefact=_moved(cell.artefact, np.eye(3), shift)), readings, Answer(("table_placement",))


@slip
def length_of_the_bar(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    bar = cell.artefact.scale_bar
    if bar is None:
        return None
    off = float(rng.choice([-3.0, -1.0, 1.0, 3.0]))
    artefact = replace(cell.artefact, scale_bar=replace(bar, length=bar.length + off))
    return replace(cell, artefact=artefact), readings, Answer(("scale_bar",))


@slip
def radius_of_a_ball(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    balls = cell.artefact.balls
    if not balls:
        return None
    key = list(balls)[int(rng.integers(len(balls)))]
    artefact = replace(cell.artefact, balls={**balls, key: replace(balls[key], radius=balls[key].radius - 0.7)})
    return replace(cell, artefact=artefact), readings, Answer(("scale_bar",), f"ball {key}")


# readings.csv


@slip
def columns_X_and_Y_exchanged(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    def change(p: np.ndarray) -> None:
        p[:, [0, 1]] = p[:, [1, 0]]

    return cell, _columns(readings, change), Answer(("axes_exchanged",), "X and Y")


@slip
def columns_Y_and_Z_exchanged(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    def change(p: np.ndarray) -> None:
        p[:, [1, 2]] = p[:, [2, 1]]

    return cell, _columns(readings, change), Answer(("axes_exchanged",), "Y and Z")


@slip
def rotary_columns_exchanged(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    if len(cell.machine.rotary) < 2:
        return None

    def change(p: np.ndarray) -> None:
        p[:, [3, 4]] = p[:, [4, 3]]

    return cell, _columns(readings, change), Answer(("axes_exchanged", "another_program"))


@slip
def readings_in_inches(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    def change(p: np.ndarray) -> None:
        p[:, :3] /= 25.4

    return cell, _columns(readings, change), Answer(("unit",), "X, Y and Z")


@slip
def readings_in_metres(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    def change(p: np.ndarray) -> None:
        p[:, :3] /= 1000

    return cell, _columns(readings, change), Answer(("unit",), "X, Y and Z")


@slip
def angles_in_radians(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    if not _turned(cell, readings):
        return None

    def change(p: np.ndarray) -> None:
        p[:, 3:-1] *= math.pi / 180  # the file's degrees are radians: what is read as degrees becomes radians once more

    return cell, _columns(readings, change), Answer(("unit",), "radian")


@slip
def X_in_diameters(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    def change(p: np.ndarray) -> None:
        p[:, 0] *= 2

    return cell, _columns(readings, change), Answer(("unit",), "X ")


@slip
def sign_of_the_column_Z(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    def change(p: np.ndarray) -> None:
        p[:, 2] *= -1

    return cell, _columns(readings, change), Answer(("sense",), "Z ")


@slip
def work_coordinates(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    shift = rng.choice([-1.0, 1.0], 3) * rng.uniform(20, 400, 3)

    def change(p: np.ndarray) -> None:
        p[:, :3] += shift

    return cell, _columns(readings, change), Answer(("zero_offset",), "X")


@slip
def tool_length_still_active(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    def change(p: np.ndarray) -> None:
        p[:, 2] -= cell.machine.probe.length

    return cell, _columns(readings, change), Answer(("zero_offset", "stylus_length"))


@slip
def zero_of_a_rotary_axis(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    if not (turned := _turned(cell, readings)):
        return None
    name = turned[int(rng.integers(len(turned)))]
    off = math.radians(float(rng.choice([-1, 1])) * rng.uniform(0.5, 8))

    def change(p: np.ndarray) -> None:
        p[:, cell.machine.column(name)] += off

    return cell, _columns(readings, change), Answer(("zero_offset", "table_placement", "another_program"))


@slip
def one_indexation_turned_by_hand(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    turned = _turned(cell, readings)
    at = _indexation(cell, readings, rng)
    if not turned or at is None:
        return None
    name = turned[int(rng.integers(len(turned)))]
    off = math.radians(float(rng.choice([-1, 1])) * rng.uniform(0.2, 5))

    def change(p: np.ndarray) -> None:
        p[at, cell.machine.column(name)] += off

    return cell, _columns(readings, change), Answer(("indexation",), f"{name} was")


def _indexation(cell: Cell, readings: Readings, rng: Rng) -> np.ndarray | None:
    turning = [cell.machine.column(n) for n in (*cell.machine.rotary, "S")]
    at = np.cumsum(np.r_[0, np.any(np.abs(np.diff(readings.position[:, turning], axis=0)) > 1e-3, axis=1)])
    big = [i for i in range(at.max() + 1) if np.sum(at == i) >= 5]
    return np.flatnonzero(at == big[int(rng.integers(len(big)))]) if at.max() >= 3 else None


@slip
def rows_one_off(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    def change(p: np.ndarray) -> None:
        p[:] = np.roll(p, 1, axis=0)

    return cell, _columns(readings, change), Answer(("row_order",))


@slip
def rows_one_off_from_a_row_on(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    first = int(rng.integers(len(readings) // 4, 3 * len(readings) // 4))
    linear = [cell.machine.column(name) for name in cell.machine.linear]

    def change(p: np.ndarray) -> None:
        p[first:, linear] = p[first - 1 : -1, linear].copy()

    return cell, _columns(readings, change), Answer(("row_order",), f"from touch {int(readings.touch[first])} on")


@slip
def newest_record_first(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    def change(p: np.ndarray) -> None:
        p[:] = p[::-1].copy()

    return cell, _columns(readings, change), Answer(("row_order", "another_program"))


@slip
def rows_sorted_by_facet(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    order = np.argsort(np.array(readings.facet), kind="stable")
    return cell, readings.rows(order), Answer(("time_order",))


@slip
def half_of_the_rows_missing(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    return cell, readings.rows(np.sort(rng.choice(len(readings), len(readings) // 2, replace=False))), Answer(("missing_touches",))


@slip
def interrupted_after_two_thirds(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    return cell, readings.rows(np.arange(2 * len(readings) // 3)), Answer(("missing_touches",))


@slip
def a_block_of_rows_twice(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    begin = int(rng.integers(len(readings) // 2))
    rows = np.r_[np.arange(len(readings)), begin + np.arange(20)]
    return cell, readings.rows(np.sort(rows)), Answer(("repeated_touches", "copied_positions"))


@slip
def rounded_to_hundredths(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    def change(p: np.ndarray) -> None:
        p[:, :3] = np.round(p[:, :3], 2)

    return cell, _columns(readings, change), Answer(("rounded_positions",))


@slip
def nominal_positions_reported(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    from sim_controller.simulate import simulate
    from tango_cnc.records import World

    copied = simulate(cell.machine, cell.artefact, cell.strategy, World())
    return cell, replace(readings, position=copied.position), Answer(("copied_positions",))


def _along(cell: Cell, readings: Readings, way: float) -> Readings:
    from sim_controller.simulate import simulate
    from tango_cnc.records import World

    one = simulate(cell.machine, cell.artefact, cell.strategy, World())
    grown = replace(cell.machine, probe=replace(cell.machine.probe, tip_radius=cell.machine.probe.tip_radius + 1.0))
    other = simulate(grown, cell.artefact, cell.strategy, World())
    return replace(readings, position=readings.position + way * (other.position - one.position))


@slip
def standoff_positions_reported(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    return cell, _along(cell, readings, cell.strategy.approach.standoff), Answer(("another_point",), "stand-off")


@slip
def radius_already_taken_off(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    return cell, _along(cell, readings, -cell.machine.probe.tip_radius), Answer(("tip_radius",), "taken off")


@slip
def a_column_that_never_changes(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    i = int(rng.integers(3))

    def change(p: np.ndarray) -> None:
        p[:, i] = p[0, i]

    return cell, _columns(readings, change), Answer(("constant_column",))


@slip
def readings_of_another_program(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    count = len(cell.strategy.indexations)
    if count < 4:
        return None
    order = rng.permutation(count)
    while (order == np.arange(count)).all():  # the same program
        order = rng.permutation(count)
    strategy = replace(cell.strategy, indexations=tuple(cell.strategy.indexations[int(i)] for i in order))
    return replace(cell, strategy=strategy), readings, Answer(("another_program",))


@slip
def readings_of_another_cell(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    """The same machine and strategy with another table on it, each facet some millimetres to decimetres elsewhere."""
    facets = {
        k: replace(f, point=tuple((np.array(f.point) + rng.uniform(-60, 60) * np.array(f.normal)).tolist()))
        for k, f in cell.artefact.facets.items()
        if f.ball is None
    }
    if len(facets) < len(cell.artefact.facets):
        return None
    return replace(cell, artefact=replace(cell.artefact, facets=facets)), readings, Answer(("another_table",))


@slip
def a_chip_on_three_touches(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    rows = rng.choice(len(readings), 3, replace=False)
    shifted = _along(cell, readings, 0.3)

    def change(p: np.ndarray) -> None:
        p[rows] = shifted.position[rows]

    spoilt = _columns(readings, change)
    return cell, spoilt, Answer(("single_touches",))


@slip
def a_slip_in_one_number(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    row, i = int(rng.integers(len(readings))), int(rng.integers(3))

    def change(p: np.ndarray) -> None:
        p[row, i] += float(rng.choice([-10.0, -1.0, 1.0, 10.0]))

    return cell, _columns(readings, change), Answer(("single_touches", "facet_names"))


@slip
def facets_measured_from_another_datum_than_the_balls(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    """Someone took z of the facets from the top of the pallet, and of the balls from its pocket."""
    facets, shift = cell.artefact.facets, np.zeros(3)
    if len({f.ball is None for f in facets.values()}) < 2:
        return None
    shift[int(rng.integers(3))] = float(rng.choice([-1, 1]) * rng.uniform(2, 12))
    moved = {k: f if f.ball else replace(f, point=tuple((np.array(f.point) + shift).tolist())) for k, f in facets.items()}
    return replace(cell, artefact=replace(cell.artefact, facets=moved)), readings, Answer(("table_placement",), "balls")


@slip
def another_set_of_balls(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    balls, off = cell.artefact.balls, float(rng.choice([-1.0, -0.5, 0.5, 1.0]))
    if len(balls) < 2:
        return None
    others = {k: replace(b, radius=b.radius + off) for k, b in balls.items()}
    return replace(cell, artefact=replace(cell.artefact, balls=others)), readings, Answer(("scale_bar", "unit"), "balls")


@slip
def terms_of_the_first_try_left_standing(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    if not cell.machine.rotary:  # S2 is all that such a machine has
        return None
    return replace(cell, terms=(str(rng.choice(["S1", "S2"])),)), readings, Answer(("few_terms",), "S3")
