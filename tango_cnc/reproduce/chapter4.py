"""Chapter 4: the HU40T, its octagonal table, and what four sets of parameters explain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..estimate import Estimate, estimate
from ..records import Array, Id, Readings, World
from ..verify.cmm import compare_artefact, compare_tips
from ..verify.held_out import indexations
from ._setting import UNTOLD_TABLE, Arrows, Row, Setting, Table, people, si

SUBSETS = ("S1", "S2", "S3", "S4")
HELD_OUT = (5, 9, 13, 16, 19)  # the thesis does not print which five of the 28 it kept back
CMM_ERROR = 0.0005  # mm, one standard deviation of a facet measured on a Legex 910 class machine


def table_4_5(setting: Setting) -> Table:
    """setting → subset S3 from the table alone and with the scale bar."""
    printed = setting.printed["table_4_5"]
    cell = setting.hu40t
    readings = setting.measured(setting.world(si(printed["scale_enriched"])))
    enriched = estimate(cell.machine, cell.artefact, readings, ("S3",))
    unbarred = replace(cell.artefact, scale_bar=None)
    balls = np.array([cell.artefact.facets[f].ball is not None for f in readings.facet])
    pure = estimate(cell.machine, unbarred, readings.rows(~balls), ("S3",))
    found = ({n: people(n.split("-")[0], p.value) for n, p in result.parameters.items()} for result in (pure, enriched))
    alone, barred = found
    names = [*printed["scale_enriched"], *(n for n in printed["pure"] if n not in printed["scale_enriched"])]
    rows = [Row(n, (printed["pure"].get(n), printed["scale_enriched"].get(n)), (alone.get(n), barred.get(n))) for n in names]
    return Table(
        "4-5",
        "Subset S3 from the table alone (pure) and with the scale bar (enriched)",
        "µm, µrad, µm/m",
        ("pure", "scale enriched"),
        tuple(rows),
        "The printed enriched values are the true machine here; the simulated readings (repeatability 0.6 µm) are estimated "
        "without and with the bar. To be seen: all parameters but the scales agree between both columns, and without the "
        "bar only EYY1-EXX1 and EZZ1-EXX1 exist, with the printed values.",
        "The thesis' machine has more errors than S3 holds, which pull its values; here the truth is known and the difference to "
        f"the printed column is the error of the estimate. {UNTOLD_TABLE}",
    )


def explained(setting: Setting, disturbed: bool) -> dict[str, Estimate]:
    """setting → the four subsets estimated from a machine with the errors of Table 4-4; kept for the tables that share it."""
    key = f"chapter 4 {disturbed}"
    if key not in setting.cache:
        cell, readings = setting.hu40t, readings_of_4_4(setting, disturbed)
        setting.cache[key] = {s: estimate(cell.machine, cell.artefact, readings, (s,)) for s in SUBSETS}
    found: dict[str, Estimate] = setting.cache[key]
    return found


def world_of_4_4(setting: Setting, disturbed: bool) -> World:
    """setting → the machine of Table 4-4, subset S4."""
    return setting.world(setting.printed["table_4_4"], disturbed)


def readings_of_4_4(setting: Setting, disturbed: bool) -> Readings:
    """setting → simulated readings of that machine; the same for all tables."""
    key = f"readings {disturbed}"
    if key not in setting.cache:
        setting.cache[key] = setting.measured(world_of_4_4(setting, disturbed))
    found: Readings = setting.cache[key]
    return found


def cmm_of_4_4(setting: Setting) -> dict[Id, Array]:
    """setting → what a CMM would say of that machine's table: the true facets, its own error, its own frame."""
    world = world_of_4_4(setting, True)
    rng = np.random.default_rng([setting.seed, 4])
    turn, shift = np.array([2e-4, -1e-4, 3e-4]), np.array([0.05, -0.02, 0.03])
    found = {}
    for facet, offset in world.facets.items():
        nominal = setting.hu40t.artefact.facets[facet]
        point = np.array(nominal.point) + (offset + rng.normal(scale=CMM_ERROR)) * np.array(nominal.normal)
        found[facet] = point + np.cross(turn, point) + shift
    return found


DISTURBANCE = (
    "The columns with disturbances add what sections 4.6 and 7.3 measured (a drift of 10 µm with a time constant of half an hour, "
    "surfaces of 0.3, 0.9 and 2.2 µm on z, axis-parallel and oblique facets, two lobes of 8 µm peak to valley) and a random walk "
    "of 2 µm; in which direction they act is not printed and drawn."
)


def table_4_6(setting: Setting) -> Table:
    """setting → unexplained distance of the four subsets (and the arrows of Figure 4-7)."""
    quiet, real = explained(setting, False), explained(setting, True)
    other = setting.printed["independent_of_table_4_6"]
    rows = []
    for s in SUBSETS:
        printed = setting.printed["table_4_6"][s]
        both = [abs(result[s].residuals) * 1e3 for result in (quiet, real)]
        values = [f(size) for size in both for f in (np.max, np.mean)]
        theirs = [other[how].get(s, {}).get(what) for how in ("without", "with") for what in ("max", "mean")]
        rows.append(Row(s, (printed["max"], printed["mean"]) * 2, tuple(float(v) for v in values), tuple(theirs)))
    return Table(
        "4-6",
        "Unexplained volumetric error norms |r|",
        "µm",
        ("max, 0.6 µm noise", "mean, 0.6 µm noise", "max, with disturbances", "mean, with disturbances"),
        tuple(rows),
        "The estimates of Table 4-4, subset S4, are the true machine; simulated readings of Table 4-2 are explained by the "
        "four subsets. The column 'other' is what a program independent of this one found in the same way.",
        f"With repeatability alone S4 explains everything; the real machine leaves four times more. {DISTURBANCE} What that leaves "
        f"open: tango reproduce 4-6 --diagnose. {UNTOLD_TABLE}",
        Arrows("4-7", {f"subset {s}": _arrows(setting, real[s].model.touches.facet, real[s].residuals, True) for s in SUBSETS}),
    )


