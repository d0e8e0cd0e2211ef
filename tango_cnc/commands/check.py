"""`tango check`: is the cell sound, can the machine do it, what will it tell, how long does it take?"""

from __future__ import annotations

from collections import Counter
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click
import numpy as np

from ..duration import PROOF, duration, proof, saved, spoken
from ..files import blamed_on, drawn_lines, drawn_sizes, read_cell, read_terms, write_text
from ..files.normals import refuse_inward
from ..identify import condition_number, scaled_condition_number, select, summary
from ..model import known, linearise
from ..plan import last_motion, plan
from ..records import Cell, InputError, Plan, TermItem
from ..report.units import shown
from ..touches import of_facets
from ._common import Output, cell_option, dialect, json_option, table, write_json
from ._plan import obstructed_option

PLACE = "Begin 30"  # in the list of commands

NAMED = 8  # touches that are named one by one


@click.command()
@cell_option
@click.option("--terms", help="Instead of the cell's: S1 … S4 or a list, e.g. S3,EYX2.")
@click.option("--degree", type=click.IntRange(1, 6), default=3, show_default=True, help="Highest degree of the polynomials of S4.")
@obstructed_option
@click.option("--picture", type=Output(), metavar="FILE", help="Draw axes, pivots and facets as .svg.")
@json_option
def command(
    folder: Path, terms: str | None, degree: int, obstructed: str | None, picture: Path | None, json_file: str | None
) -> int:
    """Validates the cell, plans it, and says what the touches of the program would and would not tell.

    What 'tango plan' would refuse is refused here too: the whole program is made and read back, and nothing is written. Exit
    status 1 when something that the terms ask for cannot be seen, or 'tango plan' refuses touches of the strategy; what is said
    then is without these.
    """
    if picture is not None and picture.suffix.lower() != ".svg":
        raise InputError(f"--picture: found {picture}; allowed: a file that ends in .svg")
    cell = read_cell(folder)
    refuse_inward(cell)
    if picture is not None:
        from ..report.machine_svg import drawing

        write_text(picture, drawing(cell.machine, cell.artefact))
        click.echo(f"the machine as machine.yaml and artefact.yaml have it → {picture}", err=True)
    refused = None
    try:
        made = plan(cell, obstructed)
    except InputError as error:
        # Whatever is beyond leaving out is still an error, and says so.
        made, refused = plan(cell, "leave-out"), str(error)
    proven = _postable(cell, made)
    with blamed_on(folder / "tango.yaml") if terms is None else nullcontext():
        asked = cell.terms if terms is None else read_terms(terms, cell.folder)
        data = check(cell, made, asked, degree, positioning_feed(cell), proven)
    data["refused"] = refused
    if not write_json(json_file, data):
        click.echo(as_text(cell, data))
    return int(refused is not None or (bool(data["not_identifiable"]) and not data["mismatch_only"]))


def positioning_feed(cell: Cell) -> float | None:
    """cell → mm/min of protected moves in the programs of its post; None without a post or when it has no such option."""
    from postprocessors import _base as posts

    if cell.controller is None:
        return None
    post = dialect(cell)
    with blamed_on(cell.folder / "tango.yaml"):
        feed = posts.settings(post, cell.controller.options).get("positioning_feed")
    return float(feed) if isinstance(feed, int | float) and feed > 0 else None


def _postable(cell: Cell, made: Plan) -> float | None:
    """cell, its plan → s in which its programs prove the probe alive; None without a post.

    Raises InputError for what 'tango plan' would refuse: the whole program is made and read back.
    """
    from postprocessors import _base as posts

    from ..program import programs

    if cell.controller is None:
        return None
    post, port, options = dialect(cell), cell.controller.port, cell.controller.options
    with blamed_on(cell.folder / "tango.yaml"):
        if port is not None:
            _port(port, post.link)
        which = posts.settings(post, options).get("gate", "none")
        return sum(proof(program.plan, which, positioning_feed(cell)) for program in programs(post, made, options))


