"""A strategy with several styli: which one a command is about, and what is left for the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from ..plan import by_stylus, last_motion
from ..records import Cell, InputError, Plan, TermItem
from ..touches import Touches, of_facets
from ._common import Decorator

if TYPE_CHECKING:
    from ..estimate import Estimate

LONGER = 60.0  # mm
STEPS = (5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 80.0, 100.0)  # mm, differences of length that are tried

stylus_option: Decorator = click.option(
    "--stylus",
    "stylus",
    type=click.IntRange(1),
    metavar="N",
    help="Of a strategy with several styli: the touches of stylus N [default: the first of the strategy].",
)


def of_stylus(cell: Cell, number: int | None) -> Cell:
    """cell, --stylus → the cell with that stylus in its spindle and its indexations alone. Raises InputError for another number."""
    parts = by_stylus(cell)
    if number is None:
        return parts[0]
    found = next((part for part in parts if part.machine.stylus == number), None)
    if found is None:
        known = ", ".join(str(part.machine.stylus) for part in parts)
        raise InputError(f"--stylus: found {number}; allowed: {known}, the styli that the strategy states")
    return found


def left(cell: Cell, part: Cell, command: str) -> list[str]:
    """whole cell, the part with one stylus, command → a sentence on each stylus that comes after it."""
    return [
        f"the touches with stylus {other.machine.stylus} ({other.machine.probe.length:g} mm) are a program of their own: "
        f"'{command} --stylus {other.machine.stylus}'"
        for other in by_stylus(cell)
        if other.strategy.before > part.strategy.before
    ]


def with_second(made: Plan, terms: Sequence[TermItem], degree: int) -> tuple[float, tuple[str, ...], dict[str, Any]]:
    """plan with one stylus, terms, degree → length of another one, mm, ISO figures decided by every touch made again with it, and
    what its length has to do with that (`by_length`).

    That is the second one of machine.yaml, else one that is `LONGER` mm longer.
    """
    machine, n = made.machine, len(made.touches)
    other = machine.styli[1] if machine.styli else replace(machine.probe, length=machine.probe.length + LONGER)
    both = replace(machine, styli=(machine.probe, other))
    facets, moved = [t.facet for t in made.touches] * 2, np.tile(last_motion(made), (2, 1))
    position = np.tile(np.array([t.contact for t in made.touches]), (2, 1))
    touches = of_facets(both, made.artefact, facets, position, moved, np.repeat([1, 2], n))
    return other.length, _decided(touches.nominal, terms, degree), by_length(touches, terms, degree)


def bought(made: Plan, terms: Sequence[TermItem], degree: int) -> dict[str, Any]:
    """plan with one stylus, terms, degree → ISO figures that it decides, and those of `with_second`."""
    from ..identify import select
    from ..iso230.signed import decided

    facets, position = [t.facet for t in made.touches], np.array([t.contact for t in made.touches])
    alone, withheld = decided(select(of_facets(made.machine, made.artefact, facets, position, last_motion(made)), terms, degree))
    length, together, lengths = with_second(made, terms, degree)
    return {
        "length_mm": length,
        "figures": len(alone) + len(withheld),
        "alone": len(alone),
        "together": len(together),
        "more": [name for name in together if name not in alone],
        "by_length": lengths,
    }


def by_length(touches: Touches, terms: Sequence[TermItem], degree: int) -> dict[str, Any]:
    """touches with several styli, terms, degree → their lengths, mm; ISO figures that are decided because these differ, which as
    many touches with styli as long as the first would not decide; where they differ by little, the least difference that adds
    some, and what `LONGER` mm would add.
    """
    from ..iso230.doubt import lengths  # with it come fits, and commands beside a machine make none

    long = lengths(touches)
    first, apart = long[0], max(long) - min(long)
    equal = set(_decided(_as_long(touches, first, 0.0), terms, degree))

    def adds(difference: float) -> list[str]:
        return [name for name in _decided(_as_long(touches, first, difference), terms, degree) if name not in equal]

    own = _decided(touches.nominal, terms, degree)
    found: dict[str, Any] = {"lengths_mm": list(long), "adds": [name for name in own if name not in equal]}
    if apart < LONGER:
        steps = [] if found["adds"] else [step for step in STEPS if step > apart]
        least = next(((step, some) for step in steps if (some := adds(step))), None)
        found["least"] = None if least is None else {"difference_mm": least[0], "adds": least[1]}
        found["longer"] = {"difference_mm": LONGER, "adds": adds(LONGER)}
    return found


def lengths_said(found: dict[str, Any], named: Callable[[Sequence[str]], str]) -> str:
    """result of `by_length`, names → how a sentence lists them → what the lengths of styli add, and what others would."""
    adds, least, longer = found["adds"], found.get("least"), found.get("longer")
    text = f"their lengths add {named(adds)}"
    if not adds:
        long = " and ".join(f"{one:g}" for one in found["lengths_mm"])
        text = f"their lengths add nothing: {long} mm part no tilt from straightness"
        if least is None:
            return f"{text}, and no other length would here"
        text += f"; a difference of {least['difference_mm']:g} mm would add {named(least['adds'])}"
    known = {*adds, *(least["adds"] if least else [])}
    more = [name for name in longer["adds"] if name not in known] if longer else []
    return f"{text}; one of {longer['difference_mm']:g} mm also {named(more)}" if longer and more else text


def alike_said(result: Estimate, terms: Sequence[TermItem], degree: int) -> str:
    """estimate, its terms, degree → that the styli are too much of one length to part anything; nothing where they are not."""
    from ..iso230.doubt import lengths

    long = lengths(result.model.touches)
    if len(long) < 2 or max(long) - min(long) >= LONGER:
        return ""
    found = by_length(result.model.touches, terms, degree)
    return "" if found["adds"] else f"styli, for ISO figures: {lengths_said(found, ', '.join)}"


def _as_long(touches: Touches, first: float, difference: float) -> Touches:
    """touches with several styli, length of the first, mm → the same where all others are that much longer than it."""
    machine = touches.machine
    used: list[int] = [] if touches.stylus is None else np.unique(touches.stylus).tolist()
    more = {number: difference if i else 0.0 for i, number in enumerate(used)}
    styli = tuple(
        replace(probe, length=first + more[number]) if number in more else probe for number, probe in enumerate(machine.styli, 1)
    )
    here = replace(machine, styli=styli, probe=styli[machine.stylus - 1])
    same = of_facets(here, touches.artefact, touches.facet, touches.position, touches.direction, touches.stylus)
    return same.nominal


def _decided(touches: Touches, terms: Sequence[TermItem], degree: int) -> tuple[str, ...]:
    from ..identify import select
    from ..iso230.signed import decided

    return decided(select(touches, terms, degree))[0]


def folder_of(folder: Path, cell: Cell) -> Path:
    """program folder, cell with one stylus → where the programs of that stylus go."""
    return folder if cell.machine.stylus == 1 else folder / f"stylus{cell.machine.stylus}"
