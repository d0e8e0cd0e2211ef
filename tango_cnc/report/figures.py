"""ISO figures and the statement of uncertainty, as a report tells them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..identify import never_seen
from ..iso230.also import also_held, said_also
from ..iso230.signed import OnPart
from ..iso230.temperature import scale
from .facts import Facts
from .plain import digits, value_text
from .texts import Texts


def _over(f: Facts, name: str, ends: tuple[float, float]) -> str:
    """facts, figure such as EXY, range of its axis (mm or °) → the range in words, in the unit of the report."""
    factor = f.wishes.units.per_mm if name[2:3] in f.cell.machine.linear else 1.0
    digits = 1 if factor < 1 else 0
    return f"{ends[0] * factor:.{digits}f} … {ends[1] * factor:.{digits}f}".replace("-", "−")


def iso(f: Facts, t: Texts) -> list[dict[str, Any]]:
    """facts, texts → rows: figures beside every error motion of the machine, then angles of rotary axes of the fitted terms."""
    sheet = () if isinstance(f.sheet, str) else f.sheet.figures
    rows = [_iso_row(f, t, g, t.of(g.note)) for g in sheet if not g.name.endswith((" ends", " zone"))]
    return rows + [_iso_row(f, t, g, f"{t.of(g.note)}; {t('iso.alone')}".removeprefix("; ")) for g in f.angles]


def iso_at(f: Facts, t: Texts) -> str:
    """facts, texts → where the figures hold, or the reason why there are no figures."""
    if isinstance(f.sheet, str):
        return f"{f.sheet}."
    warm, states = f.sheet.thermal, {"not stated": t("iso.temperature_none"), "as found": t("iso.temperature_found")}
    state = states.get(f.sheet.temperature, f.sheet.temperature)
    if warm is not None and warm.assumed:
        state = t("iso.temperature_assumed", size=f"{2e6 * scale(warm, True).std:.0f}")
    text = f.wishes.units.sentence(t("iso.at", reference=t.of(f.sheet.reference.text), state=state))
    return text[0].upper() + text[1:]


def not_seen(f: Facts) -> list[str]:
    """facts → sentences: what the touches do not show of the fitted terms, as `tango estimate` has them."""
    return [*(c.text for c in f.result.selection.unseen), *never_seen(f.cell.machine, list(f.result.parameters))]


def withheld(f: Facts, t: Texts) -> list[str]:
    """facts, texts → sentences: ISO figures that are withheld, and error motions that parameters may hold."""
    if isinstance(f.sheet, str):
        return [f"{f.sheet}."]
    open_figures = [g for g in f.sheet.figures if g.value is None and not g.name.endswith((" ends", " zone"))]
    angular = [(g.name, g.mixed) for g in open_figures if g.kind == "angular"]
    also = said_also(also_held(list(f.result.parameters), f.cell.machine, angular))
    names = ", ".join(dict.fromkeys(t.of(g.name) for g in open_figures))
    return [*([t("unseen.figures", names=names)] if names else []), *(t.of(text) for text in also)]


def _iso_row(f: Facts, t: Texts, g: OnPart, note: str) -> dict[str, Any]:
    factor, unit = f.wishes.units.of(g.unit)
    key = f"iso_kind.{g.kind.replace(' ', '_')}"
    row: dict[str, Any] = {"kind": t(key) if key in t else g.kind, "name": t.of(g.name), "unit": unit, "note": note}
    row |= {"over": "" if g.range is None else _over(f, g.name, g.range), "arc": "", "weak": True}
    if g.value is None or g.interval is None:
        mixed = t("iso.withheld_from", motions=", ".join(g.mixed)) if g.mixed else t("iso.withheld")
        return {**row, "value": "–", "note": mixed}
    low, high = (v * factor for v in g.interval)
    std = (high - low) / 4
    places = digits(std)
    text = f"{value_text(g.value * factor, std)}, {low:.{places}f} … {high:.{places}f}".replace("-", "−")
    arc = "" if g.unit not in ("µrad", "µm/m") or g.kind == "positioning gain" else f"{np.degrees(g.value * 1e-6) * 3600:.2f} ″"
    return {**row, "value": text, "arc": arc.replace("-", "−"), "weak": low <= 0 <= high}


def uncertainty(f: Facts, t: Texts) -> list[str]:
    """facts, texts → sentences of the statement of uncertainty: its basis, its budget, its coverage."""
    u, artefact, factor = f.wishes.units, f.cell.artefact, f"{f.factor:.2f}"
    if f.wishes.budget is None:
        sigma = f"{f.result.sigma * 1e3 * u.per_micron:.2f}"
        key = "uncertainty.basis_residuals" if f.result.noise is None else "uncertainty.basis_noise"
        lines = [t(key, factor=factor, dof=f.result.dof, sigma=sigma, unit=u.small)]
        lines.append(t("uncertainty.constant"))
    else:
        sources = ", ".join(dict.fromkeys(line.source.replace("_", " ") for line in f.wishes.budget))
        lines = [t("uncertainty.basis_budget", factor=factor, sources=sources)]
    lines += [t("uncertainty.single"), t("uncertainty.model")]
    calibrated = sum(x.uncertainty is not None for x in artefact.facets.values())
    sources_of_scale = []
    if artefact.scale_bar is not None and f.result.model.bar is not None:
        bar = artefact.scale_bar
        length, std = f"{bar.length * u.per_mm:.7g}", f"{bar.uncertainty * 1e3 * u.per_micron:.3g}"
        sources_of_scale.append(t("uncertainty.bar", length=length, large=u.large, std=std, small=u.small))
    if calibrated:
        sources_of_scale.append(t("uncertainty.calibrated", count=calibrated))
    if sources_of_scale:
        lines.append(t("uncertainty.scale_yes", source=", ".join(sources_of_scale)))
    else:
        lines.append(t("uncertainty.scale_no"))
    if names := ", ".join(f.judgement.untrusted):
        lines.append(t("uncertainty.untrusted", names=names))
    return lines
