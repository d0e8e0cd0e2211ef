"""The thesis' tables beside ours → one HTML page; with the study of Table 4-6 its pictures (matplotlib, extra `report`)."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..report.diagnosis import HEAD, course, seen
from ..report.pictures import BAD, GOOD, INK, MARK, PALE, embedded, figure, styled, vectors
from ._setting import Table
from .unexplained import SETS, Unexplained, found_words, hidden, words


def page(tables: Sequence[Table], study: Unexplained | None = None) -> str:
    """tables, study of Table 4-6 → HTML that stands alone. Raises InputError when matplotlib is not installed."""
    parts = [HEAD.replace("<title>Diagnosis</title>", "<title>Reproduction</title>"), "<h1>The thesis beside this program</h1>"]
    for one in tables:
        parts += [f"<h2>Table {one.number}: {html.escape(one.title)}, {html.escape(one.unit)}</h2>", _table(one)]
        parts += [
            f"<p><b>{name}:</b> {html.escape(text)}</p>" for name, text in (("compared", one.compared), ("differs", one.differs))
        ]
        if one.arrows is not None:
            parts.append(f'<p>Figure {one.arrows.figure}</p><img alt="" src="{embedded(vectors(one.arrows.panels))}">')
    if study is not None:
        parts += _study(study)
    return "\n".join([*parts, "</body></html>\n"])


def _table(one: Table) -> str:
    sources = ("thesis", "here", "other") if any(row.other for row in one.rows) else ("thesis", "here")
    head = "".join(f"<th colspan={len(sources)}>{html.escape(column)}</th>" for column in one.columns)
    below = "".join(f"<th>{source}</th>" for _ in one.columns for source in sources)
    body = ""
    for row in one.rows:
        values = (row.printed, row.ours, row.other or (None,) * len(row.ours))[: len(sources)]
        cells = "".join(f"<td>{_shown(v)}</td>" for group in zip(*values, strict=True) for v in group)
        body += f"<tr><td>{html.escape(row.name)}</td>{cells}</tr>"
    return f"<table><tr><th></th>{head}</tr><tr><th></th>{below}</tr>{body}</table>"


def _shown(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}" if abs(value) >= 0.1 or value == 0 else f"{value:.4f}"


def _study(study: Unexplained) -> list[str]:
    parts = ["<h2>Table 4-6: what explains it, and what does not</h2>", f'<img alt="" src="{embedded(intervals(study))}">', "<ul>"]
    parts += [f"<li>{html.escape(line)}</li>" for line in words(study)]
    parts.append("</ul>")
    for one in study.found:
        d = one.diagnosis
        parts += [f"<h2>Hidden in simulated readings: {html.escape(one.title)}</h2>", "<ul>"]
        parts += [f"<li>hidden: {html.escape(line)}</li>" for line in hidden(one.hidden)]
        parts += [f"<li><b>found</b>: {html.escape(line)}</li>" for line in found_words(one)]
        parts += ["</ul>", f'<img alt="" src="{embedded(course(d))}">']
        parts += [f'<p>{html.escape(f.cause)}</p><img alt="" src="{embedded(seen(d, f))}">' for f in d.findings if f.pattern.any()]
    return parts


def intervals(study: Unexplained) -> Any:
    """study → the printed figures beside the spread of the simulated tests, and what one larger disturbance would do."""
    with styled():
        drawn = figure(9.5, 4.2)
        grid = drawn.subplots(2, 2)
        for i, name in enumerate(SETS):
            for ax, what in zip(grid[i], ("mean", "max"), strict=True):
                rows = [
                    ("noise alone", study.without[name].values[what], GOOD),
                    ("as measured", study.disturbed[name].values[what], GOOD),
                ]
                rows += [(f"twice the {k}", one[name].values[what], PALE) for k, one in study.larger.items()]
                for y, (_, (value, sd), colour) in enumerate(rows):
                    ax.errorbar(value, y, xerr=2 * sd, fmt="o", color=colour, ms=5, capsize=3)
                for how, y in (("without", 0), ("with", 1)):
                    ax.plot(study.other[how][name][what], y, "D", color=MARK, ms=5, label="other program" if y else None)
                ax.axvline(study.printed[name][what], color=BAD, lw=1.2, label="thesis")
                ax.set_yticks(np.arange(len(rows)), [label for label, _, _ in rows])
                ax.set_ylim(len(rows) - 0.5, -0.5)
                ax.set_xlim(left=0)
                ax.set_title(f"{name}, {what} |r|", loc="left", color=INK)
                ax.set_xlabel("µm (bars: two standard deviations of a test)")
        grid[0][0].legend(fontsize=7)
    return drawn
