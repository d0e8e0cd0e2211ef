"""A diagnosis → plain data of the format tango-diagnosis/1, and sentences for people."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .. import terms as families
from ..estimate import Estimate
from ..records import Array
from ..texts import joined
from . import Diagnosis, Finding, Test
from ._richer import Richer
from ._size import plain
from .sentences import advice, also, covariate, dropped, few, gain, meaning, moment, nearly, noise, said, unexplained

HIDDEN = 0.1  # visibility
ODD = 1e-3  # chance, over all covariates, below which what is left is no noise alone
SHOWN = 8  # covariates on the terminal
__all__ = ["as_json", "as_text", "effects", "sentence", "telling", "unexplained"]


def as_json(d: Diagnosis) -> dict[str, Any]:
    """diagnosis → plain data of the format tango-diagnosis/1."""
    return {
        "format": "tango-diagnosis/1",
        "verdict": d.verdict,
        "findings": [_finding(f) for f in d.findings],
        "unexplained": [
            {
                "covariate": r.covariate,
                "frame": r.frame,
                "shape": r.shape,
                "amplitude_um": r.amplitude * 1e3,
                "amplitude_std_um": r.std * 1e3,
                "heldout_r2": r.heldout_r2,
                "formula": r.closed,
                "rivals": list(r.rivals),
                "confirm": r.confirm,
                "again": None
                if r.again is None
                else {"name": r.again.name, "times": r.again.times, "agreement": r.again.agreement, "learned": r.again.learned},
                "text": joined("", (unexplained(r), ".")),
            }
            for r in d.unexplained
        ],
        "set_aside": [
            {
                "kind": m.kind,
                "touches": [int(d.before.model.touches.number[i]) for i in (m.first, m.last)],
                "axis": m.axis,
                "amplitude_um": m.amplitude * 1e3,
                "text": joined("", (moment(m), ".")),
            }
            for m in d.events
        ],
        "not_named": [{"why": x.why} | _finding(x.finding) | {"text": joined("", (dropped(x), "."))} for x in d.dropped],
        "visibility": {name: round(value, 4) for name, value in d.visibility.items()},
        "residual_tests": [
            {"covariate": t.covariate, "variance_share": round(t.variance_share, 4), "p_value": t.p_value} for t in d.tests
        ],
        "volume": {
            "rms_before_um": d.volume.before * 1e3,
            "rms_after_um": d.volume.after * 1e3,
            "moved_rms_um": d.volume.moved * 1e3,
            "moved_max_um": d.volume.moved_most * 1e3,
        },
        "outliers": list(d.outliers),
        "richer": None
        if d.richer is None
        else {
            "terms": [plain(t) if isinstance(t, Mapping) else t for t in d.richer.terms],
            "rms_um": d.richer.rms * 1e3,
            "more_parameters": d.richer.more,
        },
        "misnamed": [
            {"touch": m.number, "facet": m.facet, "away_mm": round(m.away, 3), "near": m.near, "set_aside": d.aside}
            for m in d.misnamed
        ],
        "noise_um": d.noise * 1e3,
        "few": d.few,
        "rows": None
        if d.rows is None
        else {"searched": len(d.rows.seen), "touches": len(d.rows.whole), "left_out": d.rows.left_out},
        "scatter": {
            "by": d.scatter.by if d.scatter.clear else None,
            "degrees_of_freedom": d.scatter.tails,
            "memory": round(d.scatter.memory, 3),
            "text": [f"{line}." for line in noise(d.scatter)],
        },
        "terms": [plain(t) if isinstance(t, Mapping) else t for t in d.terms],
        "effects": effects(d),
    }


def effects(d: Diagnosis) -> list[dict[str, Any]]:
    """diagnosis → what was found, as entries of `effects` in world.yaml; what the simulated machine does not have is left out."""
    machine = d.before.model.touches.machine
    found: list[dict[str, Any]] = []
    for f in d.findings:
        if not f.size.values.size and f.cause == families.scattering("facet"):
            spread = np.array([float(f.detail["spread_um"][x]) / 1e3 for x in f.setting["facets"]])
            found += families.effects(f.cause, machine, f.setting, spread)
        elif not f.size.values.size:
            found.append(plain(f.effect))
        else:
            found += [plain(e) for e in families.effects(f.cause, machine, f.setting, f.size.values)]
    return found


def _finding(f: Finding) -> dict[str, Any]:
    gain = None
    if f.gain is not None:
        g = f.gain
        gain = {
            "rms_before_um": g.before * 1e3,
            "rms_after_um": g.after * 1e3,
            "heldout_before_um": g.heldout_before * 1e3,
            "heldout_after_um": g.heldout_after * 1e3,
            "heldout_by": g.scheme,
            "placebo_um": g.placebo * 1e3,
            "nested": g.inside,
            "by": {k: {"before_um": b * 1e3, "after_um": a * 1e3} for k, (b, a) in g.schemes.items()},
        }
    return {
        "cause": f.cause,
        "detail": plain(f.detail),
        "amplitude_um": f.size.amplitude * 1e3,
        "amplitude_std_um": f.size.amplitude_std * 1e3,
        "p_value": f.p_value,
        "gain": gain,
        "parameter_shift": {
            name: {"before": b, "after": a, "in_std": round(s, 2)} for name, (b, a, s) in f.shift.items() if abs(s) > 0.1
        },
        "stability": None if f.stability is None else f.stability.times,
        "subsets": None if f.stability is None else f.stability.of,
        "alternatives": list(dict.fromkeys(a for a, _, _ in f.alternatives)),
        "aliases": [{"setting": plain(setting), "evidence_less": round(behind, 1)} for setting, behind in f.aliases],
        "nearest_shape": None if f.nearest is None else {"covariate": f.nearest[0], "evidence_less": round(f.nearest[1], 1)},
        "separate_with": list(f.separate_with),
        "text": sentence(f),
    }


def sentence(f: Finding) -> str:
    """finding → what a person at the machine reads: what, what it means, what to do."""
    return f"{said(f)}. It means: {meaning(f)}. What to do: {advice(f)}."


def as_text(d: Diagnosis) -> str:
    """diagnosis → what a person reads on the terminal."""
    lines = [_headline(d), ""]
    if d.misnamed and not d.aside:
        m = d.misnamed[0]
        lines += _wrapped(
            f"! {_count(len(d.misnamed), 'touch', 'es')} of {len(d.before.residuals)} were not made at the facet that the readings "
            f"name: touch {m.number} is called facet {m.facet}, but was made {m.away:.0f} mm away from it, {m.beside:.1f} mm from "
            f"where facet {m.near} is touched. So many are no slips: none of them is set aside, and all that follows rests on "
            "them. Correct the names, or the place of the table, and diagnose again.",
            "  ",
        )
    for m in d.misnamed if d.aside else ():
        lines += _wrapped(
            f"! Touch {m.number} is called facet {m.facet} in the readings, but was made {m.away:.0f} mm away from it, "
            f"{m.beside:.1f} mm from where facet {m.near} is touched: it is set aside. Correct the name or leave it out.",
            "  ",
        )
    shown = telling(d)
    if shown:
        lines.append("What is left of the touches is not random. It follows")
        lines += [
            f"  {covariate(t.covariate):52} {100 * t.variance_share:3.0f} % of the variance  {_spark(t.mean)}"
            for t in shown[:SHOWN]
        ]
        lines.append("")
    if d.few is not None:
        lines += [*_wrapped(f"! {few(d.few)}.", "  "), ""]
    for i, f in enumerate(d.findings, 1):
        lines += _wrapped(f"{i}. {f.cause}: {said(f)}.", "   ")
        lines += _wrapped(f"   It means: {meaning(f)}.", "   ")
        lines += _wrapped(f"   What to do: {advice(f)}.", "   ")
        if (brought := gain(f)) is not None:
            lines += _wrapped(f"   Gain: {brought}.", "   ")
        if f.alternatives:
            lines += _wrapped(
                f"   This plan cannot distinguish it from: {', '.join(dict.fromkeys(a for a, _, _ in f.alternatives))}.", "   "
            )
        if f.nearest is not None:
            lines += _wrapped(f"   {nearly(f.nearest)}.", "   ")
        if f.aliases:
            lines += _wrapped(f"   Other settings of it do as well here: {also(f)}.", "   ")
        lines += [line for s in f.separate_with for line in _wrapped(f"   To separate them: {s}.", "     ")]
        lines.append("")
    for event in d.events:
        lines += [*_wrapped(f"! {moment(event)}: set aside. Measure them again.", "  "), ""]
    for r in d.unexplained:
        lines += [*_wrapped(f"? {unexplained(r)}.", "  "), ""]
    for text in dict.fromkeys(map(dropped, d.dropped)):  # two of one cause are not named for one reason
        lines += [*_wrapped(f"– {text}.", "  "), ""]
    if d.rows is not None and not d.rows.all:
        left = f"; {d.rows.left_out} touches are in none of them" if d.rows.left_out else ""
        lines += [
            *_wrapped(
                f"Searched in {len(d.rows.seen)} means of {len(d.rows.whole)} touches that were made alike{left}. What happened "
                "in one night only is seen when that night is diagnosed alone.",
                "  ",
            ),
            "",
        ]
    if d.outliers:
        lines += [
            *_wrapped(_outliers(d.outliers), "  "),
            "",
        ]
    for line in noise(d.scatter):
        lines += [*_wrapped(f"~ {line}.", "  "), ""]
    if d.richer is not None:
        lines += [*_wrapped(_try(d.after, d.richer), "  "), ""]
    if d.after is not d.before:
        lines += _wrapped(_consequences(d), "  ")
        lines += ["", f"Terms of the extended model: {d.terms_text}"]
    hidden = [name for name, value in d.visibility.items() if value < HIDDEN]
    if hidden:
        lines += _wrapped(f"This plan is weak for: {', '.join(hidden)}.", "  ")
    return "\n".join(lines)


def telling(d: Diagnosis) -> list[Test]:
    """diagnosis → covariates that the residuals follow, most telling first: 5 % over all of them (Bonferroni)."""
    return [t for t in d.tests if t.p_value < 0.05 / max(len(d.tests), 1)]


def _wrapped(text: str, indent: str) -> list[str]:
    lead = text[: len(text) - len(text.lstrip())]
    return textwrap.wrap(text.strip(), 118, initial_indent=lead, subsequent_indent=indent, break_on_hyphens=False)


def _consequences(d: Diagnosis) -> str:
    v = d.volume
    shift = d.findings[0].shift if d.findings else {}
    moved = [f"{n} ({s:+.1f})" for n, (_, _, s) in shift.items() if abs(s) > 1][:6]
    text = (
        f"With all of it in the model the tool tip is predicted elsewhere by {v.moved * 1e3:.1f} µm rms in the touched volume, "
        f"{v.moved_most * 1e3:.1f} µm at most"
    )
    return text + (f". Parameters that move, in their standard deviations: {', '.join(moved)}." if moved else ".")


def _try(after: Estimate, better: Richer) -> str:
    left = float(np.sqrt(np.mean(after.residuals**2))) * 1e3
    return (
        f"! Try S4 (--terms S4): it leaves {better.rms * 1e3:.2f} µm rms instead of {left:.2f}, more than its {better.more} "
        "further parameters would by chance. What was found above may only replace error motions that the present model lacks."
    )


def _count(n: int, one: str, plural: str = "s") -> str:
    return f"{n} {one}{plural if n != 1 else ''}"


def _outliers(numbers: Sequence[int]) -> str:
    """numbers of touches → a sentence."""
    *more, last = map(str, numbers)
    return f"Touches {', '.join(more)} and {last} are outliers" if more else f"Touch {last} is an outlier"


def _headline(d: Diagnosis) -> str:
    rms = [float(np.sqrt(np.mean(e.residuals**2))) * 1e3 for e in (d.before, d.after)]
    fall = f"what is left of a touch falls from {rms[0]:.2f} to {rms[1]:.2f} µm rms"
    if d.verdict == "adequate":
        noise = f"the model explains the touches down to their noise ({d.noise * 1e3:.2f} µm)"
        if d.scatter.clear and d.scatter.by and any(t.p_value < ODD / len(d.tests) for t in d.tests):
            return (
                f"adequate, if single touches scatter unevenly by chance: {noise}, with more of it for some than for others. "
                f"What is left depends on the {covariate(d.scatter.by)}. A few touches that were shifted look like that: measure "
                "those again"
            )
        return f"adequate: {noise}"
    if d.after is d.before:
        fall = f"{rms[0]:.2f} µm rms are left of a touch"
    if d.verdict == "explained":
        return f"explained: {_count(len(d.findings), 'cause')}; {fall}, noise {d.noise * 1e3:.2f} µm"
    named = f"{_count(len(d.findings), 'cause')} found, but " if d.findings else ""
    if all(r.shape in ("undecided", "near") for r in d.unexplained):
        return f"unexplained: {named}these touches cannot tell which; {fall}, noise {d.noise * 1e3:.2f} µm"
    return f"unexplained: {named}structure remains that no cause explains; {fall}, noise {d.noise * 1e3:.2f} µm"


def _spark(values: Array) -> str:
    """(b,) → a small picture of up to 24 bars."""
    v = values if len(values) <= 24 else np.interp(np.linspace(0, len(values) - 1, 24), np.arange(len(values)), values)
    span = float(np.ptp(v))
    if not span:
        return ""
    return "".join("▁▂▃▄▅▆▇█"[round(float(7 * (x - v.min()) / span))] for x in v)
