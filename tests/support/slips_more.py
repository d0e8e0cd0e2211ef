"""More mistakes of real shops, written before it was seen how they are judged: spreadsheets, pallets, styli.

Each is a slip as in `slips.py`: a sound cell and its readings become those of the mistake, with the answer that a judge accepts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from support.slips import Answer, Rng, Slip, Spoilt, _along, _columns, _moved, _probe
from tango_cnc.records import Cell, Readings

MORE: dict[str, Slip] = {}


def more(call: Slip) -> Slip:
    MORE[call.__name__] = call
    return call


@more
def positions_shuffled_among_all_rows(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    """Someone sorted the positions, and not the names beside them."""
    shuffled = readings.position[rng.permutation(len(readings))]
    return cell, replace(readings, position=shuffled), Answer(("row_order", "another_program"))


@more
def one_column_sorted_alone(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    column = int(rng.integers(3))

    def change(p: np.ndarray) -> None:
        p[:, column] = np.sort(p[:, column])

    return cell, _columns(readings, change), Answer(("row_order",), "XYZ"[column])


@more
def decimal_point_lost_in_some_rows(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    """A spreadsheet took 12.345 for twelve thousand."""
    rows = rng.choice(len(readings), max(len(readings) // 20, 4), replace=False)
    column = int(rng.integers(3))

    def change(p: np.ndarray) -> None:
        p[rows, column] *= 1000

    return cell, _columns(readings, change), Answer(("single_touches", "unit", "unit_since"))


@more
def another_stylus_longer_and_with_a_larger_ball(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    probe = cell.machine.probe
    wrong = _probe(cell, length=probe.length + float(rng.uniform(10, 30)), tip_radius=probe.tip_radius / 2)
    return wrong, readings, Answer(("stylus_length", "tip_radius"))


@more
def pallet_the_other_way_round(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    half = np.diag([-1.0, -1.0, 1.0])
    return replace(cell, artefact=_moved(cell.artefact, half, np.zeros(3))), readings, Answer(("table_placement", "zero_offset"))


@more
def radius_taken_off_in_the_plane_alone(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    """The control corrects the radius of the ball in X and Y, and not in Z."""
    both = _along(cell, readings, -cell.machine.probe.tip_radius)

    def change(p: np.ndarray) -> None:
        p[:, :2] = both.position[:, :2]

    return cell, _columns(readings, change), Answer(("tip_radius", "late_touches"))


@more
def tool_length_active_in_the_first_part(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    last = int(rng.uniform(0.2, 0.6) * len(readings))

    def change(p: np.ndarray) -> None:
        p[:last, 2] -= cell.machine.probe.length

    return cell, _columns(readings, change), Answer(("zero_since",), "Z")


@more
def mirror_left_on_from_a_touch_on(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    first, column = int(rng.uniform(0.3, 0.7) * len(readings)), int(rng.integers(2))

    def change(p: np.ndarray) -> None:
        p[first:, column] *= -1

    return cell, _columns(readings, change), Answer(("lost_sign",), "XY"[column])


@more
def drawing_with_Y_upward(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    upward = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    return replace(cell, artefact=_moved(cell.artefact, upward, np.zeros(3))), readings, Answer(("table_placement",))


@more
def spindle_oriented_a_quarter_off(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    """M19 stops where the builder of the machine says, and not where the column S has it; the stylus runs out by 0.1 mm."""
    column = cell.machine.column("S")
    if np.ptp(readings.position[:, column]) < 0.1:
        return None

    def change(p: np.ndarray) -> None:
        p[:, column] = 0.0

    return cell, _columns(readings, change), Answer(("another_program", "column_wrong", "constant_column"), "S")


@more
def a_table_five_per_cent_larger(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    larger = float(rng.choice([0.95, 1.05]))
    facets = {k: replace(f, point=tuple((larger * np.array(f.point)).tolist())) for k, f in cell.artefact.facets.items()}
    balls = {k: replace(b, centre=tuple((larger * np.array(b.centre)).tolist())) for k, b in cell.artefact.balls.items()}
    wrong = replace(cell.artefact, facets=facets, balls=balls)
    return replace(cell, artefact=wrong), readings, Answer(("another_table", "table_placement"))


@more
def one_row_removed_beside_a_doubled_one(cell: Cell, readings: Readings, rng: Rng) -> Spoilt:
    row = int(rng.integers(5, len(readings) - 5))
    order = np.arange(len(readings))
    order[row + 1] = row
    return cell, readings.rows(order), Answer(("repeated_touches", "missing_touches"))
