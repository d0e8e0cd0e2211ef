"""A diagnosis → one HTML page with pictures that a machinist understands (matplotlib, the optional extra `report`)."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..diagnose import Diagnosis, Finding, Remainder, Test
from ..diagnose.sentences import advice, also, cause_name, covariate, dropped, meaning, said, towards, unexplained
from ..diagnose.words import as_text, telling
from ..terms._shape import values
from .over import covariate_of, shown_over
from .pictures import BAD, GOOD, INK, PALE, embedded, figure, styled
from .texts import texts

COLUMNS = 3  # of small pictures side by side
FIRST = 6  # covariates that are drawn large; the others follow at the end

HEAD = """<!doctype html><html lang="{language}"><head><meta charset="utf-8"><title>{title}</title><style>
body{font:15px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#1f2933}
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}img{max-width:100%}pre{background:#f4f6f8;padding:1rem;overflow:auto}
.verdict{padding:.6rem 1rem;border-left:.4rem solid;background:#f4f6f8;font-size:1.1rem}
.adequate{border-color:#2e7d32}.explained{border-color:#1b6ca8}.unexplained{border-color:#c0392b}
td,th{padding:.2rem .8rem;text-align:right}td:first-child,th:first-child{text-align:left}</style></head><body>"""


def page(d: Diagnosis) -> str:
    """diagnosis → HTML that stands alone. Raises InputError when matplotlib is not installed."""
    t = texts()
    title = html.escape(t("diagnosis_page.title", machine=d.before.model.touches.machine.name))
    head = HEAD.replace("{language}", t("language")).replace("{title}", title)
    parts = [head, f"<h1>{title}</h1>", f'<p class="verdict {d.verdict}">{html.escape(_short(d))}</p>']
    parts += [_head("left"), _image(course(d))]
    if d.tests:
        parts += [_head("depends"), f"<p>{html.escape(_dependence_words(d))}</p>"]
        parts.append(_image(dependence(d, d.tests[:FIRST])))
    for i, f in enumerate(d.findings, 1):
        parts += [f"<h2>{i}. {html.escape(cause_name(f.cause))}</h2>", f"<p><b>{html.escape(said(f))}.</b></p>"]
        parts += [_line("means", meaning(f)), _line("todo", advice(f))]
        if f.pattern.any():
            parts.append(_image(seen(d, f)))
        if f.gain is not None:
            parts.append(_gains(f))
        if f.alternatives:
            names = ", ".join(cause_name(a) for a in dict.fromkeys(a for a, _, _ in f.alternatives))
            parts.append(_line("twins", names))
        if f.aliases:
            parts.append(_line("also", also(f)))
        parts += [_line("tell", s) for s in f.separate_with]
    for r in d.unexplained:
        parts.append(f"{_head('unexplained')}<p>{html.escape(unexplained(r))}.</p>")
        if r.form is not None:
            parts.append(_image(shape(d, r)))
    if d.dropped:
        parts += [_head("dropped"), *(f"<p>{html.escape(x)}.</p>" for x in dict.fromkeys(map(dropped, d.dropped)))]
    parts += [_head("words"), f"<pre>{html.escape(as_text(d))}</pre>"]
    if len(d.tests) > FIRST:
        parts += [_head("covariates"), _tests(d), _image(dependence(d, d.tests[FIRST:]))]
    return "\n".join([*parts, "</body></html>\n"])


def _dependence_words(d: Diagnosis) -> str:
    count = len(telling(d))
    t = texts()
    what = t("diagnosis_page.none" if not count else "diagnosis_page.one" if count == 1 else "diagnosis_page.many", count=count)
    return t("diagnosis_page.note", tests=len(d.tests), what=what)


def _head(key: str) -> str:
    return f"<h2>{html.escape(texts()(f'diagnosis_page.{key}'))}</h2>"


def _line(key: str, text: str) -> str:
    return f"<p>{html.escape(texts()(f'diagnosis_page.{key}', text=text))}</p>"


def _row(*keys: str) -> str:
    return f"<tr>{''.join(f'<th>{html.escape(texts()(key))}</th>' for key in keys)}</tr>"


def _tests(d: Diagnosis) -> str:
    after = {t.covariate: t for t in d.tests_after}
    rows = ""
    for t in d.tests:
        late = after.get(t.covariate)
        shares = f"<td>{100 * t.variance_share:.0f}</td><td>{'–' if late is None else f'{100 * late.variance_share:.0f}'}</td>"
        rows += f"<tr><td>{html.escape(covariate(t.covariate))}</td>{shares}<td>{t.p_value:.1g}</td></tr>"
    return f"<table>{_row('table.covariate', 'table.share', 'table.with_causes', 'table.p')}{rows}</table>"


def _short(d: Diagnosis) -> str:
    return as_text(d).split("\n", 1)[0]


def _image(drawn: Any) -> str:
    return f'<img alt="" src="{embedded(drawn)}">'


def _gains(f: Finding) -> str:
    assert f.gain is not None
    rows = [(texts()("diagnosis.fitted"), f.gain.before, f.gain.after)]
    rows += [(_held(name), *pair) for name, pair in f.gain.schemes.items() if name != "facets"]
    body = "".join(f"<tr><td>{html.escape(name)}</td><td>{a * 1e3:.2f}</td><td>{b * 1e3:.2f}</td></tr>" for name, a, b in rows)
    return f"<table>{_row('table.rms_um', 'table.without', 'table.with_it')}{body}</table>"


def _held(scheme: str) -> str:
    t, key = texts(), f"diagnosis.held_{scheme}"
    return t(key) if key in t else t("diagnosis.held", scheme=scheme)


def course(d: Diagnosis) -> Any:
    """diagnosis → residuals over time, before and after, outliers marked."""
    touches = d.before.model.touches
    minutes = touches.time / 60
    out = np.isin(touches.number, d.outliers)
    with styled():
        drawn = figure(9.5, 4.6)
        axes = drawn.subplots(2, 1, sharex=True, sharey=True)
        pairs = (
            (axes[0], d.before.residuals, texts()("diagnosis.present")),
            (axes[1], d.after.residuals, texts()("diagnosis.with_found")),
        )
        for ax, values, title in pairs:
            ax.axhspan(-2e3 * d.noise, 2e3 * d.noise, color=PALE, alpha=0.45, lw=0)
            ax.plot(minutes[~out], 1e3 * values[~out], ".", color=GOOD, ms=4)
            ax.plot(minutes[out], 1e3 * values[out], "x", color=BAD, ms=6)
            ax.set_title(f"{title}: {texts()('table.rms', unit='µm')} {1e3 * float(np.sqrt(np.mean(values**2))):.2f}", loc="left")
            ax.set_ylabel("µm")
        limit = 1.15e3 * float(np.max(np.abs(d.before.residuals[~out]))) if (~out).any() else 1.0
        axes[0].set_ylim(-limit, limit)
        axes[1].set_xlabel(texts()("diagnosis.course_axis"))
    return drawn


def dependence(d: Diagnosis, tests: Sequence[Test]) -> Any:
    """diagnosis, some of its tests → means over their covariates, before and after, with the band of a right model."""
    after = {t.covariate: t for t in d.tests_after}
    rows = -(-len(tests) // COLUMNS)
    with styled():
        drawn = figure(9.5, 2.6 * rows)
        grid = drawn.subplots(rows, COLUMNS, squeeze=False).ravel()
        for ax, t in zip(grid, tests, strict=False):
            x, label = shown_over(d, t)
            order = np.argsort(x)
            ax.fill_between(x[order], -1e3 * t.band[order], 1e3 * t.band[order], color=PALE, alpha=0.5, lw=0)
            ax.plot(x[order], 1e3 * t.mean[order], "o-", color=BAD, ms=3, lw=1, label=texts()("diagnosis.present"))
            if d.after is not d.before and (b := after.get(t.covariate)) is not None:
                ax.plot(x[order], 1e3 * b.mean[order], "o-", color=GOOD, ms=2, lw=1, label=texts()("diagnosis.with_causes"))
            ax.axhline(0, color=INK, lw=0.6)
            ax.set_title(f"{covariate(t.covariate)}: {100 * t.variance_share:.0f} %", loc="left", fontsize=8)
            ax.set_xlabel(label)
            ax.set_ylabel("µm")
        for ax in grid[len(tests) :]:
            ax.set_visible(False)
        if len(tests):
            grid[0].legend(fontsize=7)
    return drawn


def shape(d: Diagnosis, r: Remainder) -> Any:
    """diagnosis, a shape without a name → what is visible of it over each of its covariates, with what is measured."""
    touches = d.before.model.touches
    first = np.arange(len(touches)) if d.rows is None else d.rows.first
    scale = np.ones(len(first)) if d.rows is None else d.rows.scale
    factors = () if r.form is None else r.form.factors
    known = values(touches)
    basis = d.explanation.place.basis
    others = sum((o.pattern for o in d.unexplained if o is not r and len(o.pattern) == len(first)), np.zeros(len(first)))
    measured = basis @ (basis.T @ d.searched(d.after.residuals)) / scale - others
    with styled():
        drawn = figure(9.5, 3.2)
        grid = drawn.subplots(1, len(factors), squeeze=False).ravel()
        for ax, f in zip(grid, factors, strict=True):
            turning = f.covariate in touches.machine.rotary or f.covariate == "S"
            x = np.degrees(known[f.covariate][first]) if turning else known[f.covariate][first]
            ax.plot(x, 1e3 * measured, ".", color=PALE, ms=4, label=texts()("diagnosis.measured"))
            ax.plot(x, 1e3 * r.pattern, ".", color=BAD, ms=4, label=texts()("diagnosis.shape"))
            ax.set_xlabel(f"{covariate(f.covariate)}{', deg' if turning else ''}")
            ax.set_ylabel("µm")
        grid[0].legend(fontsize=7)
    return drawn


def seen(d: Diagnosis, f: Finding) -> Any:
    """diagnosis, finding → what it does over the covariate that it belongs to, with what is measured of it; and the part of it
    that the model without it cannot absorb.
    """
    touches = d.before.model.touches
    about, x, label = covariate_of(d, f)
    maker = d.explanation.place.basis @ d.explanation.place.basis.T
    others = sum((o.pattern for o in d.findings if o is not f), np.zeros(len(touches)))
    visible, rest = maker @ d.searched(f.pattern), maker @ d.searched(d.before.residuals - others)
    whole, what, rows = f.pattern, texts()("diagnosis.early"), np.ones(len(touches), dtype=bool)
    if "direction" in f.detail and f.detail.get("frame") in ("machine", "table"):
        normal = touches.machine_normal if f.detail["frame"] == "machine" else touches.normal
        along = normal @ np.array(f.detail["direction"])
        rows = np.abs(along) > 0.4
        what = towards(np.array(f.detail["direction"]))
        whole = f.pattern / np.where(rows, along, 1.0)
        left_over = d.after.residuals / np.where(rows, along, 1.0)
    else:
        left_over = d.after.residuals
    with styled():
        drawn = figure(9.5, 3.2)
        left, right = drawn.subplots(1, 2)
        order = np.flatnonzero(rows)
        left.plot(x[order], 1e3 * (whole + left_over)[order], ".", color=PALE, ms=4, label=texts()("diagnosis.measured"))
        left.plot(x[order], 1e3 * whole[order], ".", color=BAD, ms=4, label=texts()("diagnosis.explained"))
        left.legend(fontsize=7)
        left.set_title(texts()("diagnosis.seen_left"), loc="left")
        left.set_xlabel(f"{about}, {label}" if label != about else about)
        left.set_ylabel(f"µm, {what}")
        right.plot(1e3 * visible, 1e3 * rest, ".", color=GOOD, ms=4)
        span = 1e3 * float(np.max(np.abs(visible))) or 1.0
        right.plot([-span, span], [-span, span], color=INK, lw=0.8)
        right.set_title(texts()("diagnosis.seen_right"), loc="left")
        right.set_xlabel(texts()("diagnosis.expected", unit="µm"))
        right.set_ylabel(texts()("diagnosis.measured_in", unit="µm"))
    return drawn
