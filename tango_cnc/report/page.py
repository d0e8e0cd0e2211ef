"""Facts → one HTML page that stands alone: verdict, what to do, pictures, every number with its interval, and the audit trail."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from ..diagnose.sentences import advice, cause_name, covariate, dropped, meaning, said, unexplained
from ..records import Array, Machine
from ..texts.handed import page_of_cell
from ..verify.summary import pose_text
from . import charts, slices
from .answer import dates_cut_off
from .audit import audit, made_of, source
from .checks import verdict
from .course import course
from .days import at, day
from .decimals import decimals_of_page
from .drawings import drawing
from .facts import Facts, effects
from .figures import iso, iso_at, not_seen, uncertainty, withheld
from .later import after, no_after, yes_after
from .may import Told, grown, may, parts_first
from .orders import by_night
from .plain import digits, office, shop, tilt, to_type, value_text
from .states import as_probed, of_night, since_then
from .template import environment, rendered
from .texts import Texts, code, texts, texts_of
from .units import Units, shown
from .verdict import Check, Verdict, worst_of
from .words import spoken

LARGEST = 8
INTERVAL = 1.96  # standard deviations of the band of a trend


def render(f: Facts, folder: Path | None = None, values: Mapping[str, Any] | None = None) -> str:
    """facts, folder of a shop's templates or None, `context` where it was made before → HTML."""
    t = texts_of(folder)
    page = rendered(environment(folder), "report.html", values or context(f, t))
    return decimals_of_page(page_of_cell(page, f.cell.folder.resolve().name), t)


def context(f: Facts, t: Texts | None = None) -> dict[str, Any]:
    """facts, texts → every value that a template of the report can use; pictures are finished SVG."""
    t = t or texts()
    u, machine = f.wishes.units, f.cell.machine
    found = verdict(f, t)
    trust = worst_of([c for c in found.checks if c.trust])
    said = may(f, t)
    told = said.answer
    unjudged = told.may == "unknown"  # for want of a limit, though no number is wrong
    open_checks = [c for c in found.checks if c.level != "good" or (unjudged and c.name == "limit")]
    # Of numbers that nobody may use nothing follows for the machine: its limit waits until they can be used.
    # A cause that was found comes before what a large scatter asks for by itself.
    open_checks.sort(key=lambda c: not (c.name == "diagnosis" and f.diagnosis is not None and f.diagnosis.findings))
    do = [line for c in open_checks if c.trust or trust.level != "stop" for line in _todo(c, f, said, t)]
    do = parts_first(told, [x for x in (*_first(f, said, t), *do) if x], t)
    data = charts.turning(f, t)
    words = {key: t(f"volume.{key}") for key in ("scale", "hatched")}
    values = {
        "t": t,
        "f": f,
        "units": u,
        "machine": machine,
        "date": at(f.paper.made.isoformat(), t),
        "simulated": f.paper.simulated,
        "source": source(f, t),
        "made_of": made_of(f, t),
        "verdict": found,
        "sentence": sentence(found, t, f.judgement.untrusted),
        "may": told,
        "state": told.short(t),
        "basis": said.basis,
        "cause": said.cause,
        "run": said.run,
        "trust": trust,
        "trusted": sentence(trust, t, f.judgement.untrusted),
        "since_then": " ".join(x for x in (as_probed(f, t), since_then(f, t)) if x),
        "todo": list(dict.fromkeys(shop(text, t) for text in do)),
        "office": to_type([line for text in do if (line := office(text, t))], f.cell.folder.resolve().name, t),
        "largest": parameters(f, t, most=LARGEST),
        "parameters": parameters(f, t),
        "setup": _setup(f, t),
        "fit": _fit(f, t),
        "flagged": _flagged(f),
        "turning": data,
        "still": _safe(charts.still(data)),
        "touches": _safe(charts.touches(f, t)),
        "predicts": _predicts(f, t),
        "predicted": _safe(charts.predicted(f, t)),
        "volume": _volume(f, t),
        "slices": _safe(slices.picture(f.cuts, machine, u, words)) if f.cuts else "",
        "diagnosis": _diagnosis(f, t),
        "motions": [_safe(s) for s in charts.motions(f, t)],
        "iso": iso(f, t),
        "iso_at": iso_at(f, t),
        "unseen": [*(t.of(text) for text in not_seen(f)), *withheld(f, t)],
        "uncertainty": uncertainty(f, t),
        "trend": _trend(f, t),
        "compensations": [of_compensation(c, u, t) for c in f.compensations],
        "audit": audit(f, t),
        "pictures": f.wishes.pictures,
        "files": f.paper.files,
    }
    return values if f.wishes.pictures else values | _bare(values)