def _arrows(setting: Setting, facets: tuple[Id, ...], residual: Array, one_a_touch: bool) -> tuple[Array, Array, Array, Array]:
    known = setting.hu40t.artefact.facets
    keep = np.array([known[f].ball is None for f in facets])
    point, normal = (np.array([getattr(known[f], what) for f in facets])[keep] for what in ("point", "normal"))
    if one_a_touch:
        group = explained(setting, True)["S3"].model.touches.indexation[: len(facets)][keep]
    else:
        group = np.arange(len(facets))[keep]
    return point, normal, residual[keep], group


def table_4_7(setting: Setting) -> Table:
    """setting → the estimated table against a CMM (and the arrows of Figure 4-8)."""
    measured = cmm_of_4_4(setting)
    rows, panels = [], {}
    for s, result in explained(setting, True).items():
        found = compare_artefact(result, measured)
        f, printed = found.figures, setting.printed["table_4_7"][s]
        names = ("max", "mean", "sd", "range")
        rows.append(Row(s, tuple(printed[n] for n in names), tuple(getattr(f, n) * 1e3 for n in names)))
        panels[f"subset {s}"] = _arrows(setting, found.facet, found.residual, False)
    return Table(
        "4-7",
        "Estimated table against a CMM, after the best rigid fit",
        "µm",
        ("max", "mean", "sd", "range"),
        tuple(rows),
        "Facet offsets estimated from the disturbed readings of Table 4-6 against the true ones as a CMM of 0.5 µm would see them.",
        "The thesis finds 3.7 µm whatever the subset; this simulation does not. Here S3 and S4 come as close as drift and "
        "surface allow, while S1 and S2 push machine errors into the facet offsets. What else lay between CMM and touches "
        f"on the real table (other spots of the surface, temperature) is not printed. {UNTOLD_TABLE}",
        Arrows("4-8", panels),
    )


def table_4_8(setting: Setting) -> Table:
    """setting → tip positions predicted from all touches against a CMM (and the arrows of Figure 4-9)."""
    measured, readings = cmm_of_4_4(setting), readings_of_4_4(setting, True)
    rows, panels = [], {}
    for s, result in explained(setting, True).items():
        found = compare_tips(result, readings, measured)
        printed = setting.printed["table_4_8"][s] | {"mean": setting.printed["more_of_table_4_8"]["mean"][s]}
        rows.append(_prediction(s, printed, found.residual))
        panels[f"subset {s}"] = _arrows(setting, found.facet, found.residual, False)
    return Table(
        "4-8",
        "Predicted tip positions against a CMM, all touches in the estimate",
        "µm",
        ("max", "min", "mean", "sd"),
        tuple(rows),
        "The tip positions of all touches in the table frame, by the estimated machine and stylus, against the facets as "
        "measured by the CMM; one rigid best fit.",
        f"{DISTURBANCE} The thesis' residuals also hold the difference between CMM and touched surface (its Table 4-7: 3.7 µm).",
        Arrows("4-9", panels),
    )


def _prediction(name: str, printed: Mapping[str, float], residual: Array) -> Row:
    ours = tuple(float(v) * 1e3 for v in (residual.max(), residual.min(), residual.mean(), residual.std(ddof=1)))
    return Row(name, tuple(printed[n] for n in ("max", "min", "mean", "sd")), ours)


def table_4_9(setting: Setting) -> Table:
    """setting → tip positions at five indexations that took no part, against a CMM (and the arrows of Figure 4-10)."""
    cell, measured, readings = setting.hu40t, cmm_of_4_4(setting), readings_of_4_4(setting, True)
    out = np.isin(indexations(readings, cell.machine), HELD_OUT)
    rows, panels = [], {}
    for s in SUBSETS:
        result = estimate(cell.machine, cell.artefact, readings.rows(~out), (s,))
        found = compare_tips(result, readings, measured, out)
        printed = setting.printed["table_4_9"][s] | {"mean": setting.printed["more_of_table_4_9"]["mean"][s]}
        rows.append(_prediction(s, printed, found.residual))
        panels[f"subset {s}"] = _arrows(setting, found.facet, found.residual, False)
    return Table(
        "4-9",
        "Predicted tip positions at five held-out indexations against a CMM",
        "µm",
        ("max", "min", "mean", "sd"),
        tuple(rows),
        f"23 indexations estimate, five are predicted and compared with the CMM ({len(found.residual)} touches).",
        f"Which five the thesis kept back is not printed; here numbers {', '.join(map(str, HELD_OUT))} of Table 4-2. {DISTURBANCE}",
        Arrows("4-10", panels),
    )
