"""A diagnosis → plain data of the format tango-diagnosis/1, and sentences for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .. import terms as families
from ..records import Array
from . import Diagnosis, Finding, Remainder
from ._size import plain


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
                "heldout_r2": r.heldout_r2,
            }
            for r in d.unexplained
        ],
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
        "noise_um": d.noise * 1e3,
        "terms": [plain(t) if isinstance(t, Mapping) else t for t in d.terms],
        "effects": effects(d),
    }


def effects(d: Diagnosis) -> list[dict[str, Any]]:
    """diagnosis → what was found, as entries of `effects` in world.yaml; what the simulated machine does not have is left out."""
    machine = d.before.model.touches.machine
    found: list[dict[str, Any]] = []
    for f in d.findings:
        if not f.size.values.size and f.cause == "surface_form":
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
        "alternatives": list(dict.fromkeys(a for a, _, _ in f.alternatives)),
        "separate_with": list(f.separate_with),
        "text": sentence(f),
    }


def sentence(f: Finding) -> str:
    """finding → what a person at the machine reads."""
    module = families.causes()[f.cause]
    size = f"{f.size.amplitude * 1e3:.1f} ± {f.size.amplitude_std * 1e3:.1f} µm"
    return f"{module.TEXT}: {size}{_how(f)}. What to do: {module.ADVICE}."


def _how(f: Finding) -> str:
    d = f.detail
    said = []
    if "axis" in d:
        said.append(f"axis {d['axis']}")
    if "name" in d:
        said.append(str(d["name"]))
    if "direction" in d:
        said.append(f"{_towards(np.array(d['direction']))} ({d.get('frame', 'machine')} frame)")
    if "tau_s" in d and d.get("shape") == "exponential":
        said.append(f"two thirds of it after {float(d['tau_s']) / 60:.0f} min, then it settles")
    if d.get("shape") == "linear" and "tau_s" in d:
        said.append("an hour, steadily")
    if "order" in d:
        said.append(f"order {d['order']}")
    if "period_s" in d:
        said.append(f"every {float(d['period_s']) / 60:.1f} min")
    if "period_mm" in d:
        said.append(f"every {float(d['period_mm']):.2f} mm")
    if "at" in d and "time_s" in d:
        said.append(f"from touch {d['at']} on ({float(d['time_s']) / 60:.0f} min)")
    if "facet" in d:
        said.append(f"facet {d['facet']}")
    if "facets" in d:
        said.append("facets " + ", ".join(str(x) for x in d["facets"]))
    return (", " if said else "") + ", ".join(said)


def _towards(v: Array) -> str:
    """unit vector → its main direction in words."""
    strong = [f"{'+' if x > 0 else '−'}{c}" for c, x in zip("XYZ", v, strict=True) if abs(x) > 0.35]
    return "towards " + " ".join(strong)


def as_text(d: Diagnosis) -> str:
    """diagnosis → what a person reads on the terminal."""
    lines = [_headline(d), ""]
    shown = [t for t in d.tests if t.p_value < 0.01][:6]
    if shown:
        lines.append("The residuals are not random. They follow")
        for t in shown:
            lines.append(
                f"  {t.covariate:22} {100 * t.variance_share:4.0f} % of their variance   p {t.p_value:.1g}  {_spark(t.mean)}"
            )
        lines.append("")
    for i, f in enumerate(d.findings, 1):
        lines.append(f"{i}. {f.cause}: {sentence(f)}")
        if f.gain is not None:
            g = f.gain
            lines.append(
                f"   gain: rms {g.before * 1e3:.2f} → {g.after * 1e3:.2f} µm; on held-out {g.scheme} "
                f"{g.heldout_before * 1e3:.2f} → {g.heldout_after * 1e3:.2f} µm (chance of a coincidence {f.p_value:.1g})"
            )
        moved = [(n, s) for n, (_, _, s) in f.shift.items() if abs(s) > 1][:5]
        if moved:
            lines.append("   it moves " + ", ".join(f"{n} by {s:+.1f} of its standard deviations" for n, s in moved))
        if f.alternatives:
            lines.append("   cannot be told from: " + ", ".join(dict.fromkeys(a for a, _, _ in f.alternatives)))
            lines += [f"   to tell: {s}" for s in f.separate_with]
    lines += [f"? {unexplained(r)}" for r in d.unexplained]
    if d.outliers:
        lines.append(f"{len(d.outliers)} single touches fit nothing: {', '.join(map(str, d.outliers[:12]))}")
    if d.findings:
        v = d.volume
        lines.append(
            f"predicted error of the tool tip in the touched volume: rms {v.before * 1e3:.1f} → {v.after * 1e3:.1f} µm; "
            f"the two predictions differ by {v.moved * 1e3:.1f} µm rms, {v.moved_most * 1e3:.1f} µm at most"
        )
        lines += ["", f"terms of the extended model: {d.terms_text}"]
    hidden = [name for name, value in d.visibility.items() if value < 0.1]
    if hidden:
        lines.append(f"hardly visible to this plan: {', '.join(hidden)}")
    return "\n".join(lines)


def unexplained(r: Remainder) -> str:
    """remainder → a sentence."""
    where = f", {r.frame}" if r.frame not in ("", "none") else ""
    return f"nothing in the catalogue explains what follows {r.covariate}{where} ({r.shape}): {r.amplitude * 1e3:.1f} µm"


def _headline(d: Diagnosis) -> str:
    rms = [float(np.sqrt(np.mean(e.residuals**2))) * 1e3 for e in (d.before, d.after)]
    if d.verdict == "adequate":
        return f"adequate: the model explains the touches down to their noise ({d.noise * 1e3:.2f} µm)"
    if d.verdict == "explained":
        return f"explained: {len(d.findings)} cause(s); residual rms {rms[0]:.2f} → {rms[1]:.2f} µm, noise {d.noise * 1e3:.2f} µm"
    return f"unexplained: structure remains that no cause explains; residual rms {rms[0]:.2f} → {rms[1]:.2f} µm"


def _spark(values: Array) -> str:
    """(b,) → a small picture of up to 24 bars."""
    v = values if len(values) <= 24 else np.interp(np.linspace(0, len(values) - 1, 24), np.arange(len(values)), values)
    span = float(np.ptp(v))
    if not span:
        return ""
    return "".join("▁▂▃▄▅▆▇█"[round(float(7 * (x - v.min()) / span))] for x in v)
