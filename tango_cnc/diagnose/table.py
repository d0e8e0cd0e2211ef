"""`diagnose --table`: the same search for measured data from elsewhere, with causes that any table can have.

One row an observation, in the order of measurement. The present model is linear in given columns. Several responses are
stacked: an effect is then a vector, and its components are tested together.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from ..files.checked import complaint, printable, read_text, rows_of, suggestion
from ..records import Array, InputError
from . import _explain, _gain
from ._candidates import Candidate
from ._catalogue import Chosen

KINDS = ("time", "order", "position", "angle", "category")
MOST_ROWS = 2500
RESOLVED = 2.0  # cycles over the record between two periods
BEAT = 0.1  # part of a frequency within which a second line is the beat of the first, which is not steady
ROUNDING = 1e-9  # part of a column that is left when a model explains it exactly
SERIES = ("harmonic", "polynomial")
CURVE = 3  # of one series along one covariate: more of them follow any curve
WHY = {
    "no gain": "rows that were not fitted do not gain from it",
    "shape": "so many of its kind follow any curve",
}
REFINE = {
    "drift": {"tau": "log"},
    "step": {"at": "order"},
    "periodic": {"period": "wave"},
}


@dataclass(frozen=True)
class Table:
    """n rows of q responses; covariates by name: kind and (n,) values (categories numbered)."""

    response: Array  # (n, q)
    names: tuple[str, ...]
    design: Array  # (n, p), intercept first
    covariates: Mapping[str, tuple[str, Array]]
    labels: Mapping[str, tuple[str, ...]]  # of categories
    group: Array | None


def read_table(file: Path, response: Sequence[str], model: Sequence[str], covariates: Sequence[str], group: str | None) -> Table:
    """CSV file, columns by name, covariates as NAME:KIND → table. Raises InputError for whatever does not fit."""
    lines = read_text(file).splitlines()
    rows = [r for r in rows_of(file, lines) if r]
    if len(rows) < 8:
        raise complaint(file, None, "", f"{max(len(rows) - 1, 0)} rows", "a header and at least seven rows")
    header = [h.strip() for h in rows[0]]
    for i, row in enumerate(rows[1:], 2):
        if len(row) != len(header):
            raise complaint(file, i, "", f"{len(row)} values", f"{len(header)} values, as many as the header names")
    if len(rows) - 1 > MOST_ROWS:
        raise complaint(file, None, "", f"{len(rows) - 1} rows", f"at most {MOST_ROWS}; average or thin them out")

    def column(name: str, option: str) -> list[str]:
        if name not in header:
            raise InputError(
                f"{option}: found {name!r}; allowed: a column of {file} ({printable(', '.join(header))}).{suggestion(name, header)}"
            )
        return [row[header.index(name)].strip() for row in rows[1:]]

    def numbers(name: str, option: str) -> Array:
        result = []
        for i, text in enumerate(column(name, option), 2):
            try:
                value = float(text)
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                raise complaint(file, i, name, repr(text), "a finite number")
            result.append(value)
        return np.array(result)

    known: dict[str, tuple[str, Array]] = {}
    labels: dict[str, tuple[str, ...]] = {}
    for item in covariates:
        name, _, kind = item.partition(":")
        if item == "order":
            name, kind = "order", "order"
        if kind not in KINDS:
            raise InputError(f"--covariate: found {item!r}; allowed: NAME:KIND with KIND one of {', '.join(KINDS)}")
        if kind == "category":
            texts = column(name, "--covariate")
            labels[name] = tuple(dict.fromkeys(texts))
            known[name] = kind, np.array([labels[name].index(t) for t in texts], dtype=float)
        elif kind == "order" and name not in header:
            known[name] = kind, np.arange(1.0, len(rows))
        else:
            values = numbers(name, "--covariate")
            known[name] = kind, np.radians(values) if kind == "angle" else values
    if not known:
        known["order"] = "order", np.arange(1.0, len(rows))
    y = np.column_stack([numbers(name, "--response") for name in response])
    design = np.column_stack([np.ones(len(y)), *(numbers(name, "--model") for name in model)])
    held = None if group is None else _gain.groups_of(column(group, "--group")).astype(float)
    return Table(y, tuple(response), design, known, labels, held)


def pattern(t: Table, cause: str, setting: Mapping[str, Any]) -> Array:
    """table, generic cause with its setting → (n, f) functions. Raises KeyError for a cause that does not exist."""
    names = setting.get("covariates") or (setting["covariate"],)
    x = t.covariates[names[0]][1]
    if cause == "drift":
        since = x - x.min()
        return ((since / (np.ptp(x) or 1)) if setting["shape"] == "linear" else 1 - np.exp(-since / setting["tau"]))[:, None]
    if cause == "step":
        return (np.arange(1, len(x) + 1) >= setting["at"]).astype(float)[:, None]
    if cause == "periodic":
        angle = 2 * np.pi * x / setting["period"]
        return np.column_stack([np.cos(angle), np.sin(angle)])
    if cause == "harmonic":
        return np.column_stack([np.cos(setting["order"] * x), np.sin(setting["order"] * x)])
    if cause == "polynomial":
        u = 2 * (x - x.min()) / (np.ptp(x) or 1) - 1
        return np.polynomial.legendre.legvander(u, setting["degree"])[:, 1:]
    if cause == "cross":
        a, b = (t.covariates[name][1] for name in names)
        return ((a - a.mean()) * (b - b.mean()) / ((a.std() * b.std()) or 1))[:, None]
    change = np.diff(x, prepend=x[:1])
    if cause == "history_sign":
        return np.sign(change)[:, None]
    if cause == "history_length":
        return (np.abs(change) / (np.abs(change).max() or 1))[:, None]
    if cause == "group_offset":
        return (x == setting["level"]).astype(float)[:, None]
    raise KeyError(cause)


def variants(t: Table) -> Iterator[tuple[str, dict[str, Any]]]:
    """table → generic causes with every setting that is tried."""
    n = len(t.response)
    for name, (kind, x) in t.covariates.items():
        span = float(np.ptp(x))
        if kind == "category":
            for level in range(len(t.labels[name])):
                yield "group_offset", {"covariate": name, "level": level}
            continue
        if not span:
            continue
        if kind in ("time", "order"):
            yield "drift", {"covariate": name, "shape": "linear"}
            for tau in np.geomspace(span / 15, 2 * span, 6):
                yield "drift", {"covariate": name, "shape": "exponential", "tau": float(tau)}
            for at in range(4, n - 2):
                yield "step", {"covariate": name, "at": at}
        if kind in ("time", "order", "position"):
            least = float(np.median(np.diff(np.unique(x))))
            for cycles in np.arange(0.75, span / least / 2, 0.3)[: 4 * n]:
                yield "periodic", {"covariate": name, "period": span / float(cycles)}
        if kind == "angle":
            for order in range(1, 9):
                yield "harmonic", {"covariate": name, "order": order}
        if kind == "position":
            for degree in range(1, 6):
                yield "polynomial", {"covariate": name, "degree": degree}
        if kind in ("position", "angle"):
            for cause in ("history_sign", "history_length"):
                yield cause, {"covariate": name}
    places = [name for name, (kind, _) in t.covariates.items() if kind == "position"]
    for pair in combinations(places, 2):
        yield "cross", {"covariates": list(pair)}


def search(t: Table, seed: int = 0) -> tuple[_explain.Explanation, Array, Array, Array]:
    """table → explanation, design (n·q, p·q), data (n·q,) and scale (q,); rows of one response stand together."""
    q, n = t.response.shape[1], len(t.response)
    maker = _gain.residual_maker(t.design)
    dof = float(np.trace(maker))
    scale = np.sqrt(np.sum((maker @ t.response) ** 2, axis=0) / dof)
    scale = np.where(scale > 0, scale, 1.0)
    data: Array = (t.response / scale).T.ravel()
    design: Array = np.asarray(np.kron(np.eye(q), t.design), dtype=float)

    def candidate(cause: str, setting: Mapping[str, Any]) -> Candidate:
        one = pattern(t, cause, setting)
        return Candidate(cause, dict(setting), np.asarray(np.kron(np.eye(q), one), dtype=float))

    every = [candidate(cause, setting) for cause, setting in variants(t)]
    every += [Candidate("outlier", {"touch": i}, np.asarray(np.kron(np.eye(q), np.eye(n)[:, [i]]), dtype=float)) for i in range(n)]
    order = np.arange(1.0, n + 1)
    walk: Array = np.asarray(np.kron(np.eye(q), np.minimum(order[:, None], order[None, :])), dtype=float)

    def compatible(c: Candidate, others: Sequence[Candidate]) -> bool:
        """Two periods closer than the record can resolve, or a tenth of their frequency, are one line that is not steady."""
        if c.cause != "periodic":
            return True
        span = float(np.ptp(t.covariates[c.setting["covariate"]][1]))
        taken = [o.setting["period"] for o in others if o.cause == "periodic" and o.setting["covariate"] == c.setting["covariate"]]
        return all(abs(span / c.setting["period"] - span / p) > max(RESOLVED, BEAT * span / p) for p in taken)

    found = _explain.explain(data, design, n * q, every, [walk], REFINE, candidate, compatible=compatible, steady=True, seed=seed)
    return found, design, data, scale


def diagnose_table(
    file: Path,
    response: Sequence[str],
    model: Sequence[str] = (),
    covariates: Sequence[str] = (),
    group: str | None = None,
    seed: int = 0,
) -> dict[str, Any]:
    """CSV file with its columns → plain data of the format tango-diagnosis/1; lengths are in the unit of the response."""
    return told(read_table(file, response, model, covariates, group), group, seed)


def told(t: Table, group: str | None, seed: int = 0) -> dict[str, Any]:
    """table, name of what its rows are held out by → plain data of the format tango-diagnosis/1.

    Raises InputError where the model leaves nothing.
    """
    left = np.linalg.norm(_gain.residual_maker(t.design) @ t.response, axis=0)
    for label, part, whole in zip(t.names, left, np.linalg.norm(t.response, axis=0), strict=True):
        if part <= ROUNDING * whole:
            raise InputError(
                f"{label}: found a column that the model explains exactly; allowed: one that scatters, as measured ones do"
            )
    found, design, data, scale = search(t, seed)
    n, q = t.response.shape
    single = [int(c.candidate.setting["touch"]) for c in found.chosen if c.candidate.cause == "outlier"]
    keep = np.tile(~np.isin(np.arange(n), single), q)
    held = _gain.blocks(n) if t.group is None else t.group.astype(np.int64)
    name = "blocks" if t.group is None else str(group)
    schemes = {name: np.tile(held, q), "scattered": np.tile(_gain.scattered(n), q)}
    solution, covariance = _explain.values(found, {})
    findings: list[dict[str, Any]] = []
    dropped: list[dict[str, Any]] = []
    start = 0
    for c in found.chosen:
        k = c.columns.shape[1]
        v, cov = solution[start : start + k], covariance[start : start + k, start : start + k]
        start += k
        if c.candidate.cause == "outlier":
            continue
        others = [o.candidate.columns for o in found.chosen if o is not c]
        gain = _gain.measure(
            np.hstack([design, *others]), data, c.candidate.columns, schemes, keep, np.random.default_rng([seed, n])
        )
        (findings if gain.real else dropped).append(_finding(t, found, c, v, cov, scale, gain))
    findings, curved = _curves(findings)
    findings += _spread(t, found)
    walking = found.random[0] > _explain.RANDOM
    remains = [
        {"covariate": name, "frame": "none", "shape": "curve", "amplitude": _together(parts), "heldout_r2": 0.0}
        for name, parts in curved.items()
    ]
    if walking:
        amplitude = found.sigma * float(np.sqrt(found.ratios[0] / found.place.scales[0] * n)) * float(scale.mean())
        remains.append({"covariate": "order", "frame": "none", "shape": "random walk", "amplitude": amplitude, "heldout_r2": 0.0})
    return {
        "format": "tango-diagnosis/1",
        "verdict": "unexplained" if remains else "explained" if findings else "adequate",
        "findings": findings,
        "unexplained": remains,
        "not_named": [
            *({"why": "no gain"} | f for f in dropped),
            *({"why": "shape"} | f for parts in curved.values() for f in parts),
        ],
        "visibility": {k: round(v, 4) for k, v in sorted(found.visibility.items())},
        "outliers": [i + 1 for i in single],
        "rows": n,
        "noise": [float(found.sigma * s) for s in scale],
    }


def _curves(findings: Sequence[dict[str, Any]]) -> tuple[list[dict[str, Any]], dict[str, list[dict[str, Any]]]]:
    """findings → those that stand, and by covariate those that are so many of one series that they follow any curve."""
    series: dict[str, list[dict[str, Any]]] = {}
    for f in findings:
        if f["cause"] in SERIES:
            series.setdefault(f["detail"]["covariate"], []).append(f)
    many = {name: parts for name, parts in series.items() if len(parts) > CURVE}
    return [f for f in findings if not any(f is p for parts in many.values() for p in parts)], many


def _together(findings: Sequence[Mapping[str, Any]]) -> float:
    return float(np.sqrt(sum(f["amplitude"] ** 2 for f in findings)))


def _finding(
    t: Table, found: _explain.Explanation, c: Chosen, v: Array, covariance: Array, scale: Array, gain: _gain.Gain
) -> dict[str, Any]:
    detail = {k: x for k, x in c.candidate.setting.items()}
    q = len(scale)
    each = v.reshape(q, -1) * scale[:, None]
    fitted = (c.candidate.columns @ v).reshape(q, -1) * scale[:, None]
    plain = c.candidate.cause in ("periodic", "harmonic", "step", "group_offset", "history_sign")
    amplitude = float(np.linalg.norm(each)) if plain else float(np.linalg.norm(np.ptp(fitted, axis=1)))
    norm = float(np.linalg.norm(v)) or 1.0
    std = float(np.sqrt(abs(float(v @ covariance @ v)))) / norm * amplitude / norm
    if "level" in detail:
        detail["level"] = t.labels[detail["covariate"]][int(detail["level"])]
    if "tau" in detail:
        detail["tau"] = float(detail["tau"])
    detail["coefficients"] = {name: [float(x) for x in row] for name, row in zip(t.names, each, strict=True)}
    unit = float(scale.mean())
    return {
        "cause": c.candidate.cause,
        "detail": detail,
        "amplitude": amplitude,
        "amplitude_std": std,
        "p_value": _explain.significance(found, c),
        "gain": {
            "rms_before": gain.before * unit,
            "rms_after": gain.after * unit,
            "heldout_before": gain.heldout_before * unit,
            "heldout_after": gain.heldout_after * unit,
            "heldout_by": gain.scheme,
            "placebo": gain.placebo * unit,
        },
        "alternatives": list(dict.fromkeys(o.candidate.cause for o, _ in _explain.alternatives(found, c))),
        "separate_with": [],
    }


def _spread(t: Table, found: _explain.Explanation) -> list[dict[str, Any]]:
    """→ `noise_change` where the size of what is left depends on a covariate (Spearman or Kruskal–Wallis, 1 % over all)."""
    left, own = _explain.rest(found, found.chosen, np.ones(len(found.place.basis)))
    size = np.abs(left) / np.sqrt(np.maximum(own, 0.05))
    q = len(t.names)
    from scipy import stats  # takes a third of a second to load, and few ask for it

    result = []
    single = {int(c.candidate.setting["touch"]) for c in found.chosen if c.candidate.cause == "outlier"}
    keep = np.tile([i not in single for i in range(len(t.response))], q)
    for name, (kind, x) in t.covariates.items():
        long = np.tile(x, q)[keep]
        if np.ptp(long) == 0:
            continue
        s = size[keep]
        if kind in ("category", "angle"):
            member = long if kind == "category" else np.floor(np.mod(long, 2 * np.pi) / (np.pi / 3))
            parts = [s[member == m] for m in np.unique(member) if (member == m).sum() > 3]
            p = float(stats.kruskal(*parts).pvalue) if len(parts) > 1 else 1.0
        else:
            p = float(stats.spearmanr(long, s).pvalue)
        p = min(1.0, p * len(t.covariates))
        if p < 0.01:
            low, high = (float(np.sqrt(np.mean(s[m] ** 2))) for m in (long <= np.median(long), long > np.median(long)))
            result.append(
                {
                    "cause": "noise_change",
                    "detail": {"covariate": name, "spread_low": low, "spread_high": high},
                    "amplitude": abs(high - low),
                    "amplitude_std": 0.0,
                    "p_value": p,
                    "gain": None,
                    "alternatives": [],
                    "separate_with": [],
                }
            )
    return result


def as_text(data: Mapping[str, Any]) -> str:
    """plain data of a table's diagnosis → what a person reads on the terminal."""
    lines = [f"{data['verdict']}: {data['rows']} rows, noise that is left {', '.join(f'{x:.4g}' for x in data['noise'])}"]
    for i, f in enumerate(data["findings"], 1):
        where = ", ".join(
            f"{k} {x:.5g}" if isinstance(x, float) else f"{k} {x}" for k, x in f["detail"].items() if k != "coefficients"
        )
        lines.append(f"{i}. {f['cause']} ({where}): {_size(f['amplitude'], f['amplitude_std'])}, p {f['p_value']:.1g}")
        if f["gain"]:
            g = f["gain"]
            lines.append(
                f"   rms {g['rms_before']:.4g} → {g['rms_after']:.4g}; "
                f"held-out {g['heldout_before']:.4g} → {g['heldout_after']:.4g}"
            )
        if f["alternatives"]:
            lines.append(f"   cannot be distinguished from: {', '.join(f['alternatives'])}")
    lines += [f"– {f['cause']} along {_along(f['detail'])} fits, but {WHY[f['why']]}: not named" for f in data["not_named"]]
    lines += [f"? {r['shape']} along {r['covariate']}: about {r['amplitude']:.4g}" for r in data["unexplained"]]
    if data["outliers"]:
        lines.append(f"outliers: rows {', '.join(map(str, data['outliers']))}")
    return "\n".join(lines)


def _size(amplitude: float, std: float) -> str:
    """size and its standard deviation → both, or about how much where it is not known to half of itself."""
    return f"{amplitude:.4g} ± {std:.2g}" if 0 < std < amplitude / 2 else f"about {amplitude:.1g}"


def _along(detail: Mapping[str, Any]) -> str:
    return str(detail["covariate"]) if "covariate" in detail else " × ".join(detail["covariates"])