def _port(port: str, link: str) -> None:
    from ..link._measure import protocol_of

    try:
        protocol_of(port, link)
    except InputError as error:
        raise InputError(f"controller.port: found {port!r}, in it {str(error).removeprefix(f'port {port!r}: ')}") from None


def check(
    cell: Cell, made: Plan, terms: tuple[TermItem, ...], degree: int, feed: float | None = None, proven: float | None = None
) -> dict[str, Any]:
    """cell, plan, terms, mm/min of protected moves, s of the proof → counts, condition, std, what is not seen, predicted time.

    All but `touches` and `with_left_out` is of the touches of the plan: these will be measured.
    """
    position = np.array([touch.contact for touch in made.touches])
    count = Counter(t.facet for t in made.touches)
    travelled = {name: [float(position[:, i].min()), float(position[:, i].max())] for i, name in enumerate(cell.machine.names)}
    found = {
        "format": "tango-check/1",
        "machine": cell.machine.name,
        "artefact": cell.artefact.name,
        "strategy": cell.strategy.name,
        "touches": len(made.touches) + len(made.left_out),
        "planned_touches": len(made.touches),
        "left_out": list(made.left_out),
        "doubtful": list(made.doubtful),
        "indexations": len({touch.indexation for touch in made.touches}),
        "facets": {facet: count[facet] for facet in cell.artefact.facets},
        "range": {n: [v if n in cell.machine.linear else float(np.degrees(v)) for v in lim] for n, lim in travelled.items()},
        **_told(cell, made, terms, degree),
        "predicted_time_s": duration(made, feed) | ({PROOF: proven} if proven else {}),
        "positioning_feed": feed,
        "drawings": drawn_sizes(cell.artefact),
    }
    if made.left_out and (whole := _whole(cell)) is not None:
        found["with_left_out"] = {"touches": len(whole.touches), **_told(cell, whole, terms, degree)}
    return found | ({} if (gain := saved(made, feed)) is None else {"double_touch_saves_s": gain})


def _whole(cell: Cell) -> Plan | None:
    """cell → the plan of all its touches, to look at and not to run; None where more than a facet that faces away is in the way."""
    try:
        return plan(cell, "warn")
    except InputError:
        return None


def _told(cell: Cell, made: Plan, terms: tuple[TermItem, ...], degree: int) -> dict[str, Any]:
    """cell, plan, terms → what its touches tell: unknowns, condition number, expected std, what is not seen."""
    position = np.array([touch.contact for touch in made.touches])
    touches = of_facets(cell.machine, cell.artefact, [t.facet for t in made.touches], position, last_motion(made))
    selection = select(touches, terms, degree)
    model = selection.model
    start = np.zeros(len(model.names))
    _, jacobian = linearise(model, start)
    _, rows, uncertainty = known(model, start)
    sigma = cell.machine.probe.repeatability or 1e-6
    weighted = np.vstack([jacobian, rows * (sigma / uncertainty)[:, None]])
    scale = np.linalg.norm(weighted, axis=0)
    root = np.linalg.qr(weighted / scale, mode="r")
    std = sigma * np.linalg.norm(np.linalg.inv(root), axis=1) / scale
    return {
        "unknowns": len(model.names),
        "dof": len(touches) + len(rows) - len(model.names),
        "condition_number": condition_number(np.vstack([jacobian, rows])),
        "scaled_condition_number": scaled_condition_number(np.vstack([jacobian, rows])),
        "expected_std": {selection.label(c.name): {"std": float(std[i]), "unit": c.unit} for i, c in enumerate(model.coefficients)},
        "not_identifiable": [c.text for c in selection.unseen],
        "mismatch_only": selection.mismatch and len(selection.unseen) == 1,
    }


