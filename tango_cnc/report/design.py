"""Pictures of a plan that was chosen: uncertainty against minutes, where touches are, where the volume is well and badly known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from .drawn import Drawn
from .texts import texts


def figure(drawn: Drawn, title: str, competitors: Sequence[tuple[str, float, float]] = ()) -> Figure:
    """drawing, title, (name, minutes, value) of other plans → figure of three pictures."""
    page = Figure(figsize=(13, 4.2), layout="constrained")
    page.suptitle(title)
    worth, where, known = page.subplots(1, 3)
    worth.semilogy(drawn.minutes, drawn.values, color="tab:blue", label=texts()("design.this_plan"))
    for name, minutes, value in competitors:
        worth.plot([minutes], [value], "o", label=name)
    worth.set(xlabel="minutes", ylabel=drawn.label, title=texts()("design.title_worth"))
    worth.legend()
    worth.grid(alpha=0.3, which="both")
    if len(drawn.axes):
        second = drawn.angles[:, 1] if len(drawn.axes) > 1 else np.zeros(len(drawn.angles))
        where.scatter(drawn.angles[:, 0], second, s=14 * drawn.touches, alpha=0.5)
        for number, (x, y) in enumerate(zip(drawn.angles[:, 0], second, strict=True), 1):
            where.annotate(str(number), (x, y), ha="center", va="center", fontsize=8)
        where.set(xlabel=f"{drawn.axes[0]} (deg)", ylabel=f"{drawn.axes[1]} (deg)" if len(drawn.axes) > 1 else "")
    where.set_title(texts()("design.title_where"))
    where.grid(alpha=0.3)
    order = np.argsort(drawn.std)
    across = known.scatter(drawn.place[order, 0], drawn.place[order, 1], c=drawn.std[order], s=22, cmap="viridis")
    known.set(xlabel=texts()("design.x_part"), ylabel=texts()("design.y_part"), aspect="equal", title=texts()("design.title_known"))
    page.colorbar(across, ax=known)
    return page
