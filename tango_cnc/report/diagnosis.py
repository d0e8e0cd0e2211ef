"""A diagnosis → one HTML page with pictures that a machinist understands (matplotlib, the optional extra `report`)."""

from __future__ import annotations

import html
from typing import Any

import numpy as np

from ..diagnose import Diagnosis, Finding, Test
from ..diagnose.words import as_text, sentence, unexplained
from ..records import Array
from .pictures import BAD, GOOD, INK, PALE, embedded, figure, styled

UNITS = {"time": "min", "order": "touch", "indexation": "indexation", "facet": "facet (order of the artefact)"}

HEAD = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Diagnosis</title><style>
body{font:15px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#1f2933}
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}img{max-width:100%}pre{background:#f4f6f8;padding:1rem;overflow:auto}
.verdict{padding:.6rem 1rem;border-left:.4rem solid;background:#f4f6f8;font-size:1.1rem}
.adequate{border-color:#2e7d32}.explained{border-color:#1b6ca8}.unexplained{border-color:#c0392b}
td,th{padding:.2rem .8rem;text-align:right}td:first-child,th:first-child{text-align:left}</style></head><body>"""


def page(d: Diagnosis) -> str:
    """diagnosis → HTML that stands alone. Raises InputError when matplotlib is not installed."""
    machine = html.escape(d.before.model.touches.machine.name)
    parts = [HEAD, f"<h1>Diagnosis of {machine}</h1>", f'<p class="verdict {d.verdict}">{html.escape(_short(d))}</p>']
    parts += ["<h2>What is left of the model, touch by touch</h2>", _image(course(d))]
    if d.tests:
        parts += [
            "<h2>What it depends on</h2>",
            "<p>Means of groups of touches; the grey band holds them when the model is right.</p>",
        ]
        parts.append(_image(dependence(d)))
    for i, f in enumerate(d.findings, 1):
        parts += [f"<h2>{i}. {html.escape(f.cause.replace('_', ' '))}</h2>", f"<p>{html.escape(sentence(f))}</p>"]
        if f.pattern.any():
            parts.append(_image(seen(d, f)))
        if f.gain is not None:
            parts.append(_gains(f))
        if f.alternatives:
            names = ", ".join(dict.fromkeys(a for a, _, _ in f.alternatives))
            parts.append(f"<p>This plan cannot tell it from {html.escape(names)}.</p>")
            parts += [f"<p>{html.escape(s)}</p>" for s in f.separate_with]
    for r in d.unexplained:
        parts.append(f"<h2>Not explained</h2><p>{html.escape(unexplained(r))}.</p>")
    parts += ["<h2>The same in words</h2>", f"<pre>{html.escape(as_text(d))}</pre>", "</body></html>\n"]
    return "\n".join(parts)


def _short(d: Diagnosis) -> str:
    return as_text(d).split("\n", 1)[0]


def _image(drawn: Any) -> str:
    return f'<img alt="" src="{embedded(drawn)}">'


def _gains(f: Finding) -> str:
    assert f.gain is not None
    rows = [("fitted touches", f.gain.before, f.gain.after)]
    rows += [(f"held-out {name}", *pair) for name, pair in f.gain.schemes.items() if name != "facets"]
    body = "".join(f"<tr><td>{name}</td><td>{a * 1e3:.2f}</td><td>{b * 1e3:.2f}</td></tr>" for name, a, b in rows)
    return f"<table><tr><th>rms, µm</th><th>without</th><th>with it</th></tr>{body}</table>"


def course(d: Diagnosis) -> Any:
    """diagnosis → residuals over time, before and after, outliers marked."""
    touches = d.before.model.touches
    minutes = touches.time / 60
    out = np.isin(touches.number, d.outliers)
    with styled():
        drawn = figure(9.5, 4.6)
        axes = drawn.subplots(2, 1, sharex=True, sharey=True)
        pairs = ((axes[0], d.before.residuals, "present model"), (axes[1], d.after.residuals, "with the causes found"))
        for ax, values, title in pairs:
            ax.axhspan(-2e3 * d.noise, 2e3 * d.noise, color=PALE, alpha=0.45, lw=0)
            ax.plot(minutes[~out], 1e3 * values[~out], ".", color=GOOD, ms=4)
            ax.plot(minutes[out], 1e3 * values[out], "x", color=BAD, ms=6)
            ax.set_title(f"{title}: rms {1e3 * float(np.sqrt(np.mean(values**2))):.2f} µm", loc="left")
            ax.set_ylabel("µm")
        limit = 1.15e3 * float(np.max(np.abs(d.before.residuals[~out]))) if (~out).any() else 1.0
        axes[0].set_ylim(-limit, limit)
        axes[1].set_xlabel("time, min (band: two standard deviations of the noise that is left)")
    return drawn


def dependence(d: Diagnosis) -> Any:
    """diagnosis → means over the six covariates that matter most, before and after."""
    tests = d.tests[:6]
    after = {t.covariate: t for t in d.tests_after}
    with styled():
        drawn = figure(9.5, 5.2)
        grid = drawn.subplots(2, 3).ravel()
        for ax, t in zip(grid, tests, strict=False):
            x, label = _shown(t)
            order = np.argsort(x)
            ax.fill_between(x[order], -1e3 * t.band[order], 1e3 * t.band[order], color=PALE, alpha=0.5, lw=0)
            ax.plot(x[order], 1e3 * t.mean[order], "o-", color=BAD, ms=3, lw=1, label="present model")
            if (b := after.get(t.covariate)) is not None:
                ax.plot(x[order], 1e3 * b.mean[order], "o-", color=GOOD, ms=2, lw=1, label="with the causes")
            ax.axhline(0, color=INK, lw=0.6)
            ax.set_title(f"{t.covariate}: {100 * t.variance_share:.0f} % of the variance", loc="left")
            ax.set_xlabel(label)
            ax.set_ylabel("µm")
        for ax in grid[len(tests) :]:
            ax.set_visible(False)
        grid[0].legend(fontsize=7)
    return drawn


def _shown(t: Test) -> tuple[Array, str]:
    if t.covariate == "time":
        return t.centre / 60, "min"
    if t.covariate in ("A", "B", "C", "S"):
        return np.degrees(t.centre), "deg"
    return t.centre, UNITS.get(t.covariate, "mm" if t.covariate in ("X", "Y", "Z") else t.covariate)


def seen(d: Diagnosis, f: Finding) -> Any:
    """diagnosis, finding → its pattern beside what the model without it leaves, over the covariate that it belongs to."""
    touches = d.before.model.touches
    covariate, x, label = _covariate(d, f)
    maker = d.explanation.place.basis @ d.explanation.place.basis.T
    visible = maker @ f.pattern
    rest = maker @ (d.before.residuals - sum((o.pattern for o in d.findings if o is not f), np.zeros(len(touches))))
    with styled():
        drawn = figure(9.5, 3.2)
        left, right = drawn.subplots(1, 2)
        left.plot(x, 1e3 * f.pattern, ".", color=BAD, ms=4)
        left.set_title("what it does to each touch", loc="left")
        left.set_xlabel(f"{covariate}, {label}" if label != covariate else covariate)
        left.set_ylabel("µm, + = read too early")
        right.plot(1e3 * visible, 1e3 * rest, ".", color=GOOD, ms=4)
        span = 1e3 * float(np.max(np.abs(visible))) or 1.0
        right.plot([-span, span], [-span, span], color=INK, lw=0.8)
        right.set_title("the part that the model cannot absorb", loc="left")
        right.set_xlabel("expected, µm")
        right.set_ylabel("measured, µm")
    return drawn


def _covariate(d: Diagnosis, f: Finding) -> tuple[str, Array, str]:
    touches = d.before.model.touches
    name = str(f.setting.get("by") or f.setting.get("axis") or "")
    if not name and "name" in f.setting:
        name = str(f.setting["name"])[2]
    if f.cause in ("scale_drift", "move_length_memory") or name not in touches.machine.names:
        if f.cause in ("probe_lobing", "pretravel_anisotropy", "spindle_orientation"):
            n = touches.spindle_normal
            return "direction of the touch around the probe", np.degrees(np.arctan2(n[:, 1], n[:, 0])), "deg"
        return "time", touches.time / 60, "min"
    values = touches.axis(name)
    return (name, values, "mm") if name in touches.machine.linear else (name, np.degrees(values), "deg")