def as_text(cell: Cell, data: dict[str, Any]) -> str:
    """result of `check` → what a person reads on the terminal."""
    count = data["facets"]
    touched = [facet for facet, n in count.items() if n]
    part = f"of {data['touches']} " if data["left_out"] else ""
    lines = [
        f"{cell.machine.name} ({cell.machine.topology}), {cell.artefact.name}, {cell.strategy.name}",
        f"{data['planned_touches']} {part}touches on {len(touched)} facets at {data['indexations']} indexations; "
        f"{'these' if part else 'all'} are within the travels:",
        "  " + "  ".join(f"{n} {low:.1f} … {high:.1f}" for n, (low, high) in data["range"].items()),
    ]
    lines += drawn_lines(data["drawings"])
    lines += ["'tango plan' refuses this cell:", *(f"  {line}" for line in data["refused"].splitlines())] if data["refused"] else []
    if left_out := data["left_out"]:
        lines.append(f"a straight stylus cannot make the other {len(left_out)}: left out of the program, and of what follows:")
        lines += _some(left_out)
        lines += _lost(data)
    if doubtful := data["doubtful"]:
        lines.append(
            f"{len(doubtful)} are on facets that face away from the spindle; a straight stylus would meet the table there:"
        )
        lines += _some(doubtful)
    once = [facet for facet in touched if count[facet] == 1 and cell.artefact.facets[facet].ball is None]
    if once:
        lines.append(f"touched once only, which tells nothing but their own offset: facets {', '.join(once)}")
    rows = [["expected std", "", ""]]
    for name, value in data["expected_std"].items():
        factor, unit = shown(value["unit"])
        rows.append([name, f"{value['std'] * factor:.3g}", unit])
    lines += [
        "",
        f"{data['unknowns']} unknowns, {data['dof']} degrees of freedom, condition number {data['condition_number']:.4g}, "
        f"of scaled columns {data['scaled_condition_number']:.4g}",
        "",
    ]
    lines.append(table(rows, "<><"))
    lines += [f"cannot be seen: {text}" for text in summary(data["not_identifiable"])]
    time, feed = data["predicted_time_s"], data["positioning_feed"]
    lines += ["", f"predicted time {spoken(sum(time.values()))}: " + ", ".join(f"{part} {spoken(s)}" for part, s in time.items())]
    if "double_touch_saves_s" in data:
        gain = data["double_touch_saves_s"]
        lines.append(f"touching twice {'saves' if gain >= 0 else 'costs'} {spoken(abs(gain))} against touching once")
    lines.append(
        f"with linear moves {f'at {feed:g} mm/min, the positioning_feed of the post' if feed else 'in rapid: there is no post'}"
    )
    return "\n".join(lines)


def _some(texts: list[str]) -> list[str]:
    """sentences on touches → the first of them, and how many more there are."""
    more = [f"  … and {len(texts) - NAMED} more (--json lists all)"] if len(texts) > NAMED else []
    return [f"  {text}" for text in texts[:NAMED]] + more


def _lost(data: dict[str, Any]) -> list[str]:
    """result of `check` → what the touches that are left out would tell besides, and how to have them."""
    if (whole := data.get("with_left_out")) is None:
        return []
    std, more = data["expected_std"], whole["expected_std"]
    with_them = "  with them (--obstructed warn, for a stylus that gets there)"
    if gained := [name for name in more if name not in std]:
        return [f"{with_them} {', '.join(gained)} could be seen"]
    if not more:
        return []
    name = max(more, key=lambda name: std[name]["std"] / more[name]["std"])
    if std[name]["std"] < 1.01 * more[name]["std"]:
        return [f"{with_them} almost nothing more could be determined"]
    factor, unit = shown(std[name]["unit"])
    better, here = (f"{each[name]['std'] * factor:.3g}" for each in (more, std))
    return [
        f"{with_them} the condition number is {whole['condition_number']:.4g} instead of {data['condition_number']:.4g}, "
        f"and the expected std of {name}, which gains most, {better} instead of {here} {unit}"
    ]
