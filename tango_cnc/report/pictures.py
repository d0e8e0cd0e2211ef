"""Results → pictures (matplotlib, the optional extra `report`). Every function returns a figure; nothing is shown or kept."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..records import Array, InputError
from .texts import texts

Numbers = NDArray[np.int64]
Mask = NDArray[np.bool_]

INK, PALE, GOOD, BAD, MARK = "#1f2933", "#b8c0c8", "#1b6ca8", "#c0392b", "#e08e0b"
STYLE = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.edgecolor": INK,
    "axes.grid": True,
    "grid.color": "#e5e8eb",
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "svg.fonttype": "none",
}


def available() -> bool:
    """→ whether matplotlib is installed."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        return False
    return True


def needed() -> None:
    """→ nothing. Raises InputError when matplotlib is not installed: before anything is computed for a picture."""
    if not available():
        raise InputError(
            "pictures need matplotlib, which is not installed: pip install 'tango-cnc[report]', or leave the pictures out"
        )


def figure(width: float, height: float) -> Any:
    """inches → an empty figure. Raises InputError when matplotlib is not installed."""
    needed()
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def styled() -> Any:
    """→ context in which figures are drawn and written in the house style. Raises InputError when matplotlib is not installed."""
    needed()
    import matplotlib

    return matplotlib.rc_context(STYLE)  # type: ignore[arg-type]


