"""`tango predict`: predict the errors of a part before it is cut."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from ..acceptance.further import decided
from ..files import read_cell, read_readings, read_terms
from ..files.origin import current
from ..judging import judged, made_up
from ..nc import features, predict
from ..records import InputError, TangoError
from ..report import pictures
from ..verify.apart import apart
from . import _possible, _program, _scales, _test
from ._common import Output, ahead, cell_option, json_option, table, write_json
from ._handed import printed
from ._larger import larger
from ._trust import despite_option, usable

SIMULATED = "PREDICTED FROM SIMULATED READINGS: it says nothing of a machine"
WITHHELD = "what would decide more: tango iso230; --fitted shows the fitted terms alone, as if there were no other error motion"
PLACE = "Act 20"  # in the list of commands


@click.command()
@click.argument("source", type=click.Path(path_type=Path, exists=True, dir_okay=False), metavar="[PROGRAM]", required=False)
@cell_option
@click.option("--readings", "file", type=click.Path(path_type=Path), metavar="FILE", help="Readings [default: those of the cell].")
@click.option("--terms", help="Instead of the cell's: S1 … S4 or a list, e.g. S3,EYX2.")
@click.option("--degree", type=click.IntRange(1, 6), default=3, show_default=True, help="Highest degree of the polynomials of S4.")
@_program.setup_options()
@click.option(
    "--features", "checks", type=click.Path(path_type=Path), metavar="FILE", help="Features of the part (docs/compensate.md)."
)
@click.option("--fitted", is_flag=True, help="By the fitted terms alone, as if the machine had no other error motion.")
@click.option("--limit-um", type=click.FloatRange(0, min_open=True), metavar="L", help="Exit 1 where the tip is further away.")
@_test.test_options
@despite_option
@click.option(
    "--picture", type=Output(), metavar="FILE", help="Draw the path and its deviation (.png .svg .pdf; needs matplotlib)."
)
@json_option
def command(**options: Any) -> int:
    """Predicts the deviation of the tool tip along an NC program, and what it means for features of the part.

    With --test NAME in place of a program it predicts what a ball bar, an R-test or a laser shows, and compares --measured.
    Exit status 1 where a measured figure or the readings differ.

    Only errors that were estimated are known. Points where an axis is beyond what was touched are counted and marked.
    """
    _one_of_two(options)
    if options["picture"] is not None:
        pictures.needed()
    cell = read_cell(options["folder"])
    origin = current(cell.folder, options["file"])
    readings = read_readings(origin, cell.machine, cell.artefact)
    terms = cell.terms if options["terms"] is None else read_terms(options["terms"], cell.folder)
    result, judgement = judged(cell, readings, terms, options["degree"], source=origin)
    try:
        usable(judgement, options["despite"], "predict")
    except TangoError as error:
        more_terms = larger(cell, readings, terms, options["degree"], origin, judgement)
        raise TangoError("\n".join(filter(None, [str(error), more_terms]))) from None
    _program.foretold(result, judgement, despite=options["despite"])
    simulated = made_up(origin)
    first = [*([SIMULATED] if simulated else []), *filter(None, [apart(result)])]
    if options["test"] is not None:
        shown, text, differs = _test.predicted(cell.folder, result, options)
        if not write_json(options["json_file"], {"simulated": True, **shown} if simulated else shown):
            printed("\n".join([*first, text]))
        return differs
    setup = _program.setup_of(cell, options)
    known = _program.found_of(result, "predict", "it predicts nothing of the tool tip")
    source: Path = options["source"]
    language = _program.language_of(source, cell, options["language"])
    touched = predict.touched_of(result.model.touches)
    wanted = features.read(options["checks"]) if options["checks"] is not None else None
    with _program.blamed(source, language, options["language"]), _program.opened(source) as lines:
        way, labels = predict.along(lines, language, setup, known, touched, _program.mark_of(known, setup))
    if not way.points:
        raise TangoError(f"{source}: found no motion at feed, so there is nothing to predict")
    tool = None if wanted is None else wanted.tool
    of = "asked for" if options["fitted"] else _possible.machines(cell.folder, result, tool)
    found: list[tuple[features.Predicted, str, tuple[str, ...]]]
    if isinstance(of, str):
        found = [(f, "", ()) for f in features.predict(wanted, setup, known, labels, touched)] if wanted is not None else []
        more: dict[str, Any] = {"fitted_alone": of}
    else:
        found = decided(wanted, setup, of.known, of.left, labels, touched) if wanted is not None else []
        more = {"fitted_alone": None, "aligned": _possible.aligned(way, setup, of, tool)}
    stated = None
    if tool is not None:
        stated = {"length_um": tool.length * 1e3, "eccentricity_um": tool.eccentricity * 1e3, "text": features.stated(tool)}
    data = _data(source, way, found) | more | {"tool": stated, "scales": _scales.said(cell.folder, result)}
    if options["picture"] is not None:
        _draw(options["picture"], way)
    if not write_json(options["json_file"], {"simulated": True, **data} if simulated else data):
        printed("\n".join([*first, _text(data)]))
        if data["scales"]:
            printed(data["scales"])
        if options["file"] is None:
            ahead(cell.folder, "compensate --list", "report")
    limit = options["limit_um"]
    return 1 if limit is not None and way.largest > limit else 0


ONLY_PROGRAM = ("zero", "language", "tools", "metric_absolute", "checks", "fitted", "limit_um", "picture")
ONLY_TEST = ("radius", "at", "measured", "instrument_um")


def _one_of_two(options: dict[str, Any]) -> None:
    """Raises InputError unless there is a program or a test, with the options of that one."""
    if (options["source"] is None) == (options["test"] is None):
        found = "neither" if options["test"] is None else "both"
        raise InputError(f"predict: found {found}; allowed: an NC program, or --test NAME, e.g. --test circle-XY")
    for name in ONLY_PROGRAM if options["test"] is not None else ONLY_TEST:
        if options[name]:
            option = {"tools": "tool", "checks": "features"}.get(name, name).replace("_", "-")
            allowed = "without --test" if options["test"] is not None else "with --test NAME"
            raise InputError(f"predict: found --{option}; allowed: {allowed}")


def _data(source: Path, way: predict.Way, found: list[tuple[features.Predicted, str, tuple[str, ...]]]) -> dict[str, Any]:
    rms = float(np.sqrt(way.squares / way.points))
    share = {name: float(np.sqrt(value / way.points)) for name, value in way.by_name.items()}
    causes = sorted(share.items(), key=lambda item: -item[1])
    return {
        "format": "tango-prediction/1",
        "program": str(source),
        "blocks": way.blocks,
        "points": way.points,
        "extrapolated": way.outside,
        "extrapolated_axes": way.outside_by,
        **_program.unstated(way),
        "largest_um": round(way.largest, 4),
        "largest_std_um": round(way.largest_std, 4),
        "largest_line": way.largest_line,
        "rms_um": round(rms, 4),
        "direction_largest_urad": round(way.direction, 4),
        "direction_rms_urad": round(float(np.sqrt(way.squares_direction / way.points)), 4),
        "causes": [{"name": name, "rms_um": round(value, 4)} for name, value in causes if value > 1e-4],
        "features": [
            {
                "name": f.name,
                "kind": f.kind,
                "value_um": None if why else round(f.value, 4) + 0.0,
                "low_um": None if why else round(f.low, 4) + 0.0,
                "high_um": None if why else round(f.high, 4) + 0.0,
                "extrapolated": f.extrapolated,
                "why": why,
                "mixed": list(mixed),
            }
            | ({} if why or f.alone is None else {"without_scatter_um": round(f.alone, 4)})
            for f, why, mixed in found
        ],
    }


def _there(data: dict[str, Any]) -> str:
    """plain data → how sure the largest deviation is."""
    if data["fitted_alone"] is not None:
        scatter = f"the scatter of the touches leaves ± {1.96 * data['largest_std_um']:.1f} µm of it (95 %)"
        why = "" if data["fitted_alone"] == "asked for" else f": {data['fitted_alone']}"
        return f"{scatter}; intervals are of the fitted terms alone, as if the machine had no other error motion{why}"
    best, said = data["aligned"], "of the part as it lies best, with every error motion that the machine may have"
    if best["why"]:
        return f"{said}: withheld, {best['why']}"
    return f"{said}: largest {best['largest_um']:.1f} µm, at most {best['at_most_um']:.1f} µm (95 %)"


def _possible_causes(data: dict[str, Any]) -> list[str]:
    """plain data → lines: which errors of the machine move the part as it lies best; none where nothing is known of them."""
    best = data.get("aligned") or {}

    def told(c: dict[str, Any]) -> str:
        return f"{c['rms_um']:.1f} µm ({c['low_um']:.1f} to {c['high_um']:.1f})"

    parts = [(c["rms_um"], f"{c['name']} {told(c)}") for c in best.get("causes", [])[:6]]
    if best.get("mixed"):
        names = best["mixed"]["names"]
        some = ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
        parts.append(
            (best["mixed"]["rms_um"], f"{some}, which the touches do not tell from each other, together {told(best['mixed'])}")
        )
    said = "; ".join(text for _, text in sorted(parts, key=lambda part: -part[0]))
    head = "what makes it so, of the part as it lies best, with every error motion (rms along the program, 95 %)"
    return [f"{head}: {said}"] if said else []


def _signed(value: float) -> str:
    """µm → with its sign, to 0.1 µm; nothing has no sign to lose."""
    return f"{round(value, 1) + 0.0:+.1f}"


def _text(data: dict[str, Any]) -> str:
    lines = [
        f"{data['blocks']} blocks, {data['points']} points",
        f"tip against where the program means it, at feed, by the fitted terms: largest {data['largest_um']:.1f} µm "
        f"(line {data['largest_line']}), rms {data['rms_um']:.1f} µm",
        _there(data),
        f"direction of the tool: largest {data['direction_largest_urad']:.1f} µrad, rms {data['direction_rms_urad']:.1f} µrad",
        "what makes it so, by the fitted terms (rms along the program): "
        + ", ".join(f"{c['name']} {c['rms_um']:.1f} µm" for c in data["causes"][:6]),
        *_possible_causes(data),
    ]
    if data["extrapolated"]:
        share = 100 * data["extrapolated"] / data["points"]
        axes = ", ".join(f"{axis} at {100 * n / data['points']:.0f} %" for axis, n in data["extrapolated_axes"].items())
        lines.append(
            f"extrapolated: at {share:.0f} % of the points an axis is beyond the touches ({axes}): "
            "the machine was not measured there"
        )
    lines += _program.unstated_lines(data, "deviations")
    if data["features"]:
        rows = [["feature", "µm", "95 %", ""]]
        for f in data["features"]:
            if f["why"]:
                rows.append([f["name"], "withheld", "", f["why"]])
                continue
            alone = f.get("without_scatter_um")
            scatter = "" if alone is None else f"with the scatter of its points; {alone:.1f} without"
            note = ", ".join(word for word in ("extrapolated" if f["extrapolated"] else "", scatter) if word)
            rows.append([f["name"], _signed(f["value_um"]), f"{_signed(f['low_um'])} to {_signed(f['high_um'])}", note])
        lines += ["", table(rows, "<><<")]
        if data["tool"] is not None:
            lines.append(data["tool"]["text"])
        if any(f["why"] for f in data["features"]):
            lines.append(WITHHELD)
    return "\n".join(lines)


def _draw(file: Path, way: predict.Way) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    at, off = np.array(way.position), np.array(way.deviation)
    outside = np.array(way.extrapolated)
    size = np.linalg.norm(off, axis=1)
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(13, 5.5), constrained_layout=True)
    span = float(np.ptp(at[:, :2], axis=0).max()) or 1.0
    scale = 0.08 * span / max(float(size.max()), 1e-9)
    left.plot(at[:, 0], at[:, 1], ".", color="0.8", markersize=2)
    colours = left.quiver(
        at[:, 0],
        at[:, 1],
        off[:, 0] * scale,
        off[:, 1] * scale,
        size,
        angles="xy",
        scale_units="xy",
        scale=1,
        cmap="viridis",
        width=0.002,
    )
    tips = at[:, :2] + off[:, :2] * scale
    left.plot(tips[:, 0], tips[:, 1], alpha=0)  # the ends of the arrows belong into the picture, too
    if outside.any():
        left.plot(at[outside, 0], at[outside, 1], "|", color="crimson", markersize=5, label="extrapolated")
        left.legend()
    figure.colorbar(colours, ax=left, label="deviation of the tip, µm")
    left.set(xlabel="x, mm", ylabel="y, mm", title=f"seen from above; arrows {1e3 * scale:.0f} times as long", aspect="equal")
    lines = np.array(way.line)
    for i, name in enumerate("xyz"):
        right.plot(lines, off[:, i], ".-", markersize=2, linewidth=0.6, label=name)
    if outside.any():
        right.plot(lines[outside], np.zeros(int(outside.sum())), "|", color="crimson", label="extrapolated")
    right.axhline(0, color="0.6", linewidth=0.5)
    right.set(xlabel="line of the program", ylabel="µm, table frame", title="deviation along the program")
    right.legend()
    figure.savefig(file, dpi=120)
    pyplot.close(figure)