def _first(f: Facts, said: Told, t: Texts) -> list[str]:
    """facts, answer, texts → what to do before what the checks ask for: about parts, whom to call, and what to look for."""
    before, more = _of_nights(f, said, t)[:-1], []
    if f.nights is not None and not said.by_night and after(f, said):  # as the pages of the machine have it
        own = f.nights.parts if no_after(f, said) else (t("morning.parts_first"),)
        more = [x for x in (f.nights.asks, *own) if x not in before]
    return [*before, *more, since_then(f, t, "todo.grown") if grown(f) else ""]


def _of_nights(f: Facts, said: Told, t: Texts) -> list[str]:
    """facts, answer, texts → what the nights ask for, as on the page of the machine; the last of it is about what is wrong."""
    if f.nights is None or said.answer.may == "yes":
        return []
    every, probed = (t(key) for key in ("morning.parts_first", "may.brief_probe"))
    todo = [every if x == probed and grown(f) else x for x in f.nights.todo]  # newer readings show more than the probe
    todo = by_night(todo, t) if said.answer.again else todo
    return [x for x in todo if said.by_night or x != t("morning.old_todo")]  # these readings have measured it


def _todo(c: Check, f: Facts, said: Told, t: Texts) -> list[str]:
    """check, facts, answer, texts → what to do about it; what is wrong stands in front, where the first box does not name it."""
    if c.name == "nights" and f.nights is not None and (own := _of_nights(f, said, t)):
        share = f.nights.share and said.by_night  # a share is no change: its sentence names its number already
        cause = "" if share or f.nights.named else f.nights.brief or f.nights.cause
        known = cause == said.cause and not grown(f)  # else another order stands between: "this axis" would be of that one
        return [x for x in (f"{'' if known else cause} {own[-1]}".strip(), c.todo) if x]
    if c.name == "diagnosis" and f.diagnosis is not None and f.diagnosis.findings:
        return [f"{_capital(t.of(cause_name(f.diagnosis.findings[0].cause)))}: {c.todo}"]
    if c.name == "limit" and c.todo and said.cause and not said.by_night:
        return [c.todo if no_after(f, said) and grown(f) else f"{said.cause} {c.todo}"]  # what has moved is named already
    return [c.todo] if c.todo else []


def _bare(values: Mapping[str, Any]) -> dict[str, Any]:
    """values of a template → those that hold pictures, without them."""
    diagnosis = {**values["diagnosis"], **({} if values["diagnosis"]["none"] else {"course": [], "dependence": []})}
    trend = [{**x, "picture": ""} for x in values["trend"]]
    nothing: dict[str, Any] = dict.fromkeys(("still", "touches", "predicted", "slices"), "")
    return nothing | {"turning": None, "motions": [], "trend": trend, "diagnosis": diagnosis}


def _safe(svg: str) -> Markup:
    """SVG of this program, whose texts are escaped where it is made → left as it is by the templates."""
    return Markup(svg)


def sentence(found: Verdict, t: Texts, untrusted: Sequence[str] = ()) -> str:
    """verdict, texts, parameters that must not be used → what the top of the page says."""
    names = ", ".join(untrusted)
    if found.worst is None:
        return t("verdict.good_but", names=names) if names else t("verdict.good")
    why = found.worst.text
    if found.worst.said:
        return t(found.worst.said, why=why)
    if not found.worst.trust:
        return t("verdict.limit", why=why)
    said = t(f"verdict.{found.level}", why=why)
    return f"{said.rstrip('.')}. {t('verdict.not_these', names=names)}" if names and found.level == "look" else said


