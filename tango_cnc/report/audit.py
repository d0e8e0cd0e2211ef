"""Where a report comes from: its line below the title, and its table for the auditor."""

from __future__ import annotations

from .days import at
from .facts import Facts
from .texts import Texts


def source(f: Facts, t: Texts) -> str:
    """facts, texts → the line below the title: readings file, its date, owner."""
    paper = f.paper
    owner = paper.owner or t("audit.unknown")
    return t(
        "report.source",
        file=paper.readings or "–",
        date=at(paper.measured, t) if paper.measured else t("audit.unknown"),
        owner=owner,
    )


def made_of(f: Facts, t: Texts) -> str:
    """facts, texts → the line below the answer: table, plan and chain of axes, which say nothing to people at the machine."""
    return t("report.made_of", table=f.cell.artefact.name, plan=f.cell.strategy.name, chain=f.cell.machine.topology)


def audit(f: Facts, t: Texts) -> list[tuple[str, str]]:
    """facts, texts → rows (name, value) of the table for the auditor."""
    u, probe, paper = f.wishes.units, f.cell.machine.probe, f.paper
    origin = paper.origin
    unknown = t("audit.unknown")
    probe_text = t(
        "audit.probe_text",
        length=f"{probe.length * u.per_mm:.4g}",
        radius=f"{probe.tip_radius * u.per_mm:.4g}",
        large=u.large,
        repeatability=f"{probe.repeatability * 1e3 * u.per_micron:.3g}",
        small=u.small,
    )
    rows = [(t("audit.machine"), f.cell.machine.name), (t("audit.topology"), f.cell.machine.topology)]
    if paper.simulated:
        rows.append((t("audit.measured"), t("audit.simulated")))
    elif origin is None:
        rows.append((t("audit.measured"), t("audit.origin_unknown")))
    else:
        measured = " … ".join(at(origin[k], t) for k in ("start_utc", "end_utc") if origin.get(k)) or unknown
        rows.append((t("audit.measured"), measured))
        control = origin.get("controller") or {}
        rows.append((t("audit.control"), ", ".join(str(v) for v in control.values() if v) or unknown))
        rows.append((t("audit.program"), str(origin.get("program_hash") or unknown)))
        rows.append((t("audit.plan"), str(origin.get("plan_hash") or unknown)))
    versions = [f"tango_cnc {paper.version}", *(f"{name} {number}" for name, number in paper.versions.items())]
    if origin and origin.get("tool_version"):
        versions.append(t("audit.run_version", version=origin["tool_version"]))
    if f.nights is not None and f.nights.chain is not None:  # answer, trend and alarms are of it
        number, digest = f.nights.chain
        rows.append((t("audit.history"), t("audit.history_text", number=number, digest=digest)))
    return [
        *rows,
        (t("audit.reported"), f"{paper.made.astimezone():%Y-%m-%d %H:%M:%S %Z}"),
        (t("audit.operator"), paper.operator or str((origin or {}).get("operator") or unknown)),
        (t("audit.owner"), paper.owner or unknown),
        (t("audit.probe"), probe_text),
        (t("audit.terms"), ", ".join(str(x) for x in f.wishes.terms)),
        (t("audit.versions"), ", ".join(versions)),
    ]