def write(drawn: Any, file: Path) -> Path:
    """figure, file.png or .svg → the file. Raises InputError when the folder cannot be written."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with styled():
            drawn.savefig(file, dpi=150)
    except OSError as error:
        raise InputError(f"{file}: cannot be written ({error.strerror})") from None
    return file


def encoded(drawn: Any, kind: str) -> bytes:
    """figure, png, svg or pdf → what a file of it holds, for one that is written together with others."""
    buffer = io.BytesIO()
    with styled():
        drawn.savefig(buffer, format=kind, dpi=150)
    return buffer.getvalue()


def embedded(drawn: Any) -> str:
    """figure → data URI of a PNG, for a page that stands alone."""
    buffer = io.BytesIO()
    with styled():
        drawn.savefig(buffer, format="png", dpi=130)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def colours(group: Numbers) -> Array:
    """(n,) group numbers → (n, 4) colours, neighbours far apart."""
    import matplotlib

    _, place = np.unique(group, return_inverse=True)
    count = int(place.max()) + 1 if len(place) else 1
    return np.asarray(matplotlib.colormaps["turbo"](0.05 + 0.9 * ((place * 5) % count) / max(count, 1)))


def vectors(panels: Mapping[str, tuple[Array, Array, Array, Numbers]], scale: float | None = None) -> Any:
    """title: points (n, 3) mm, unit normals (n, 3), residuals (n,) mm, groups (n,) → one 3-D panel each, a colour a group.

    Touches of one facet are drawn side by side on a small circle, since all their arrows share one line (Figures 4-7 … 4-10).
    `scale` magnifies all panels alike; without it each panel has its own.
    """
    with styled():
        columns = 1 if len(panels) == 1 else 2
        rows = -(-len(panels) // columns)
        drawn = figure(5.8 * columns, 3.9 * rows)
        for place, (title, (point, normal, residual, group)) in enumerate(panels.items(), 1):
            axes = drawn.add_subplot(rows, columns, place, projection="3d")
            largest = max(float(abs(residual).max()), 1e-9)
            factor = scale or float(f"{0.2 * float(np.ptp(point, axis=0).max()) / largest:.1e}")
            at = point + _beside(normal, group)
            tip = factor * residual[:, None] * normal
            _patches(axes, point, normal)
            axes.quiver(*at.T, *tip.T, colors=colours(group), linewidth=0.9, arrow_length_ratio=0.15)
            size = abs(residual) * 1e3
            axes.set_title(f"{title}\nmax {size.max():.2f}  mean {size.mean():.2f} µm", fontsize=10)
            _box(axes, np.vstack([at, at + tip]), texts()("picture.arrows", factor=f"{factor:,.0f}", size=f"{5e4 / factor:.3g}"))
    return drawn


def _beside(normal: Array, group: Numbers) -> Array:
    """→ (n, 3) mm, small offsets across the normal, another direction for each group."""
    one, two = _across(normal)
    angle = 2.399963 * group[:, None]  # the golden angle: no two neighbours alike
    return np.asarray(7.0 * (np.cos(angle) * one + np.sin(angle) * two))


def _across(normal: Array) -> tuple[Array, Array]:
    helper = np.where(np.abs(normal[:, 2:3]) > 0.9, np.array([[1.0, 0, 0]]), np.array([[0, 0, 1.0]]))
    one = np.cross(normal, helper)
    one /= np.linalg.norm(one, axis=1)[:, None]
    return one, np.cross(normal, one)


def _patches(axes: Any, point: Array, normal: Array) -> None:
    """Each facet once, as a small square that shows how it stands."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    _, first = np.unique(np.round(point, 3), axis=0, return_index=True)
    one, two = _across(normal[first])
    corners = [point[first] + 10 * (i * one + j * two) for i, j in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
    squares = np.stack(corners, axis=1)
    axes.add_collection3d(Poly3DCollection(list(squares), facecolors="#dfe5ea80", edgecolors=PALE, linewidths=0.5))


def _box(axes: Any, points: Array, text: str, zoom: float = 1.05) -> None:
    low, high = points.min(axis=0), points.max(axis=0)
    extent = np.maximum(high - low, 0.25 * float((high - low).max()))
    low = (low + high - extent) / 2
    axes.set(xlim=(low[0], low[0] + extent[0]), ylim=(low[1], low[1] + extent[1]))
    axes.set_zlim(low[2], low[2] + extent[2])
    axes.set_box_aspect(extent, zoom=zoom)
    axes.view_init(elev=32, azim=-58)
    axes.set_xlabel("x mm", labelpad=-3)
    axes.set_ylabel("y mm", labelpad=-3)
    axes.set_zlabel("z mm", labelpad=-3)
    axes.tick_params(labelsize=7, pad=-1)
    axes.locator_params(nbins=5)
    axes.text2D(0.5, 0.0, text, transform=axes.transAxes, ha="center", fontsize=8, color=INK)


def touches(number: Numbers, residual: Array, group: Numbers, flagged: Mask, sigma: float) -> Any:
    """touch numbers (n,), residuals (n,) mm, indexations (n,), outliers (n,) mask, mm → residuals in the order of measurement."""
    with styled():
        drawn = figure(9.5, 3.0)
        axes, side = drawn.subplots(1, 2, width_ratios=(5, 1), sharey=True)
        order = np.arange(1, len(number) + 1)
        edges = np.flatnonzero(np.diff(group)) + 1.5
        for left, right in zip([0.5, *edges][::2], [*edges, len(number) + 0.5][::2], strict=False):
            axes.axvspan(left, right, color="#f1f4f6", lw=0)
        axes.axhspan(-2e3 * sigma, 2e3 * sigma, color="#dcebf5", lw=0, label=texts()("picture.band"))
        axes.scatter(order[~flagged], 1e3 * residual[~flagged], s=8, color=GOOD, label=texts()("table.touch"))
        if flagged.any():
            axes.scatter(order[flagged], 1e3 * residual[flagged], s=36, marker="x", color=BAD, label=texts()("picture.misfit"))
            for i in np.flatnonzero(flagged)[:12]:
                axes.annotate(
                    f"{number[i]:.0f}", (order[i], 1e3 * residual[i]), xytext=(4, 3), textcoords="offset points", fontsize=7
                )
        axes.set(xlabel=texts()("picture.order"), ylabel=texts()("picture.unexplained"))
        axes.set_xlim(0.5, len(number) + 0.5)
        axes.grid(axis="x", visible=False)
        axes.legend(ncols=3, loc="lower left", bbox_to_anchor=(0, 1.0), fontsize=8)
        side.hist(1e3 * residual, bins=31, orientation="horizontal", color=GOOD)
        side.set_xlabel("count")
    return drawn


def held_out(indexation: Numbers, residual: Array, expected: Array, labels: Mapping[int, str]) -> Any:
    """indexation (n,), held-out residuals (n,) mm, expected standard deviations (n,) mm → predicted against expected."""
    with styled():
        drawn = figure(9.5, 3.4)
        axes = drawn.subplots()
        every = np.unique(indexation)
        rng = np.random.default_rng(0)
        for place, i in enumerate(every):
            rows = indexation == i
            width = float(np.sqrt(np.mean(expected[rows] ** 2)))
            axes.fill_between([place - 0.42, place + 0.42], -2e3 * width, 2e3 * width, color="#dcebf5", lw=0)
            axes.scatter(place + rng.uniform(-0.3, 0.3, rows.sum()), 1e3 * residual[rows], s=9, color=GOOD)
        axes.axhline(0, color=INK, lw=0.6)
        axes.set_xticks(range(len(every)), [labels.get(int(i), f"{i}") for i in every], rotation=60, ha="right", fontsize=7)
        axes.set(ylabel=texts()("picture.gap"), title=texts()("picture.held_out"))
        axes.grid(axis="x", visible=False)
    return drawn


def sphere(normal: Array, radius: float, panels: Mapping[str, Array]) -> Any:
    """outward normals (n, 3), mm, title: residuals (n,) mm → the sphere as touched, each panel with its own magnification."""
    with styled():
        drawn = figure(5.2 * len(panels), 4.8)
        for place, (title, residual) in enumerate(panels.items(), 1):
            axes = drawn.add_subplot(1, len(panels), place, projection="3d")
            largest = max(float(abs(residual).max()), 1e-9)
            scale = 0.35 * radius / largest
            at = radius * normal
            tip = scale * residual[:, None] * normal
            u, v = np.mgrid[0 : 2 * np.pi : 25j, -np.pi / 6 : np.pi / 2 : 9j]  # type: ignore[misc]
            axes.plot_wireframe(
                radius * np.cos(v) * np.cos(u), radius * np.cos(v) * np.sin(u), radius * np.sin(v), color=PALE, linewidth=0.3
            )
            outside = residual > 0
            for rows, colour in ((outside, BAD), (~outside, GOOD)):
                if rows.any():
                    axes.quiver(*at[rows].T, *tip[rows].T, color=colour, linewidth=0.7, arrow_length_ratio=0.0)
            axes.scatter(*(at + tip).T, s=3, c=np.where(outside, BAD, GOOD), depthshade=False)
            axes.set_title(texts()("picture.sphere", title=title, size=f"{np.ptp(residual) * 1e3:.2f}"), fontsize=10)
            _box(axes, np.vstack([at, at + tip]), texts()("picture.residuals", factor=f"{scale:,.0f}"), 0.92)
    return drawn


def volume(
    names: Sequence[str], position: Array, unit: Sequence[str], sizes: Mapping[str, Array], std: Array, trusted: Mask
) -> Any:
    """axis names, poses (n, k) in shown units, units, sizes by name and std (n,) mm, mask → worst error along each axis."""
    with styled():
        columns = 3 if len(names) > 3 else len(names)
        rows = -(-len(names) // columns)
        drawn = figure(3.4 * columns, 2.9 * rows + 0.5)
        for place, name in enumerate(names):
            axes = drawn.add_subplot(rows, columns, place + 1)
            at = position[:, place]
            for (title, size), colour in zip(sizes.items(), (GOOD, MARK, BAD), strict=False):
                x, y = _upper(at[~trusted], size[~trusted]) if not trusted.all() else (at[:0], size[:0])
                axes.plot(x, 1e3 * y, color=colour, lw=1, ls=":", label=texts()("picture.extrapolated", title=title))
                if trusted.any():
                    x, y = _upper(at[trusted], size[trusted])
                    _, top = _upper(at[trusted], (size + 2 * std)[trusted])
                    axes.fill_between(x, 1e3 * y, 1e3 * top, color=colour, alpha=0.2, lw=0)
                    axes.plot(x, 1e3 * y, color=colour, lw=1.8, marker="o", ms=3, label=texts()("picture.within", title=title))
            if trusted.any():
                axes.axvspan(float(at[trusted].min()), float(at[trusted].max()), color="#eef3f6", lw=0, zorder=0)
            axes.set(xlabel=f"{name}, {unit[place]}", ylim=(0, None))
            if place % columns == 0:
                axes.set_ylabel(texts()("picture.tip"))
        handles, labels = axes.get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside upper center", ncols=2, fontsize=8)
    return drawn


def _upper(at: Array, size: Array) -> tuple[Array, Array]:
    """positions (n,), sizes (n,) → at most 25 positions and the largest size near each."""
    low, high = float(at.min()), float(at.max())
    if high - low < 1e-9:
        return np.array([low]), np.array([size.max()])
    values = np.unique(np.round(at, 6))
    centre = values if len(values) <= 25 else np.linspace(low, high, 13)
    nearest = np.abs(at[:, None] - centre[None, :]).argmin(axis=1)
    some = np.unique(nearest)
    return centre[some], np.array([size[nearest == i].max() for i in some])


def parameters(groups: Mapping[str, Sequence[tuple[str, float, float]]]) -> Any:
    """unit: (name, value, standard deviation) … → values with two standard deviations, a panel a unit."""
    with styled():
        tall = max(len(rows) for rows in groups.values())
        drawn = figure(9.5, 0.9 + 0.21 * max(tall, 3))
        axes = drawn.subplots(1, len(groups), squeeze=False)[0]
        for own, (unit, rows) in zip(axes, groups.items(), strict=True):
            at = -np.arange(len(rows), dtype=float)
            value, std = np.array([r[1] for r in rows]), np.array([r[2] for r in rows])
            seen = np.abs(value) > 2 * std
            own.axvline(0, color=INK, lw=0.8)
            for mask, colour in ((seen, GOOD), (~seen, PALE)):
                if mask.any():
                    own.errorbar(value[mask], at[mask], xerr=2 * std[mask], fmt="o", ms=4, lw=1.2, color=colour)
            own.set_yticks(at, [r[0] for r in rows], fontsize=8)
            own.set_ylim(-tall + 0.3, 0.7)
            own.set_xlabel(unit)
            own.grid(axis="y", visible=False)
    return drawn


def curves(panels: Mapping[str, tuple[str, Array, Sequence[tuple[str, Array, Array]], str]]) -> Any:
    """title: (axis label, positions (m,), [(name, curve (m,), std (m,))], unit) → error motions over their travel."""
    with styled():
        columns = 2
        rows = -(-len(panels) // columns)
        drawn = figure(9.5, 2.5 * rows)
        for place, (title, (label, at, found, unit)) in enumerate(panels.items(), 1):
            axes = drawn.add_subplot(rows, columns, place)
            for (name, y, std), colour in zip(found, (GOOD, MARK, BAD, "#5b8c3e", "#7d5ba6", "#3aa6a0"), strict=False):
                axes.plot(at, y, color=colour, lw=1.5, label=name)
                axes.fill_between(at, y - 2 * std, y + 2 * std, color=colour, alpha=0.15, lw=0)
            axes.axhline(0, color=INK, lw=0.5)
            axes.set(xlabel=label, ylabel=unit, title=title)
            axes.legend(fontsize=7, ncols=3)
    return drawn