def parameters(f: Facts, t: Texts, most: int | None = None) -> list[dict[str, Any]]:
    """facts, texts, how many of those that differ from zero (None: all) → rows of the table, largest effect first."""
    size, own, u = effects(f.result), f.result.parameters, f.wishes.units
    by_name = {f.result.selection.label(name): float(s) for name, s in zip(f.result.model.names, f.std, strict=True)}
    untrusted = f.judgement.untrusted
    rows: list[dict[str, Any]] = []
    for name in size:
        p = own[name]
        factor, unit = u.coefficient(p.unit)
        value, std = p.value * factor, by_name[name] * abs(factor)
        half = f.factor * std
        if most is not None and (abs(value) <= half or len(rows) >= most):
            continue
        rows.append(
            {
                "name": name,
                "what": spoken(name, f.cell.machine, t),
                "drawing": _safe(drawing(name, f.cell.machine)),
                "plain": tilt(p.value * shown(p.unit)[0], u, t) if shown(p.unit)[1] in ("µrad", "µm/m") else "",
                "value": value_text(value, std),
                "night": of_night(f, name, t),
                "low": value_text(value - half, std),
                "high": value_text(value + half, std),
                "unit": unit,
                "effect": f"{size[name] * u.per_micron:.2f}",
                "share": size[name],
                "weak": abs(value) <= half,
                "untrusted": name in untrusted,
                "numbers": (value, half),
            }
        )
    span: dict[str, float] = {}
    for row in rows:
        value, half = row["numbers"]
        span[row["unit"]] = max(span.get(row["unit"], 0.0), abs(value) + half)
    for row in rows:
        value, half = row.pop("numbers")
        row["number"], row["half"] = value, half
        row["bar"] = _safe(charts.interval(value, half, span[row["unit"]]))
    return rows


def _setup(f: Facts, t: Texts) -> list[dict[str, str]]:
    u = f.wishes.units
    rows: list[dict[str, str]] = []
    std = dict(zip(f.result.model.names, f.std, strict=False))
    for name, p in f.result.setup.items():
        factor, unit = u.coefficient(p.unit)
        s = float(std.get(name, p.std)) * factor
        rows.append({"name": name, "value": value_text(p.value * factor, s), "half": f"{f.factor * s:.{digits(s)}f}", "unit": unit})
    k = 1e3 * u.per_micron
    for facet, p in f.result.facets.items():
        s = p.std * k
        text = {"value": value_text(p.value * k, s), "half": f"{f.factor * s:.{digits(s)}f}", "unit": u.small}
        rows.append({"name": f"{t('table.facet')} {facet}", **text})
    return rows


def _fit(f: Facts, t: Texts) -> list[str]:
    k = 1e3 * f.wishes.units.per_micron
    size, unit = np.abs(f.result.residuals) * k, f.wishes.units.small
    indexations = int(f.result.model.touches.indexation.max()) + 1
    return [
        t(
            "fit.before",
            before=f"{float(np.abs(f.before).mean()) * k:.1f}",
            after=f"{size.mean():.2f}",
            max=f"{size.max():.2f}",
            rms=f"{np.sqrt(np.mean(size**2)):.2f}",
            unit=unit,
        ),
        t(
            "fit.counts",
            touches=f.used,
            indexations=indexations,
            unknowns=len(f.result.values),
            dof=f.result.dof,
            condition=f"{f.result.condition_number:,.0f}",
        ),
    ]


def _pose(f: Facts, position: Array) -> str:
    """facts, (k,) mm rad → the pose in words, lengths in the unit of the report."""
    linear = [f.cell.machine.column(name) for name in f.cell.machine.linear]
    shown = np.array(position, dtype=float)
    shown[linear] *= f.wishes.units.per_mm
    return pose_text(f.cell.machine, shown)


def _flagged(f: Facts) -> list[dict[str, str]]:
    m, k = f.result.model.touches, 1e3 * f.wishes.units.per_micron
    rows = []
    for i in np.flatnonzero(f.result.out)[:30]:
        at = _pose(f, m.position[i])
        rows.append({"touch": str(m.number[i]), "facet": m.facet[i], "where": at, "residual": f"{f.result.residuals[i] * k:.2f}"})
    return rows


