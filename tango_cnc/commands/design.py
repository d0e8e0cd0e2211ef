"""`tango design`: which touches are worth making."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from ..diagnose.separate import USUAL, Separation, separation
from ..duration import of_moves
from ..files import read_cell, read_terms
from ..plan import last_motion, plan
from ..records import Cell, InputError
from ..touches import Touches, of_facets
from ._common import cell_option, json_option, write_json
from .check import positioning_feed


@click.command()
@cell_option
@click.option("--separate", nargs=2, metavar="CAUSE CAUSE", help="Which touches would tell these two causes apart.")
@click.option("--terms", help="The present model, instead of the cell's: S1 … S4 or a list, e.g. S3,EYX2.")
@json_option
def command(folder: Path, separate: tuple[str, str] | None, terms: str | None, json_file: str | None) -> None:
    """Proposes touches: with --separate, indexations to append to the strategy that tell two causes apart."""
    if not separate:
        raise InputError("design: found nothing to design for; allowed: --separate CAUSE CAUSE")
    cell = read_cell(folder)
    found = separation(planned(cell), cell.terms if terms is None else read_terms(terms), *separate)
    if not write_json(json_file, as_json(found)):
        click.echo(as_text(found))


def planned(cell: Cell) -> Touches:
    """cell → the touches of its plan at the times at which they are expected."""
    from dataclasses import replace

    made = plan(cell, "leave-out")
    position = np.array([touch.contact for touch in made.touches])
    touches = of_facets(cell.machine, cell.artefact, [t.facet for t in made.touches], position, last_motion(made))
    spent, row = np.zeros(len(touches)), {touch.number: row for row, touch in enumerate(made.touches)}
    for move, seconds in zip(made.moves, of_moves(made, positioning_feed(cell)), strict=True):
        spent[row[move.touch]] += seconds
    return replace(touches, time=np.cumsum(spent), feed=np.full(len(touches), cell.strategy.approach.feed))


def _indexation(position: dict[str, float], facets: tuple[str, ...]) -> dict[str, Any]:
    return {**{k: round(float(np.degrees(v)), 6) + 0.0 for k, v in position.items()}, "facets": list(facets)}


def as_json(found: Separation) -> dict[str, Any]:
    """separation → plain data."""
    return {
        "format": "tango-separation/1",
        "causes": list(found.causes),
        "settings": [{k: list(v) if isinstance(v, tuple) else v for k, v in s.items()} for s in found.settings],
        "apart": found.apart,
        "evidence": found.evidence,
        "together": found.together,
        "append": [{**_indexation(a.position, a.facets), "apart": a.apart, "evidence": a.evidence} for a in found.additions],
    }


def as_text(found: Separation) -> str:
    """separation → what a person reads, with lines to append to strategy.yaml."""
    one, other = found.causes
    lines = [
        f"Of the {one} that looks most like {other}, this plan sees {100 * found.apart:.1f} % that {other} cannot imitate.",
        f"An effect of {USUAL * 1e3:g} µm is told apart with a score of {found.evidence:.1f} (10: very strong evidence; 2: none).",
    ]
    if found.together < found.evidence + 1.0:
        again = "No indexation of this plan, made again at its end, changes that: touch other facets or at other angles."
        return "\n".join([*lines, again])
    lines.append("Appended to the indexations of strategy.yaml, each of these makes that score")
    for a in found.additions:
        entry = _indexation(a.position, a.facets)
        facets = ", ".join(entry.pop("facets"))
        place = ", ".join(f"{k}: {v:g}" for k, v in entry.items())
        lines.append(f"  {a.evidence:6.1f}   - {{{place}, facets: [{facets}]}}")
    lines.append(f"and all together {found.together:.1f}.")
    return "\n".join(lines)
