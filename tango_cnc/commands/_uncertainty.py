"""`analysis.Analysis` and `process.Comparison` → JSON and what a person reads on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import conformity
from ..records import Array, Machine
from ..report.characters import bar, width
from ..report.units import shown
from ..terms import find
from ..uncertainty import process
from ..uncertainty.analysis import Analysis
from ._common import table

NARROWEST, WIDEST = 15, 31  # characters of a bar


def units(machine: Machine, names: Sequence[str]) -> list[str]:
    """machine, names of coefficients → their units."""
    return [find(name.split("-")[0], machine)[0].unit for name in names]


def _budget(found: Analysis) -> list[str]:
    return [part.label for part in found.study.parts]


def as_json(found: Analysis, decisions: Sequence[conformity.ConformityDecision], factor: float | None) -> dict[str, Any]:
    """analysis, decisions, coverage factor or None → plain data of the format tango-uncertainty/1."""
    study = found.study
    coefficients = study.model.coefficients
    check = found.validation
    labels = [found.selection.label(name) for name in study.names]
    own = set(study.machine.tolist())

    def row(i: int) -> dict[str, Any]:
        data: dict[str, Any] = {
            "value": float(found.values[i]),
            "unit": coefficients[i].unit,
            "std": float(found.std[i]),
            "interval": [float(found.low[i]), float(found.high[i])],
            "shortest_interval": [float(found.shortest[0][i]), float(found.shortest[1][i])],
            "dof": float(study.dof[i]) if np.isfinite(study.dof[i]) else None,
            "std_by": {key: float(value[i]) for key, value in found.std_by.items()},
            "contributions": {label: float(np.sqrt(study.shares[k, i])) for k, label in enumerate(_budget(found))},
            "monte_carlo": {
                "std_ratio": float(check.std_ratio[i]),
                "tolerance": float(check.tolerance[i]),
                "d_low": float(check.low[i]),
                "d_high": float(check.high[i]),
                "gum_validated": bool(check.agrees[i]),
            },
        }
        if found.std_of_mean is not None:
            data["std_of_mean"] = float(found.std_of_mean[i])
        if found.four is not None:
            data["repetitions"] = {"mean": float(found.four.mean[i])} | {
                key.replace(" ", "_"): {"std": float(s.std[i]), "dof": float(s.dof[i]), "half_width": float(s.half[i])}
                for key, s in (("of the mean", found.four.of_mean), *((n, found.four.of(n)) for n in ("one run", "prediction")))
            }
        if factor is not None:
            data["expanded"] = float(factor * found.std[i])
        return data

    data = {
        "format": "tango-uncertainty/1",
        "pool": found.pool,
        "probability": found.probability,
        "touches": study.count,
        "terms": [labels[i] for i in study.machine],
        "parameters": {labels[i]: row(i) for i in study.machine},
        "stylus": {labels[i]: row(i) for i in study.outputs if i not in own},
        "correlation": {"names": labels, "matrix": np.round(study.correlation, 6).tolist()},
        "joint": {"outputs": len(own), **found.joint},
        "monte_carlo": {
            "trials": found.run.count,
            "lost": found.run.lost,
            "full_iterations": found.run.rescued,
            "adaptive_blocks": found.blocks,
            "stable": found.stable,
            "digits": found.digits,
            "chord_error_largest": found.accuracy.largest,
            "chord_error_rms": found.accuracy.rms,
            "chord_std_error": found.accuracy.std_ratio,
        },
        "not_identifiable": [c.text for c in found.selection.unseen],
    }
    if found.repeated is not None:
        data["days_and_cycles"] = _days_json(found, labels)
    if decisions:
        data["conformity"] = conformity.as_json(decisions)
    return data


def _days(found: Analysis) -> process.DayAndCycle:
    assert found.repeated is not None
    own = found.study.machine
    labels = [found.selection.label(found.study.names[i]) for i in own]
    return process.day_and_cycle(labels, found.repeated.values[:, :, own])


def _days_json(found: Analysis, labels: list[str]) -> dict[str, Any]:
    d = _days(found)
    several = found.repeated
    assert several is not None
    return {
        "days": list(several.days),
        "cycles": list(several.cycles),
        "touches_left_out": several.left_out,
        "parameters": {
            name: {
                "mean": float(d.mean[i]),
                "range_of_day_means": float(np.ptp(d.day_means[:, i])),
                "range_of_cycle_means": float(np.ptp(d.cycle_means[:, i])),
                "std_within": float(d.std_within[i]),
                "p_days": None if d.p_days is None else float(d.p_days[i]),
                "p_cycles": None if d.p_cycles is None else float(d.p_cycles[i]),
                "days_differ": bool(d.days_differ[i]),
                "cycles_differ": bool(d.cycles_differ[i]),
            }
            for i, name in enumerate(d.names)
        },
    }


def as_text(found: Analysis, decisions: Sequence[conformity.ConformityDecision], factor: float | None) -> str:
    """analysis, decisions, coverage factor or None → what a person reads on the terminal."""
    blocks = [_values(found, factor), _joint(found), _contributions(found), _strong(found), _monte_carlo(found)]
    if found.repeated is not None:
        blocks += [_four(found), _days_text(found)]
    if decisions:
        blocks.append(_decisions(found, decisions))
    blocks += [f"cannot be seen: {c.text}" for c in found.selection.unseen]
    return "\n\n".join(block for block in blocks if block)


def _values(found: Analysis, factor: float | None) -> str:
    study, percent = found.study, f"{found.probability * 100:g} %"
    kinds = list(found.std_by) if found.pool != "none" else []
    head = ["parameter", "value", "u", f"{percent} from", "to"]
    head += [f"k={factor:g}"] if factor is not None else []
    head += [f"u by {kind}" for kind in kinds] + (["u of mean"] if found.std_of_mean is not None else [])
    rows = [[*head, ""]]
    for i in study.outputs:
        scale, unit = shown(study.model.coefficients[i].unit)
        numbers = [found.values[i], found.std[i], found.low[i], found.high[i]]
        numbers += [factor * found.std[i]] if factor is not None else []
        numbers += [found.std_by[kind][i] for kind in kinds]
        numbers += [found.std_of_mean[i]] if found.std_of_mean is not None else []
        rows.append([found.selection.label(study.names[i]), *(f"{scale * x:.2f}" for x in numbers), unit])
    _bars(rows, found)
    source = {
        "none": "budget of a single run",
        "cycles": "one run; covariance of the readings pooled by cycles (the measurement process)",
        "days": "one run; covariance of the readings pooled by days (the process and what the machine does through a day)",
    }[found.pool]
    return f"Standard uncertainties u of: {source}\n" + table(rows, "<" + ">" * (len(rows[0]) - 2) + "<")


def _four(found: Analysis) -> str:
    four = found.four
    if four is None:
        return ""
    rows = [["parameter", "mean", "± of the mean", "dof", "± one run", "± prediction", ""]]
    for i in found.study.machine:
        scale, unit = shown(found.study.model.coefficients[i].unit)
        halves = [f"{scale * s.half[i]:.2f}" for s in (four.of_mean, four.one_run, four.prediction)]
        label = found.selection.label(found.study.names[i])
        rows.append([label, f"{scale * four.mean[i]:.2f}", halves[0], f"{four.of_mean.dof[i]:.1f}", *halves[1:], unit])
    return (
        f"{found.probability * 100:g} % by Student, from {four.text}. Of the mean and of one run: how far from the machine in the "
        "long run; prediction: how far the next run from the mean\n" + table(rows, "<>>>>><")
    )


def _bars(rows: list[list[str]], found: Analysis) -> None:
    """rows of the table, analysis → each with a bar of its interval where the terminal has room; zero is in the middle."""
    used = len(table(rows, "<" + ">" * (len(rows[0]) - 2) + "<").splitlines()[0].rstrip()) + max(len(r[-1]) for r in rows)
    room = min(width() - used - 2, WIDEST)
    if room < NARROWEST:
        return
    scaled = [(i, *shown(found.study.model.coefficients[i].unit)) for i in found.study.outputs]
    spans: dict[str, float] = {}
    for i, scale, unit in scaled:
        spans[unit] = max(spans.get(unit, 0.0), scale * max(abs(found.low[i]), abs(found.high[i])))
    for row, (i, scale, unit) in zip(rows[1:], scaled, strict=True):
        half = scale * float(found.high[i] - found.low[i]) / 2
        row[-1] = (
            f"{row[-1]:<{max(len(r[-1].split(' ')[0]) for r in rows)}}  {bar(scale * found.values[i], half, spans[unit], room)}"
        )


def _joint(found: Analysis) -> str:
    j = found.joint
    if not j:
        return ""
    ellipsoid = j["ellipsoid_monte_carlo"]
    own = f", Monte Carlo {ellipsoid:.2f}" if ellipsoid is not None else ", of the trials none: fewer repetitions than parameters"
    return (
        f"All {len(found.study.machine)} machine parameters together with p = {found.probability:g}: each within k_q u with k_q = "
        f"{j['rectangle']:.2f} (Monte Carlo {j['rectangle_monte_carlo']:.2f}, if uncorrelated {j['rectangle_independent']:.2f}); "
        f"ellipsoid k_p = {j['ellipsoid']:.2f}{own}"
    )


def _contributions(found: Analysis) -> str:
    study = found.study
    total = np.where(study.shares.sum(axis=0) > 0, study.shares.sum(axis=0), 1.0)
    labels = _budget(found)
    rows = [["budget, % of variance", *labels]]
    for i in study.outputs:
        name = found.selection.label(study.names[i])
        rows.append([name, *(f"{100 * study.shares[k, i] / total[i]:.0f}" for k in range(len(labels)))])
    return table(rows, "<" + ">" * len(labels))


def _strong(found: Analysis) -> str:
    matrix = found.study.correlation
    names = [found.selection.label(n) for n in found.study.names]
    pairs = [(abs(matrix[i, j]), i, j) for i in range(len(names)) for j in range(i) if abs(matrix[i, j]) > 0.8]
    if not pairs:
        return "No two parameters are correlated by more than 0.8 (matrix: --json)"
    said = [f"{names[j]} {names[i]} {matrix[i, j]:+.2f}" for _, i, j in sorted(pairs, reverse=True)[:8]]
    more = f" and {len(pairs) - 8} more" if len(pairs) > 8 else ""
    return f"Strong correlations: {', '.join(said)}{more} (matrix: --json)"


def _monte_carlo(found: Analysis) -> str:
    run, check, accuracy = found.run, found.validation, found.accuracy
    names = [found.selection.label(n) for n in found.study.names]
    worst = int(np.argmax(np.abs(check.std_ratio - 1)))
    bad = [name for name, good in zip(names, check.agrees, strict=True) if not good]
    off = 100 * abs(check.std_ratio[worst] - 1)
    chance = 100 * 3.5 / np.sqrt(2 * run.count)  # what the scatter of so many trials alone may do
    linear = (
        "linear propagation holds"
        if off <= 3
        else "so few trials do not resolve 3 %"
        if off <= chance
        else "beyond 3 %: rely on the intervals above, which are those of the trials"
    )
    blocks = f" in {found.blocks} blocks, {'stable' if found.stable else 'NOT yet stable'}" if found.blocks else ""
    rescued = f"; {run.rescued} by the full iteration" if run.rescued else ""
    coarse = "; too coarse, use --full" if accuracy.rms > 0.03 and run.rescued < run.count else ""
    lost = f"; {run.lost} found no solution and are left out" if run.lost else ""
    digits = f"{found.digits} digit{'s' if found.digits > 1 else ''}"
    lines = [
        f"Monte Carlo: {run.count} nonlinear estimations{blocks}{rescued}{lost}",
        f"frozen Jacobian and single precision cost at most {accuracy.largest:.2g} u, rms {accuracy.rms:.2g} u, and change a "
        f"standard deviation by at most {100 * accuracy.std_ratio:.2g} % ({accuracy.trials} trials solved in full){coarse}",
        f"standard deviations of trials and propagation agree within {off:.1f} % ({names[worst]}): {linear}",
        f"numerical tolerance at {digits}: "
        + ("the linear intervals are validated for all parameters" if not bad else f"not validated for {_some(bad)}"),
    ]
    return "\n".join(lines)


def _some(names: list[str]) -> str:
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")


def _days_text(found: Analysis) -> str:
    d = _days(found)
    several = found.repeated
    assert several is not None
    unit = [found.study.model.coefficients[i].unit for i in found.study.machine]
    head = [
        f"{len(several.days)} days of {len(several.cycles)} cycles",
        "mean",
        "range of days",
        "p",
        "range of cycles",
        "p",
        "std within",
        "",
    ]
    rows = [head]
    for i, name in enumerate(d.names):
        scale, label = shown(unit[i])
        numbers = [d.mean[i], np.ptp(d.day_means[:, i]), np.ptp(d.cycle_means[:, i]), d.std_within[i]]
        a, b, c, e = (f"{scale * x:.2f}" for x in numbers)
        rows.append([name, a, b, _p(d.p_days, d.days_differ, i), c, _p(d.p_cycles, d.cycles_differ, i), e, label])
    note = "* a difference: beyond what cycles scatter by, 5 % for all statements of a column together (Holm)"
    left = f"\n{several.left_out} touches are missing in some cycle and were left out of all" if several.left_out else ""
    return table(rows, "<>>>>>><") + "\n" + note + left


def _p(values: Array | None, differs: Any, i: int) -> str:
    return "–" if values is None else f"{values[i]:.2g}{'*' if differs[i] else ''}"


def _decisions(found: Analysis, decisions: Sequence[conformity.ConformityDecision]) -> str:
    rows = [["limits (ISO 14253-1)", "value", "low", "high", "p inside", "", "", "by the uncertainty of"]]
    names = [found.selection.label(n) for n in found.study.names]
    for d in decisions:
        scale, unit = shown(found.study.model.coefficients[names.index(d.name)].unit)
        numbers = (f"{scale * x:.2f}" for x in (d.value, d.limits.low, d.limits.high))
        rows.append([d.name, *numbers, _inside(d.inside), unit, d.verdict, "the mean" if d.uses == "mean" else d.uses])
    lines = table(rows, "<>>>><<<")
    if any(d.inside is None for d in decisions):
        lines += "\nNothing is decided, as the result is in doubt: the reasons stand above (--despite decides all the same)"
    return lines


def _inside(probability: float | None) -> str:
    """probability → as many digits as the trials can say."""
    if probability is None:
        return "–"
    return ">0.999" if probability > 0.999 else "<0.001" if probability < 0.001 else f"{probability:.3f}"


def comparison_json(c: process.Comparison, condition: Sequence[float] | None = None) -> dict[str, Any]:
    """comparison, condition numbers of the sets or None → plain data."""
    data: dict[str, Any] = {
        "method": c.method,
        "sets": list(c.labels),
        "joint_p": c.joint_p,
        "parameters": {
            name: {
                "values": [float(v) for v in c.values[:, i]],
                "mean": float(c.mean[i]),
                "range": float(c.range[i]),
                "std": float(c.std[i]),
                "u_difference": None if c.u_difference is None else float(c.u_difference[i]),
                "p": float(c.p_value[i]),
                "differs": bool(c.differs[i]),
            }
            for i, name in enumerate(c.names)
        },
    }
    return data | ({"condition_numbers": list(condition)} if condition else {})


def comparison_text(c: process.Comparison, of: Sequence[str], condition: Sequence[float] | None = None) -> str:
    """comparison, units of its parameters, condition numbers of the sets or None → text."""
    rows = [["parameter", *c.labels, "range", "std", "u of diff.", "p", "", ""]]
    for i, name in enumerate(c.names):
        scale, unit = shown(of[i])
        u = "–" if c.u_difference is None else f"{scale * c.u_difference[i]:.2f}"
        numbers = [*(f"{scale * v:.2f}" for v in c.values[:, i]), f"{scale * c.range[i]:.2f}", f"{scale * c.std[i]:.2f}", u]
        rows.append([name, *numbers, f"{c.p_value[i]:.2g}", unit, "differs" if c.differs[i] else ""])
    if condition:
        rows.append(["condition number", *(f"{x:.0f}" for x in condition), "", "", "", "", "", ""])
    joint = "" if c.joint_p is None else f"; all parameters together p = {c.joint_p:.2g}"
    note = f"{c.method}{joint}; 'differs' errs with 5 % for all parameters together (Holm)"
    return table(rows, "<" + ">" * (len(c.labels) + 4) + "<<") + "\n" + note