def _predicts(f: Facts, t: Texts) -> list[str]:
    if f.held is None:
        return [t("check.predicts_none", why=f.why_not_held)]
    k, unit, figures = 1e3 * f.wishes.units.per_micron, f.wishes.units.small, f.held.figures
    lines = [
        t(
            "predicts.said",
            count=figures.count,
            sd=f"{figures.sd * k:.2f}",
            worst=f"{figures.worst * k:.2f}",
            ratio=f"{f.held.ratio:.2f}",
            unit=unit,
        )
    ]
    return lines + ([t("predicts.facets", facets=", ".join(f.held.unpredictable))] if f.held.unpredictable else [])


def _volume(f: Facts, t: Texts) -> dict[str, Any]:
    chart, k = f.chart, 1e3 * f.wishes.units.per_micron
    if chart is None:
        return {"rows": [], "notes": [t("volume.none")]}
    rows = []
    if f.tip is not None:
        text = f"{f.tip.worst * k:.1f} ± {f.factor * f.tip.std * k:.1f}"
        rows.append({"where": t("volume.corners"), "largest": text, "std": f"{f.tip.std * k:.1f}", "at": ""})
    for key, mask in (("touched", ~chart.extrapolated), ("rest", chart.extrapolated)):
        i = chart.worst(mask)
        if i is not None:
            size, std = chart.size[i] * k, chart.std[i] * k
            rows.append(
                {
                    "where": t(f"volume.{key}"),
                    "largest": f"{size:.1f} ± {f.factor * std:.1f}",
                    "std": f"{chart.std[mask].max() * k:.1f}",
                    "at": _pose(f, chart.position[i]),
                }
            )
    unseen = ", ".join(c.names[0] for c in f.result.selection.unseen)
    return {"rows": rows, "notes": [t("volume.note"), *([t("volume.unseen", names=unseen)] if unseen else [])]}


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _held_out(scheme: str, t: Texts) -> str:
    """scheme of held-out touches, texts → its name."""
    key = f"diagnosis.held_{scheme}"
    return t(key) if key in t else t("diagnosis.held", scheme=scheme)


def _diagnosis(f: Facts, t: Texts) -> dict[str, Any]:
    d, u = f.diagnosis, f.wishes.units
    unit, k = u.small, 1e3 * u.per_micron
    if d is None:
        return {"none": t("diagnosis.none", why=f.why_no_diagnosis)}
    findings = []
    for x in d.findings:
        twins = ", ".join(t.of(cause_name(a)) for a in dict.fromkeys(a for a, _, _ in x.alternatives))
        rows = []
        if x.gain is not None:
            pairs = [(t("diagnosis.fitted"), x.gain.before, x.gain.after)]
            pairs += [(_held_out(name, t), *both) for name, both in x.gain.schemes.items() if name != "facets"]
            rows = [(name, f"{k * a:.2f}", f"{k * b:.2f}") for name, a, b in pairs]
        findings.append(
            {
                "cause": _capital(t.of(cause_name(x.cause))),
                "said": f"{_capital(u.sentence(t.of(said(x))))}.",
                "means": t("diagnosis.means", text=u.sentence(t.of(meaning(x)))),
                "todo": t("diagnosis.todo", text=u.sentence(t.of(advice(x)))),
                "pictures": [_safe(s) for s in charts.finding(d, x, t, unit, k)],
                "gain": rows,
                "twins": t("diagnosis.twins", names=twins) if twins else "",
                "tell": [t("diagnosis.tell", text=s) for s in x.separate_with] if twins else [],
            }
        )
    return {
        "none": "",
        "verdict": d.verdict,
        "findings": findings,
        "course": [_safe(s) for s in charts.course(d, t, unit, k)],
        "dependence": [_safe(s) for s in charts.dependence(d, t, unit, k)],
        "note": t("diagnosis.depends_note", count=len(d.tests)),
        "unexplained": [f"{_capital(u.sentence(t.of(unexplained(r))))}." for r in d.unexplained],
        "dropped": [f"{_capital(u.sentence(t.of(dropped(x))))}." for x in {dropped(x): x for x in d.dropped}.values()],
        "richer": t("diagnosis.richer") if d.richer is not None else "",
        "names": [t.of(covariate(x.covariate)) for x in d.tests],
    }


