"""Results of the checks → plain data for JSON, and lines for people (µm, degrees)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..files.readings import degrees_of
from ..iso230.temperature import Thermal
from ..records import Array, Machine
from ._shared import Figures
from .cmm import Comparison
from .held_out import HeldOut
from .sphere import SphereFit, SphereTest
from .volume import VolumeMap


def figures_json(f: Figures) -> dict[str, Any]:
    """figures in mm → µm, plain."""
    um = {"max_um": f.max, "min_um": f.min, "mean_um": f.mean, "sd_um": f.sd, "range_um": f.range}
    return {"touches": f.count, **{key: value * 1e3 for key, value in um.items()}}


def figures_text(f: Figures) -> list[str]:
    """figures in mm → cells of a table: n, max, min, mean, sd in µm."""
    return [f"{f.count}", *(f"{value * 1e3:.2f}" for value in (f.max, f.min, f.mean, f.sd))]


def comparison_lines(found: Comparison, thermal: Thermal | None) -> list[str]:
    """comparison with a CMM, temperatures (None: not stated of table and CMM) → what scale has to do with it, for people."""
    if thermal is not None:
        left = 2 * found.grown.std * found.reach * 1e3
        lines = [
            f"lengths of the CMM are taken {found.grown.value * 1e6:.1f} ± {found.grown.std * 1e6:.1f} µm/m longer, by "
            f"temperature.yaml ({thermal.text}); this leaves up to {left:.1f} µm (k = 2) at a facet"
        ]
    else:
        lines = [
            "temperatures of table and CMM are not stated: both are taken to be at 20 °C. A warm table and a wrong scale look "
            "alike; write table, table_expansion and cmm into temperature.yaml"
        ]
    if found.scale.std < math.inf:
        told = f"a scale of {found.scale.value * 1e6:.1f} ± {found.scale.std * 1e6:.1f} µm/m beside that"
        if found.fitted:
            lines.append(f"{told} is fitted and taken out (--cmm-scale): the residuals say nothing of scale")
        elif abs(found.scale.value) > SURE * float(np.hypot(found.scale.std, found.grown.std)):
            lines.append(f"{told} would fit better: the machine's scale is wrong, or the table is not as warm as was taken")
    return lines


SURE = 3.0  # standard deviations
FIGURES = ["n", "max", "min", "mean", "sd"]


NAMED = 8  # touches that a line names


def held_out_lines(found: HeldOut) -> list[str]:
    """held-out residuals → what makes them larger than the estimate claims, for people; none where chance explains them."""
    if found.ratio <= found.chance:
        return []
    head = f"predicted/expected {found.ratio:.2f}: chance alone seldom gives more than {found.chance:.2f}"
    far = found.far
    if not far.any():
        return [f"{head}. No single touch makes it so: the model lacks something. Do: tango diagnose"]
    order = np.argsort(-np.abs(found.residual * far), kind="stable")[: int(far.sum())]
    names = [f"{found.touch[i]} ({found.residual[i] * 1e3:+.1f})" for i in order[:NAMED]]
    more = f" and {len(order) - NAMED} more" if len(order) > NAMED else ""
    what = "touch" if len(order) == 1 else "touches"
    rest = f"all others {found.ratio_of(found.told & ~far):.2f}"
    return [f"{head}. Furthest off, µm: {what} {', '.join(names)}{more}; {rest}. Look at them first: tango diagnose"]


def held_out_json(found: HeldOut) -> dict[str, Any]:
    """held-out residuals → plain data."""
    each = [found.residual[found.group == i] for i in range(len(found.groups))]
    return {
        **figures_json(found.figures),
        "ratio_to_expected": found.ratio,
        "ratio_by_chance": found.chance,
        "far_off": [int(t) for t in found.touch[found.far]] if found.ratio > found.chance else [],
        "fitted_rms_um": float(np.sqrt(np.mean(found.fitted**2))) * 1e3,
        "groups": [
            {"indexations": list(g), "touches": len(r), "max_abs_um": float(abs(r).max()) * 1e3 if len(r) else None}
            for g, r in zip(found.groups, each, strict=True)
        ],
        "not_predictable_facets": list(found.unpredictable),
        "not_identifiable": list(found.unseen),
        "residuals": [
            {"touch": int(t), "facet": f, "indexation": int(i), "residual_um": r * 1e3, "expected_sd_um": e * 1e3}
            for t, f, i, r, e in zip(found.touch, found.facet, found.indexation, found.residual, found.expected, strict=True)
        ],
    }


def comparison_json(found: Comparison) -> dict[str, Any]:
    """comparison with a CMM → plain data."""
    return {
        **figures_json(found.figures),
        "best_fit": {"shift_mm": found.shift.tolist(), "turn_urad": (found.turn * 1e6).tolist()},
        "grown_um_m": {"value": found.grown.value * 1e6, "std": found.grown.std * 1e6},
        "scale_um_m": None if found.scale.std == math.inf else {"value": found.scale.value * 1e6, "std": found.scale.std * 1e6},
        "scale_fitted": found.fitted,
        "residuals": [{"facet": f, "residual_um": float(r) * 1e3} for f, r in zip(found.facet, found.residual, strict=True)],
    }


def sphere_json(found: SphereTest) -> dict[str, Any]:
    """sphere test → plain data."""

    def one(fit: SphereFit) -> dict[str, Any]:
        return {
            "out_of_sphericity_um": fit.out_of_sphericity * 1e3,
            "max_um": float(fit.residual.max()) * 1e3,
            "min_um": float(fit.residual.min()) * 1e3,
            "sd_um": fit.sd * 1e3,
            "size_error_um": found.size_error(fit) * 1e3,
            "centre_mm": fit.centre.tolist(),
        }

    return {
        "touches": len(found.touches),
        "nominal": one(found.nominal),
        "compensated": one(found.compensated),
        "expected_out_of_sphericity_um": {"median": found.expected[0] * 1e3, "q97_5": found.expected[1] * 1e3},
    }


def sphere_rows(found: SphereTest) -> list[list[str]]:
    """sphere test → table of nominal against compensated, µm."""
    fits = (found.nominal, found.compensated)
    rows = [
        ("out of sphericity", [f.out_of_sphericity for f in fits]),
        ("largest residual", [f.residual.max() for f in fits]),
        ("smallest residual", [f.residual.min() for f in fits]),
        ("standard deviation", [f.sd for f in fits]),
        ("radius found minus true", [found.size_error(f) for f in fits]),
    ]
    return [["µm", "nominal", "compensated"], *([name, *(f"{v * 1e3:.2f}" for v in values)] for name, values in rows)]


def pose_text(machine: Machine, position: Array) -> str:
    """(k,) mm rad → `X 100 Y −50 Z 300 B 30 C −90`."""
    shown = position / degrees_of(machine)
    names = (*machine.linear, *machine.rotary)
    return " ".join(f"{name} {shown[machine.column(name)] + 0.0:.4g}" for name in names)


def region_json(machine: Machine, chart: VolumeMap, rows: NDArray[np.bool_], sizes: dict[str, Array]) -> dict[str, Any]:
    """map, mask of poses, error sizes (n,) mm by name → figures of that region, plain."""
    index = np.flatnonzero(rows)
    if not len(index):
        return {"poses": 0}
    result: dict[str, Any] = {"poses": len(index), "std_max_um": float(chart.std[index].max()) * 1e3}
    result["reversal_max_um"] = float(chart.reversal[index].max()) * 1e3
    for name, size in sizes.items():
        i = int(index[np.argmax(size[index])])
        at = chart.position[i] / degrees_of(machine)
        pose = {axis: float(at[machine.column(axis)]) for axis in (*machine.linear, *machine.rotary)}
        result[name] = {
            "max_um": float(size[i]) * 1e3,
            "rms_um": float(np.sqrt(np.mean(size[index] ** 2))) * 1e3,
            "worst_pose": pose,
            "worst_pose_std_um": float(chart.std[i]) * 1e3,
        }
    return result
