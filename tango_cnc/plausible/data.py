"""What the readings themselves give away: touches that are missing, made twice, made elsewhere or all alike, clocks, roundings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..asked import Asked, asked, resume_of
from ..judgement import Verdict
from ..records import Cell, Readings
from ..texts import joined, say
from ..touches import FAR
from .copies import alike_by_chance, copied, last_digit, too_alike
from .rounding import away, counted, grid, partly, swamping

NEEDED = 0.9  # share of the planned touches without which a result is doubtful
ENOUGH = 0.6  # share below which commands end with 1: about half of the plan
HARDLY = 0.25  # share below which a machine is hardly measured
FIRST = 3  # touches that are named where many are missing
FEW = 8  # numbers that a sentence names
SHORT = 0.25  # of the least time that the moves take, below which touches come too fast: minutes are a sixtieth
LONG = 200.0  # times that least time, which half of the touches exceed: milliseconds are a thousand times as many
EXACT = 2e-5  # mm from the nominal contact: nearer than any probe repeats
LONGEST = 20  # touches that may go one way by the plan
CHANCE = 1e-6  # that so many honest touches have the position of another one, below which they were copied
COARSE = 0.01  # mm: positions that are all whole multiples of it were rounded, or come from a display


class Remark(NamedTuple):
    """A sentence on the readings, and the best verdict that it leaves."""

    verdict: Verdict
    text: str
    touches: tuple[int, ...] = ()
    kind: str = ""  # of a mistake with the readings; empty: a symptom, for which the mistake has to be looked for
    key: str = ""  # column of the readings
    change: str = ""
    incomplete: bool = False
    file: str = "readings"  # in which the mistake is: readings, machine, artefact, strategy
    sure: bool = False  # it explains the result, whatever else is tried
    moves: tuple[str, ...] = ()  # coefficients that it makes untrusted
    lost: bool = False  # `touches` are planned ones that are missing
    hidden: tuple[tuple[str, float], ...] = ()  # of `moves`: by how much (mm, rad) what no touch shows may move them


def remarks(cell: Cell, readings: Readings, run: Mapping[str, Any] | None = None) -> Iterator[Remark]:
    """cell, readings, readings.json → what is wrong with the readings themselves."""
    touches = asked(cell, run)
    yield from _missing(touches, readings, resume_of(run))
    yield from _twice(readings)
    pasted = list(_pasted(cell, readings))
    yield from pasted or _echoed(cell, readings)
    yield from _clock(readings)
    yield from _sorted(cell, readings)
    yield from () if (run or {}).get("simulated") else _pace(cell, readings)  # a simulated control is as fast as it can
    yield from _rounded(cell, readings)
    yield from _alike(readings)
    yield from _nominal(cell, readings)


def listed(numbers: tuple[int, ...] | list[int], most: int = FEW) -> str:
    """touch numbers, how many at most → the first of them for a sentence."""
    first = ", ".join(map(str, numbers[:most]))
    return first if len(numbers) <= most else say("plausible.readings.more", first=first, count=len(numbers) - most)


def _missing(touches: Asked, readings: Readings, how: str) -> Iterator[Remark]:
    everything = touches.made
    passes = sorted(set(zip(readings.day.tolist(), readings.cycle.tolist(), strict=True)))
    made = set(
        zip(
            readings.day[readings.ok].tolist(),
            readings.cycle[readings.ok].tolist(),
            readings.touch[readings.ok].tolist(),
            strict=True,
        )
    )
    lacking = [(d, c, t) for d, c in passes for t in sorted(everything) if (d, c, t) not in made]
    expected = len(everything) * len(passes)
    share = 1 - len(lacking) / expected if expected else 1.0
    if lacking:
        numbers = tuple(t for _, _, t in lacking)
        gone = len({t for t in numbers} - set(readings.touch.tolist()))
        text = say(
            "plausible.readings.planned_touches_missing_made_no",
            count=len(lacking),
            expected=expected,
            numbers=listed(numbers, FIRST),
            word=say("plausible.readings.them_not_file", gone=gone) if 0 < gone < len(lacking) else "",
        )
        if share < NEEDED:
            hint = (
                say("plausible.readings.go_on_with_tango_run", more=how.removeprefix("--resume"))
                if gone
                else say("plausible.readings.look_for_what_kept_them")
            )
            verdict: Verdict = "implausible" if share < HARDLY else "doubtful"
            if not gone and share < ENOUGH:
                hint = say("plausible.readings.compare_with_machine", hint=hint)
            there = say("plausible.readings.there", expected=expected - len(lacking)) if share < ENOUGH else ""
            told = joined("", (text, ": ", there, hint))
            yield Remark(verdict, told, numbers, "missing_touches", "touch", hint, incomplete=share < ENOUGH, lost=True)
        else:
            yield Remark("trustworthy", text, numbers, lost=True)
    if beyond := sorted({int(t) for t in readings.touch if not 1 <= t <= len(touches)}):
        yield Remark(
            "doubtful",
            say("plausible.readings.touches_readings_not_strategy_which", beyond=listed(beyond), count=len(touches)),
            tuple(beyond),
            "another_program",
            "touch",
            say("plausible.readings.take_strategy_yaml_program_was"),
        )


def _twice(readings: Readings) -> Iterator[Remark]:
    keys = zip(readings.touch.tolist(), readings.cycle.tolist(), readings.day.tolist(), strict=True)
    many = sorted({key[0] for key, n in Counter(keys).items() if n > 1})
    if many:
        yield Remark(
            "doubtful",
            say("plausible.readings.touches_readings_more_than_once", many=listed(many)),
            tuple(many),
            "repeated_touches",
            "touch",
            say("plausible.readings.keep_one_row_each"),
        )


def _echoed(cell: Cell, readings: Readings) -> Iterator[Remark]:
    rows, count = np.unique(readings.position[readings.ok], axis=0, return_counts=True)
    often = len(rows) and count.max() > 2 and count.sum() - len(rows) > 0.05 * count.sum()
    if often and not coarse(readings) and alike_by_chance(cell.machine, readings) < CHANCE:
        yield Remark(
            "doubtful",
            say("plausible.readings.touches_have_exactly_position_another", sum=int(count[count > 1].sum())),
            (),
            "copied_positions",
            "X, Y, Z",
            say("plausible.readings.record_position_control_latches_at"),
        )


def _pasted(cell: Cell, readings: Readings) -> Iterator[Remark]:
    found = list(copied(cell.machine, readings))
    if not found:
        yield from _agreeing(cell, readings)
        return
    (day, cycle), (first_day, first), shifted = found[0]
    days = len({d for pair in found for d, _ in pair[:2]}) > 1
    one = say("plausible.readings.day_cycle", day=day, cycle=cycle) if days else say("plausible.readings.cycle", cycle=cycle)
    other = (
        say("plausible.readings.cycle_day", first=first, first_day=first_day)
        if days
        else say("plausible.readings.cycle_2", first=first)
    )
    more = say("plausible.readings.so_do_more", count=len(found) - 1) if len(found) > 1 else ""
    how = say("plausible.readings.digit_for_digit_but_for") if shifted else say("plausible.readings.digit_for_digit")
    rows = one if not days else say("plausible.readings.rows_of_day", day=day, cycle=cycle)
    change = say("plausible.readings.delete_rows_measure_them", rows=rows)
    yield Remark(
        "implausible",
        say("plausible.readings.repeats_no_probe_does_so", one=one, other=other, how=how, more=more, change=change),
        (),
        "copied_positions",
        "cycle" if not days else "day",
        change,
        sure=True,
    )


def _agreeing(cell: Cell, readings: Readings) -> Iterator[Remark]:
    for (_, cycle), (_, first), scatter in too_alike(cell.machine, readings):
        change = say("plausible.readings.delete_or_state_repeatability", cycle=cycle)
        text = say(
            "plausible.readings.cycles_agree_better",
            cycle=cycle,
            first=first,
            scatter=f"{1e3 * scatter:.2g}",
            stated=f"{1e3 * cell.machine.probe.repeatability:.2g}",
            change=change,
        )
        yield Remark("doubtful", text, (), "copied_positions", "cycle", change)
        return


def _clock(readings: Readings) -> Iterator[Remark]:
    back = [
        int(readings.touch[i + 1]) for i in np.flatnonzero(np.diff(readings.time) < 0) if readings.day[i + 1] == readings.day[i]
    ]
    if back:
        yield Remark(
            "doubtful",
            say("plausible.readings.time_runs_backward_at_touch", back=listed(back)),
            tuple(back),
            "time_order",
            "time_s",
            say("plausible.readings.put_rows_into_order_measurement"),
        )


def _sorted(cell: Cell, readings: Readings) -> Iterator[Remark]:
    """No plan goes one way through a whole run while its touches are all over the table: a column was sorted without its rows."""
    used = readings.rows(readings.ok)
    if len(used) < LONGEST:
        return
    for name in cell.machine.linear:
        steps = np.diff(used.position[:, used.axes.index(name)])
        if not steps.any() or not ((steps >= 0).all() or (steps <= 0).all()):
            continue
        if np.median(away(cell, used)) > FAR:
            change = say("plausible.readings.copy_column_again", name=name)
            yield Remark("implausible", say("plausible.readings.column_sorted_alone", name=name), (), "row_order", name, change)


def _pace(cell: Cell, readings: Readings) -> Iterator[Remark]:
    """Between two touches the axes go at rapid at most, and the search has its feed: who is much faster has another unit."""
    speed = np.array([axis.rapid / 60 if axis.rapid else np.inf for axis in cell.machine.axes])
    ways = np.abs(np.diff(readings.position, axis=0)) / speed
    approach = cell.strategy.approach
    least = ways.max(axis=1) + approach.standoff / (approach.feed / 60)
    same = (np.diff(readings.day) == 0) & (np.diff(readings.cycle) == 0)
    took, least = np.diff(readings.time)[same], least[same]
    if len(took) < FEW or (took < 0).any():
        return
    short, long = took.sum() < SHORT * least.sum(), np.median(took / least) > LONG
    if short or long:
        numbers = {"count": len(took) + 1, "took": f"{took.sum():.4g}", "least": f"{least.sum():.4g}"}
        yield Remark("trustworthy", say(f"plausible.readings.time_{'short' if short else 'long'}", **numbers))


def coarse(readings: Readings) -> float:
    """readings → mm, of which every position is a whole multiple as displays show it; 0 where there are more digits."""
    values = readings.position[readings.ok][:, [i for i, name in enumerate(readings.axes) if name in "XYZ"]]
    digit = last_digit(values) if len(values) >= 10 else 0.0
    return digit if digit >= COARSE else 0.0


def _rounded(cell: Cell, readings: Readings) -> Iterator[Remark]:
    change = say("plausible.readings.record_all_digits_control_has")
    if digit := coarse(readings):
        text = say("plausible.readings.every_position_whole_multiple_mm", digit=f"{digit:g}")
        yield Remark("doubtful", text, (), "rounded_positions", "X, Y, Z", change)
        return
    if step := grid(cell, readings):
        if step >= swamping(cell):
            axes = ", ".join(cell.machine.linear)
            text = say("plausible.readings.positions_of_axes_in_steps", axes=axes, step=f"{step:.5g}", change=change)
            yield Remark("doubtful", text, (), "rounded_positions", axes, change)
        return
    if found := list(partly(cell, readings)):
        axes = ", ".join(name for name, _, _ in found)
        touches = tuple(sorted({t for _, _, numbers in found for t in numbers}))
        longest = f"{max(step for _, step, _ in found):g}"
        text = say("plausible.readings.positions_of_axes_rounded", axes=axes, numbers=listed(touches), step=longest, change=change)
        yield Remark("doubtful", text, touches, "rounded_positions", axes, change)
    elif stepped := list(counted(cell, readings)):
        axes, longest = ", ".join(name for name, _ in stepped), f"{max(step for _, step in stepped):.5g}"
        text = say("plausible.readings.positions_of_axes_in_steps", axes=axes, step=longest, change=change)
        yield Remark("doubtful", text, (), "rounded_positions", axes, change)


def _alike(readings: Readings) -> Iterator[Remark]:
    used = readings.position[readings.ok]
    if len(used) < 4:
        return
    for i, name in enumerate(readings.axes):
        if name in "XYZ" and np.ptp(used[:, i]) < 1e-9:
            text = say("plausible.readings.same_all_touches_column_readings", name=name)
            yield Remark(
                "implausible", text, (), "constant_column", name, say("plausible.readings.see_what_control_writes_for", name=name)
            )


def _nominal(cell: Cell, readings: Readings) -> Iterator[Remark]:
    """No machine trips its probe where the drawing says: then the control reports where it was sent."""
    used = readings.rows(readings.ok)
    if len(used) < 4:
        return
    if np.median(away(cell, used)) < EXACT:
        yield Remark(
            "implausible",
            say("plausible.readings.touches_were_made_exactly_where"),
            (),
            "copied_positions",
            ", ".join(cell.machine.linear),
            say("plausible.readings.record_position_control_latches_at_2"),
        )