def _trend(f: Facts, t: Texts) -> list[dict[str, Any]]:
    if not f.trend:
        return []
    u, drawn = f.wishes.units, []
    for series in f.trend["series"]:
        factor, unit = u.of(series["unit"])
        points = {**series, "value": np.array(series["value"]) * factor, "half": np.array(series["half"]) * factor}
        points["title"] = titled(series["title"], f.cell.machine, t)
        points["limit"] = None if series.get("limit") is None else float(series["limit"]) * factor
        jumps = [(place, size * factor) for place, size in series.get("jumps") or ()]
        days, std = np.array(series["days"], dtype=float), points["half"] / INTERVAL
        said = course(series["first"], days, points["value"], std, jumps, points["limit"], unit, t, series.get("drift"))
        drawn.append({"picture": _safe(charts.trend(points, unit, t)), "said": f"{points['title']}: {said}"})
    return drawn


def titled(name: str, machine: Machine | None, t: Texts) -> str:
    """parameter, machine, texts → what it is, in front of its symbol."""
    what = spoken(name, machine, t)
    return name if what == name else f"{what[:1].upper()}{what[1:]} ({name})"


def of_compensation(c: Mapping[str, Any], u: Units, t: Texts) -> dict[str, Any]:
    """what is on record of a compensation, units, texts → the same as a page shows it: numbers, bars, state, date."""
    sizes = [(name, [None if v is None else float(v) * u.per_micron for v in values]) for name, *values in c["rows"]]
    named = [(t(f"compensation.{name}", unit=u.small), values) for name, values in sizes]
    rows = [(name, *("–" if v is None else f"{v:.1f}" for v in values)) for name, values in named]
    what = [t(f"compensation.{key}") for key in ("before", "promised", "after")]
    date, figures = day(c["date"], t), {key: f"{float(c[key]) * u.per_micron:.1f} {u.small}" for key in ("left",) if c.get(key)}
    said = t("compensation.target", target=c["target"], date=date)
    state = [t.of(code(str(c["event"]))), *([str(c["reason"])] if c.get("reason") else [])]
    more = [t("compensation.not_seen", **figures)] if figures else []
    more += [t("compensation.rows_not_met")] if c.get("rows_not_met") else []
    told = " ".join([f"{': '.join(state)}.", *more, t("compensation.whole")])
    return {**c, "date": date, "state": shop(told, t), "rows": rows, "bars": _safe(charts.compensated(named, what, u.small, said))}


def as_json(f: Facts) -> dict[str, Any]:
    """facts → plain data of the format tango-report/1."""
    found = verdict(f, texts())
    said, within = may(f, texts()), f.within
    told = said.answer
    sheet = () if isinstance(f.sheet, str) else f.sheet.figures
    iso = [
        {
            "kind": g.kind,
            "name": g.name,
            "value": g.value,
            "interval": None if g.interval is None else list(g.interval),
            "unit": g.unit,
            "range": None if g.range is None else list(g.range),
            "note": texts().of(g.note),
            "fitted_alone": g in f.angles,
        }
        for g in (*sheet, *f.angles)
    ]
    return {
        "format": "tango-report/1",
        "overall": found.level,
        "sentence": sentence(found, texts(), f.judgement.untrusted),
        "checks": [{"name": c.name, "level": c.level, "value": c.value, "text": c.text, "todo": c.todo} for c in found.checks],
        "effects_um": effects(f.result),
        "iso230": iso,
        "held_out": None if f.held is None else {"sd_um": f.held.figures.sd * 1e3, "ratio_to_expected": f.held.ratio},
        "may_make_parts": told.may,
        "no_after": no_after(f, said) or None,
        "after": after(f, said) or None,
        "yes_after": yes_after(f, said) or None,
        "cut_off": dates_cut_off(f.nights.former if f.nights is not None else ()),
        "stale_nights": f.nights.old if told.old and f.nights is not None else 0,
        "tip_worst_um": None if f.tip is None else f.tip.worst * 1e3,
        "volume_worst_um": None if within is None else within[0] * 1e3,
        "outliers": [int(i) for i in f.result.outliers],
        "not_identifiable": not_seen(f),
        "not_identifiable_figures": [f.sheet] if isinstance(f.sheet, str) else list(f.sheet.not_identifiable),
        "files": [{"file": name, "bytes": size, "sha256": digest} for name, size, digest in f.paper.files],
    }
