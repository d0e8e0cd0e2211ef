"""Terms that an error of the tool tip at a pose does not have: they act on touches, and are no place in the chain of axes."""

from __future__ import annotations

import numpy as np

from ..estimate import Estimate
from ..terms import GAP

LEAST = 5e-4  # mm at a touch: less is not worth a line


def apart(result: Estimate) -> str:
    """estimate → a sentence with the terms that no map, prediction or compensation has, and their size at a touch; '' for none."""
    model = result.model
    found = []
    for c, value, regressor in zip(model.coefficients, result.values, model.regressors, strict=False):
        size = abs(float(value)) * float(np.abs(regressor).max())
        if c.slot == GAP and size > LEAST:
            found.append((size, c.name))
    if not found:
        return ""
    listed = ", ".join(f"{name} ({size * 1e3:.1f} µm at a touch)" for size, name in sorted(found, reverse=True)[:4])
    more = f" and {len(found) - 4} more" if len(found) > 4 else ""
    return f"not contained, since it acts on touches: {listed}{more}. What of it the machine does, parts have as well"
