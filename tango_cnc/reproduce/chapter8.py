"""Chapter 8: what the choice of indexations does to the condition number."""

from __future__ import annotations

import numpy as np

from ..estimate import estimate
from ..model import known, linearise
from ..verify.held_out import indexations
from ._setting import NOISE, UNTOLD_TABLE, Row, Setting, Table, si

TRIALS = 40
BAR = 17  # the indexation at which the scale bar is touched stays


def table_8_4(setting: Setting) -> Table:
    """setting → condition number of all 28 indexations and of subsets of them."""
    cell = setting.hu40t
    readings = setting.measured(setting.world(si(setting.printed["table_4_5"]["scale_enriched"]), noise=NOISE))
    model = estimate(cell.machine, cell.artefact, readings, ("S3",)).model
    start = np.zeros(len(model.names))
    _, jacobian = linearise(model, start)
    _, bar, _ = known(model, start)
    number = indexations(readings, cell.machine)[readings.ok]
    rng = np.random.default_rng(setting.seed)
    printed = setting.printed["table_8_4_condition_number"]
    rows = []
    for key, value in printed.items():
        count = int(key.split("_")[1 if key.startswith("subset") else 0]) if not key.startswith("28") else 28
        values = [_condition(np.vstack([jacobian, bar]))]
        if count < 28:
            values = []
            for _ in range(TRIALS):
                free = rng.permutation([i for i in range(1, 29) if i != BAR])[: count - 1]
                keep = np.isin(number, [BAR, *free])
                values.append(_condition(np.vstack([jacobian[keep], bar])))
        rows.append(Row(f"{count} indexations", (float(value), None), (float(min(values)), float(np.median(values)))))
    return Table(
        "8-4",
        "Condition number by number of indexations, subset S3 with the scale bar",
        "1 (Jacobian in mm and rad)",
        ("best", "median of random subsets"),
        tuple(rows),
        "The Jacobian of S3 at the nominal machine. The thesis chose its subsets by condition number; here the best and the "
        f"median of {TRIALS} random subsets that keep the scale bar.",
        "Which indexations were kept is not printed. A condition number in mm and rad depends on the size of the table, on "
        f"the bar and on how facets are spread, so its level is not comparable, its order is. {UNTOLD_TABLE}",
    )


def _condition(matrix: np.ndarray) -> float:
    """(n, p) → largest over smallest singular value; facets that no touch sees any more are left out."""
    return float(np.linalg.cond(matrix[:, np.any(matrix != 0, axis=0)]))
