"""`tango check`: check the cell before it runs: reach, collisions, what the touches determine, time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click
import numpy as np

from ..duration import PROOF, duration, proof, saved, spoken
from ..estimate import student
from ..features import bar_left_out
from ..files import blamed_on, drawn_lines, drawn_sizes, read_cell, read_terms, write_text
from ..files.normals import refuse_inward
from ..identify import condition_number, scaled_condition_number, select, summary
from ..iso230.signed import decided
from ..model import known, linearise
from ..plan import by_stylus, last_motion, plan
from ..records import Cell, InputError, Plan, TermItem
from ..report.units import shown
from ..touches import Touches, of_facets
from ._common import Output, ahead, cell_option, dialect, json_option, table, write_json, writing
from ._handed import printed
from ._plan import obstructed_option
from ._stylus import by_length, lengths_said, with_second

PLACE = "Begin 30"  # in the list of commands

NAMED = 8  # touches that are named one by one
NAMED_FIGURES = 12


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
    """Checks the files of the cell, plans the touches, and lists which parameters they determine.

    Nothing is written and nothing moves. The program is made and read back as 'tango plan' does it, so what 'tango plan'
    rejects is rejected here. Exit status 1 when the touches do not determine a parameter of the terms, or when touches of the
    strategy are rejected; the result is then without these touches.
    """
    if picture is not None and picture.suffix.lower() != ".svg":
        raise InputError(f"--picture: found {picture}; allowed: a file that ends in .svg")
    cell = read_cell(folder)
    refuse_inward(cell)
    if picture is not None:
        from ..report.machine_svg import drawing

        write_text(picture, drawing(cell.machine, cell.artefact))
        click.echo(f"the machine as machine.yaml and artefact.yaml have it → {picture}", err=True)
    refused, plans, proofs = None, [], []
    for part in by_stylus(cell):
        try:
            made = plan(part, obstructed)
        except InputError as error:
            # Whatever is beyond leaving out is still an error, and says so.
            made, refused = plan(part, "leave-out"), str(error)
        plans.append(made)
        proofs.append(_postable(part, made))
    proven = None if None in proofs else sum(s for s in proofs if s is not None)
    with blamed_on(folder / "tango.yaml") if terms is None else nullcontext():
        asked = cell.terms if terms is None else read_terms(terms, cell.folder)
        data = check(cell, plans[0], asked, degree, positioning_feed(cell), proven, plans[1:])
    data["refused"] = refused
    if not write_json(json_file, data):
        printed(as_text(cell, data))
        if refused is None:
            ahead(folder, "plan" if cell.controller is not None else "simulate")
    return int(refused is not None or (bool(data["not_identifiable"]) and not data["mismatch_only"]))


def positioning_feed(cell: Cell) -> float | None:
    """cell → mm/min of protected moves in the programs of its post; None without a post or when it has no such option."""
    import postprocessors as posts

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
    import postprocessors as posts

    from ..program import programs

    if cell.controller is None:
        return None
    post, port, options = writing(cell), cell.controller.port, cell.controller.options
    with blamed_on(cell.folder / "tango.yaml"):
        if port is not None:
            _port(port, post.link, made)
        which = posts.settings(post, options).get("gate", "none")
        return sum(proof(program.plan, which, positioning_feed(cell)) for program in programs(post, made, options))


def _port(port: str, link: str, made: Plan) -> None:
    from ..link.measure import fitting

    try:
        fitting(port, link, made)  # else 'tango run' would be the first to refuse it
    except InputError as error:
        raise InputError(f"controller.port: found {port!r}, in it {str(error).removeprefix(f'port {port!r}: ')}") from None


def check(
    cell: Cell,
    made: Plan,
    terms: tuple[TermItem, ...],
    degree: int,
    feed: float | None = None,
    proven: float | None = None,
    others: Sequence[Plan] = (),
) -> dict[str, Any]:
    """cell, plan, terms, mm/min of protected moves, s of the proof, plans of other styli → counts, condition, std, what is not
    seen, predicted time.

    All but `touches` and `with_left_out` is of the touches of the plans: these will be measured.
    """
    plans = (made, *others)
    position = np.array([touch.contact for one in plans for touch in one.touches])
    count = Counter(t.facet for one in plans for t in one.touches)
    travelled = {name: [float(position[:, i].min()), float(position[:, i].max())] for i, name in enumerate(cell.machine.names)}
    found = {
        "format": "tango-check/1",
        "machine": cell.machine.name,
        "artefact": cell.artefact.name,
        "strategy": cell.strategy.name,
        "touches": sum(len(one.touches) + len(one.left_out) for one in plans),
        "planned_touches": sum(len(one.touches) for one in plans),
        "left_out": [text for one in plans for text in one.left_out.values()],
        "doubtful": [text for one in plans for text in one.doubtful],
        "start": list(dict.fromkeys(text for one in plans for text in one.start)),
        "indexations": sum(len({touch.indexation for touch in one.touches}) for one in plans),
        "facets": {facet: count[facet] for facet in cell.artefact.facets},
        "range": {n: [v if n in cell.machine.linear else float(np.degrees(v)) for v in lim] for n, lim in travelled.items()},
        **_told(cell, plans, terms, degree),
        "predicted_time_s": _time(plans, feed) | ({PROOF: proven} if proven else {}),
        "positioning_feed": feed,
        "drawings": drawn_sizes(cell.machine, cell.artefact),
    }
    if others:
        found["styli"] = [
            {"stylus": one.machine.stylus, "length_mm": one.machine.probe.length, "touches": len(one.touches)} for one in plans
        ]
        found["one_stylus"] = _told(cell, [made], terms, degree)
        found["by_length"] = by_length(_touches(cell, plans), terms, degree)
    elif made.left_out and (whole := _whole(cell)) is not None:
        found["with_left_out"] = {"touches": len(whole.touches), **_told(cell, [whole], terms, degree)}
    if not others and made.touches and found["not_identifiable_figures"]:
        length, together, lengths = with_second(made, terms, degree)
        more = [name for name in together if name not in found["figures"]]
        found["second_stylus"] = {"length_mm": length, "more": more, "by_length": lengths}
    return found | ({} if (gain := saved(made, feed)) is None else {"double_touch_saves_s": gain})


def _time(plans: Sequence[Plan], feed: float | None) -> dict[str, float]:
    total: Counter[str] = Counter()
    for one in plans:
        total.update(duration(one, feed))
    return dict(total)


def _whole(cell: Cell) -> Plan | None:
    """cell → the plan of all its touches, to look at and not to run; None where more than a facet that faces away is in the way."""
    try:
        return plan(cell, "warn")
    except InputError:
        return None


def _touches(cell: Cell, plans: Sequence[Plan]) -> Touches:
    """cell, a plan for each stylus → their touches, which nobody has made yet."""
    position = np.array([touch.contact for made in plans for touch in made.touches])
    facets = [touch.facet for made in plans for touch in made.touches]
    moved = np.concatenate([last_motion(made) for made in plans])
    stylus = np.array([made.machine.stylus for made in plans for _ in made.touches]) if cell.machine.styli else None
    return of_facets(cell.machine, cell.artefact, facets, position, moved, stylus)


def _told(cell: Cell, plans: Sequence[Plan], terms: tuple[TermItem, ...], degree: int) -> dict[str, Any]:
    """cell, a plan for each stylus, terms → what their touches tell: unknowns, condition number, expected std, what is not seen."""
    touches = _touches(cell, plans)
    facets = touches.facet
    selection = select(touches, terms, degree)
    given, withheld = decided(selection)
    model = selection.model
    start = np.zeros(len(model.names))
    _, jacobian = linearise(model, start)
    _, rows, uncertainty = known(model, start)
    sigma = cell.machine.probe.repeatability or 1e-6
    weighted = np.vstack([jacobian, rows * (sigma / uncertainty)[:, None]])
    scale = np.linalg.norm(weighted, axis=0)
    root = np.linalg.qr(weighted / scale, mode="r")
    dof = len(touches) + len(rows) - len(model.names)
    std = student(dof) * sigma * np.linalg.norm(np.linalg.inv(root), axis=1) / scale
    return {
        "unknowns": len(model.names),
        "scale_bar_not_used": bar_left_out(cell.artefact, facets),
        "dof": dof,
        "condition_number": condition_number(np.vstack([jacobian, rows])),
        "scaled_condition_number": scaled_condition_number(np.vstack([jacobian, rows])),
        "expected_std": {selection.label(c.name): {"std": float(std[i]), "unit": c.unit} for i, c in enumerate(model.coefficients)},
        "not_identifiable": [c.text for c in selection.unseen],
        "figures": list(given),
        "not_identifiable_figures": list(withheld),
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
    refused = (data["refused"] or "").splitlines()
    lines += ["what 'tango plan' refuses of this cell:", *(f"  {line}" for line in refused)] if refused else []
    if left_out := data["left_out"]:
        lines.append(f"a straight stylus cannot make the other {len(left_out)}: left out of the program, and of what follows:")
        lines += _some(left_out)
        lines += _lost(data)
    lines += data["start"]
    if doubtful := data["doubtful"]:
        lines.append(
            f"{len(doubtful)} are on facets that face away from the spindle; a straight stylus would meet the table there:"
        )
        lines += _some(doubtful)
    once = [facet for facet in touched if count[facet] == 1 and cell.artefact.facets[facet].ball is None]
    if once:
        lines.append(f"touched once only, which determines nothing but their own offset: facets {', '.join(once)}")
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
    lines += [data["scale_bar_not_used"]] if data["scale_bar_not_used"] else []
    lines += [f"cannot be seen: {text}" for text in summary(data["not_identifiable"])]
    lines += _figures(data)
    time, feed = data["predicted_time_s"], data["positioning_feed"]
    lines += ["", f"predicted time {spoken(sum(time.values()))}: " + ", ".join(f"{part} {spoken(s)}" for part, s in time.items())]
    if "double_touch_saves_s" in data:
        gain = data["double_touch_saves_s"]
        lines.append(f"touching twice {'saves' if gain >= 0 else 'costs'} {spoken(abs(gain))} against touching once")
    lines.append(
        f"with linear moves {f'at {feed:g} mm/min, the positioning_feed of the post' if feed else 'in rapid: there is no post'}"
    )
    return "\n".join(lines)


def _figures(data: dict[str, Any]) -> list[str]:
    """result of `check` → how many ISO figures the touches will decide, and what other styli add."""
    given, withheld = data["figures"], data["not_identifiable_figures"]
    lines = ["", f"ISO figures: these touches decide {len(given)} of {len(given) + len(withheld)} ('tango iso230')"]
    if withheld:
        lines.append(f"  not determined, however well the touches repeat: {_first(withheld)}")
    if (one := data.get("one_stylus")) is None:
        if second := data.get("second_stylus"):
            again = f"the same touches again with a second stylus of {second['length_mm']:g} mm (machine.yaml: styli)"
            by_touches = [name for name in second["more"] if name not in second["by_length"]["adds"]]
            gain = f"{_first(by_touches) or 'nothing'} by their number; {lengths_said(second['by_length'], _first)}"
            lines.append(f"  {again} would add {gain if second['more'] else 'nothing; first add touches in other places'}")
        return lines
    for stylus in data["styli"]:
        lines.append(f"  stylus {stylus['stylus']}, {stylus['length_mm']:g} mm: {stylus['touches']} touches")
    by = data["by_length"]
    more = [name for name in given if name not in one["figures"] and name not in by["adds"]]
    lines.append(
        f"  with stylus {data['styli'][0]['stylus']} alone: {len(one['figures'])}; by their number the other touches add "
        f"{_first(more) or 'none'}"
    )
    return [*lines, f"  {lengths_said(by, _first)}"]


def _first(names: Sequence[str]) -> str:
    return ", ".join(names[:NAMED_FIGURES]) + (f" and {len(names) - NAMED_FIGURES} more" if len(names) > NAMED_FIGURES else "")


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
