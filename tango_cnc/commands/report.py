"""`tango report`: write one page with pictures that stands alone, and the same as PDF."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .. import __version__
from ..estimate import Estimate
from ..files import of_stylus, read_cell, read_readings, read_terms, write_text
from ..files.nightly import NAME, history_of, read_nightly
from ..files.origin import Origin, check_values, current, look_up
from ..files.readjson import read_json
from ..files.targets import KEPT, sources
from ..iso230.signed import Sheet, signed
from ..judgement import Judgement
from ..judging import NoFit, judged, left_out
from ..link.lock import broken_off, cut_off, ended
from ..link.progress import minutes_left
from ..records import InputError, Machine, TangoError
from ..report import later, newer, page, pdf, template, terminal
from ..report.checks import verdict
from ..report.compensated import begins, marked, placed
from ..report.course import by_compensations, by_repairs, drift_told, jumps_of
from ..report.days import between, local_day
from ..report.facts import Facts, LoadedCompensation, NewestNight, Paper, Wishes, effects, gather
from ..report.repeated import as_decided
from ..report.texts import Texts, texts, texts_of
from ..report.units import Units, shown
from ..texts import Said, joined
from ..uncertainty.inputs import read_budget
from ._budget import budget_of
from ._common import Output, cell_option, json_option, write_json
from ._handed import pasted, whole
from ._progress import said
from ._trust import despite_option, members, status, told
from .iso230 import at_20

if TYPE_CHECKING:
    from ..history import History, Night

NIGHTS = 365  # of the trend
LATELY = 30  # nights among which the last complete one, and the last that measured, are looked for
TRENDS = 6  # parameters
INTERVAL = 1.96
LIBRARIES = ("numpy", "scipy", "jinja2")
PLACE = "Keep 50"  # in the list of commands


@click.command()
@cell_option
@click.option(
    "--readings", "file", type=click.Path(path_type=Path), help="Readings file [default: readings.csv, else simulated.csv]."
)
@click.option("--terms", help="Instead of the cell's: S1 … S4 or a list, e.g. S3,EYX2.")
@click.option("--degree", type=click.IntRange(1, 6), default=3, show_default=True, help="Highest degree of the polynomials of S4.")
@click.option("-o", "--output", type=Output(), metavar="FILE", help="Default: report.html in the cell.")
@click.option(
    "--pdf", "pdf_file", type=Output(), metavar="FILE", help="Also write the report as PDF (pip install 'tango-cnc[pdf]')."
)
@click.option("--unit", type=click.Choice(["mm", "inch"]), default="mm", show_default=True, help="mm and µm, or inch and µin.")
@click.option(
    "--limit-um",
    type=click.FloatRange(0, min_open=True),
    help="Largest error of the tool tip that is allowed, µm; default: nightly.yaml.",
)
@click.option("--operator", default="", help="Who measured; printed for the auditor.")
@click.option("--owner", default="", help="Who answers for this machine [default: owner in nightly.yaml].")
@click.option(
    "--templates", type=click.Path(path_type=Path), metavar="DIR", help="Templates and texts.toml of your own (docs/report.md)."
)
@click.option("--no-diagnosis", is_flag=True, help="Leave the diagnosis out; the verdict then says so.")
@click.option("--no-pictures", is_flag=True, help="Leave the pictures out.")
@despite_option
@json_option
def command(
    folder: Path,
    file: Path | None,
    terms: str | None,
    degree: int,
    output: Path | None,
    pdf_file: Path | None,
    unit: str,
    limit_um: float | None,
    operator: str,
    owner: str,
    templates: Path | None,
    no_diagnosis: bool,
    no_pictures: bool,
    despite: bool,
    json_file: str | None,
) -> int:
    """Writes one page that stands alone: verdict, what to do, parameters with intervals, pictures, statement of uncertainty.

    It needs no network and no other file. The verdict is the worst of plausibility, completeness, fit, prediction, diagnosis
    and limit. Exit status 1 where the numbers must not be used, where the tool tip is beyond its limit, and where no parts may be
    made by what the last night has measured.
    """
    if output is not None and output.suffix.lower() == ".pdf":
        raise InputError(
            f"--output: found {output}; this is the page in HTML. 'tango report --pdf {pasted(output)}' writes the PDF beside it"
        )
    if pdf_file is not None and not pdf.available():
        raise InputError("--pdf: typst is not installed; pip install 'tango-cnc[pdf]'")
    template.environment(templates)
    cell = read_cell(folder)
    source = current(folder, file)
    readings = read_readings(source, cell.machine, cell.artefact)
    items = cell.terms if terms is None else read_terms(terms, cell.folder)
    budget = folder / "uncertainty.yaml"
    nightly = read_nightly(folder)
    stated = nightly.limits.get("volume")  # µm
    allowed = stated if limit_um is None else limit_um
    other = None if limit_um is None or stated is None or stated == limit_um else stated
    wishes = Wishes(
        items,
        degree,
        None if allowed is None else allowed / 1e3,
        None if other is None else other / 1e3,
        Units("inch" if unit == "inch" else "mm"),
        read_budget(budget) if budget.exists() else None,
        not no_diagnosis,
        not no_pictures,
    )
    known = look_up(source)
    made = paper(folder, source, operator, owner or nightly.owner, folder / NAME, known=known)
    result, judgement = judged(cell, readings, items, degree, source=source, run=made.plan, origin=known)
    past = trend(folder, cell.machine.name, list(effects(result)), texts_of(templates))
    try:
        found = gather(
            cell,
            readings,
            wishes,
            made,
            result,
            judgement,
            sheet=_sheet(folder, result),
            trend=past,
            compensations=compensations(folder),
            nights=nights(folder, cell.machine, wishes.units, texts_of(templates), allowed),
            control=_in_control(folder, known, result),
        )
    except TangoError as error:  # a second fit, which the first one has warned of
        if isinstance(error, InputError) or judgement.verdict != "implausible":
            raise
        raise NoFit("\n".join([f"no page was written: {error}", *told(judgement)]), judgement) from None
    target = output or folder / newer.NAME
    values = page.context(found, texts_of(templates))
    data = page.as_json(found)
    own = target.resolve() == (folder / newer.NAME).resolve()
    if own:
        _in_the_other_unit(folder, found, templates, allowed)
    write_text(target, page.render(found, templates, values))
    if own:
        write_text(
            folder / newer.SAID,
            newer.answer_text(
                data["may_make_parts"], data["no_after"], later.newer_answer(found), data["after"] or data["yes_after"]
            ),
        )
    if pdf_file is not None:
        pdf_file.write_bytes(pdf.render(found, templates, values, said))
    source_of = None if allowed is None else "--limit-um" if limit_um is not None else "nightly.yaml"
    data |= {"limit_um": allowed, "limit_from": source_of, "limit_nightly_um": stated}
    data |= {"report": str(target)} | ({} if pdf_file is None else {"pdf": str(pdf_file)})
    if not write_json(json_file, data | members(overall(judgement, found))):
        click.echo("".join(f"{whole(line)}\n" for line in told(judgement)), nl=False)
        click.echo(terminal.summary(found, t=texts_of(templates), handed=whole))
        written = [f"{p} ({p.stat().st_size / 1000:.0f} kB)" for p in (target, pdf_file) if p is not None]
        click.echo(f"{' and '.join(written)}: open it in a browser")
    crossed = found.tip is not None and wishes.limit is not None and found.tip.worst > wishes.limit
    unsettled = bool(data["stale_nights"] or data["cut_off"])  # nobody knows, or a night was cut off
    no = data["overall"] == "stop" or data["may_make_parts"] == "no" or unsettled
    return status(judgement, despite) or int(crossed or (no and not despite))


def _in_the_other_unit(folder: Path, found: Facts, templates: Path | None, allowed: float | None) -> None:
    """cell, facts, templates, limit (µm) → the same page in inch beside the one in mm (or the other way round), which pages of
    `tango serve` show where they are in that unit; that of an earlier report in the unit of this one is gone.
    """
    own, other = found.wishes.units, Units("mm" if found.wishes.units.system == "inch" else "inch")
    again = None if found.nights is None else nights(folder, found.cell.machine, other, texts_of(templates), allowed)
    same = replace(found, wishes=replace(found.wishes, units=other), nights=again)
    write_text(folder / f"report.{other.system}.html", page.render(same, templates, page.context(same, texts_of(templates))))
    (folder / f"report.{own.system}.html").unlink(missing_ok=True)


def _sheet(folder: Path, result: Estimate) -> Sheet | str:
    """cell, estimate → the figures that `tango iso230` prints, or the reason why it prints none."""
    try:
        return signed(result, None, at_20(folder), budget=budget_of(folder, result))
    except TangoError as error:
        if isinstance(error, InputError):
            raise
        return str(error)


def overall(judgement: Judgement, found: Facts) -> Judgement:
    """what is thought of the numbers, facts → the worst of it and of every check of the report that says something of them."""
    checks = verdict(found, texts()).checks
    bad = [c.text for c in checks if c.trust and c.level != "good" and c.name != "plausible"]
    worst = "doubtful" if bad and judgement.verdict == "trustworthy" else judgement.verdict
    return replace(judgement, verdict=worst, reasons=(*judgement.reasons, *bad))


def paper(folder: Path, source: Path, operator: str, owner: str, *more: Path, known: Origin | None = None) -> Paper:
    """cell, readings file, people, more files → what a report says of its own making.

    `known`: the origin of the readings, where it was read before.
    """
    known = known or look_up(source)
    styli = [of_stylus(source, number) for number in range(2, 10)]  # read with it where they exist
    names = [*(n for n in sources(folder) if n.name not in KEPT), folder / "uncertainty.yaml", source, *styli, *more]
    origin_file = source.with_suffix(".json")
    origin: Mapping[str, Any] | None = None
    if origin_file.exists():
        origin = read_json(origin_file, "what 'tango run' wrote. Restore it, or move it away")
        names.append(origin_file)
    files = []
    for name in dict.fromkeys(n.resolve() for n in names if n.is_file()):
        data = name.read_bytes()
        files.append((name.name, len(data), hashlib.sha256(data).hexdigest()))
    versions = {"Python": platform.python_version()} | {name: _version(name) for name in LIBRARIES}
    simulated = known.known.get("origin") == "simulated" or bool((origin or {}).get("simulated"))
    measured = str((origin or {}).get("start_utc") or known.known.get("written_utc") or "")
    run = left_out(known) if origin is None else origin
    made = datetime.now(UTC)
    return Paper(made, __version__, versions, operator, owner, tuple(files), origin, simulated, source.name, measured, run)


@cache
def _version(name: str) -> str:
    from importlib.metadata import version

    return version(name)


def compensations(folder: Path) -> Sequence[Mapping[str, Any]]:
    """cell → before, promised and measured of every compensation in its folder `compensations`, oldest first, µm."""
    from ..compensate import loop

    events = loop.history(folder)
    found = []
    for kept in loop.found(folder):
        promise, own = kept.record["promise"], [e for e in events if e["compensation"] == kept.number]
        measured = next((e["measured_um"] for e in reversed(own) if "measured_um" in e), None)
        rows = [
            ("rms", promise["rms_before_um"]["value"], promise["rms_after_um"]["value"], measured),
            ("p95", promise["p95_before_um"]["value"], promise["p95_after_um"]["value"], None),
        ]
        last = own[-1] if own else {"event": "proposed"}
        made = local_day(kept.record.get("created_utc"))
        told = {"event": last["event"], "left": last.get("left_if_none_um"), "rows_not_met": bool(last.get("rows_not_met"))}
        told["reason"] = last.get("text") if last["event"] == "rolled back" else None  # what somebody has typed
        found.append({"target": kept.record["target"], "date": made, "rows": rows, **told})
    return found


def _in_control(folder: Path, origin: Origin, result: Estimate) -> LoadedCompensation | None:
    """cell, origin of the readings, estimate → the compensation in its control, as far as the readings lack it."""
    from ..compensate import loop

    if next(loop.found(folder), None) is None:  # nothing of the nights and their database is loaded without a compensation
        return None
    from ..state.volume import levers_of
    from ._in_control import in_control

    beside, rows = origin.known, check_values(origin.readings.read_text(encoding="utf-8-sig"))
    if (missed := loop.ignored(folder, rows, (beside.get("run") or {}).get("end_utc"))) is not None:
        return LoadedCompensation(missed[0].number, missed[0].record["target"], True, None)
    if beside.get("origin") != "measured":  # a simulator probes with tool center point control as well
        return None
    found = in_control(folder, result.model, lambda: levers_of(result))
    if found is None:
        return None
    gone = found.gone if found.measured or found.beneath is not None else None
    return LoadedCompensation(found.number, found.target, False, gone, found.event, found.beneath)


def _place(folder: Path) -> str | Path | None:
    """cell → file or URL of the history that its nightly.yaml names; None where no night has been."""
    place = history_of(folder, read_nightly(folder))
    return None if isinstance(place, Path) and not place.exists() else place


def nights(
    folder: Path, chain: Machine, u: Units, t: Texts, limit_um: float | None = None, where: str | Path | None = None
) -> NewestNight | None:
    """cell, its machine, units, texts, limit of the tool tip that is stated now, history in place of that of nightly.yaml → newest
    night and open alarms in its history; None where it has none.
    """
    place = where or _place(folder)
    if place is None:
        return None
    from ..history import compensations as recorded  # databases are slow to load, and many cells have had no night
    from ..history import opened
    from ..history.clock import asks, in_future
    from ..history.clock import told as told_of
    from ..report.age import due, measured_on, nights_old
    from ..report.answer import by_limit, said_broken_off, said_cut_off
    from ..report.faults import answered, asking, earlier, faults, of_probe, settled, still_open, unclosed, untried
    from ..report.morning import volumes_of
    from ..report.orders import brief_of, orders, parts_since
    from ..report.pace import ahead
    from ..report.reach import to_ask

    machine = chain.name
    with opened(place, create=False) as whole:
        history = whole.as_of(lambda: datetime.now(UTC))
        newest = history.nights(machine, last=1) if machine in history.machines() else ()
        if not newest:
            return None
        n, now = newest[0], datetime.now(UTC)
        record, before = history.night(n.entry).record, _measured_before(history, machine, n)
        settings, today = read_nightly(folder), now.astimezone().strftime("%Y-%m-%d")
        alarms, decisions = unclosed(history, machine, today)
        events = recorded(history, machine)
        begun = (before or record).get("start_utc")
        too_old = nights_old(measured_on(record, before), due(now, begun), settings.answers_for)
        who = {"owner": record.get("owner") or settings.owner, "deputy": settings.deputy or record.get("deputy")}
        record = {**record, **who}
        found = faults(record, earlier(alarms), decisions, u, t, chain, before, today, events, too_old)
        waits, has = answered(found, record)
        lately = history.nights(machine, last=LATELY)
        complete = next((x for x in lately if x.status == "complete"), None)
        since = complete.night if complete is not None else t("web.never")
        old = complete is None or datetime.fromisoformat(complete.start_utc) < now - timedelta(hours=settings.late_hours)
        cause, owner = (str(found[0]["text"]), str(found[0]["owner"] or "")) if found else ("", "")
        open_ones, soon = len(still_open(found)), ahead(by_limit(before or record, limit_um), volumes_of(lately), today)
        said = as_decided(record, tuple(decisions.values())) or n.headline
        if (future := in_future(history, machine)) is not None:
            said, open_ones = joined(". ", (said, told_of(future))), open_ones + int(asks(future))
            waits = waits or (future.night if asks(future) else "")
        told = NewestNight(
            *(n.night, n.verdict, said, open_ones, n.end_utc, record, before, waits, has, since if old else "", cause, soon, owner),
            settled(found),
            old=too_old,
            probe=of_probe(found),
            answers_for=settings.answers_for,
            brief=brief_of(found[0]) if found else "",
            asks=to_ask(record, found, t),
            parts=tuple(parts_since(str((before or record).get("night") or ""), found, record, t)),
            repaired={str(a["parameter"]): str(a["decision"].owner) for a in found if untried(a) and a["decision"] is not None},
            named=bool(found) and asking(found)[:1] != found[:1],
            chain=history.newest_hashes().get(machine),
            share=bool(found) and _is_share(found[0].get("raw_text")),
            busy=minutes_left(folder, now.timestamp()) is not None,
            former=(*said_cut_off(cut := cut_off(folder), ended(folder, cut)), *said_broken_off(broken_off(folder))),
        )
        coming, limit = str((record.get("next") or {}).get("kind") or ""), None if limit_um is None else limit_um / 1e3
        todo = tuple(orders(told.answer(u, t, chain, limit), record, found, coming, u, t, chain, told.former))
        return replace(told, todo=todo, named=told.named or bool(told.brief and todo and todo[-1].startswith(told.brief)))


def _is_share(text: object) -> bool:
    """text of what is wrong first, as its night recorded it → whether it names the largest share of an error, and no change."""
    return isinstance(text, Said) and text.key == "changed.most"


def _measured_before(history: History, machine: str, newest: Night) -> Mapping[str, Any] | None:
    """history, machine, its newest night → record of the last one that measured, where the newest did not; else None."""
    if newest.verdict != "not_measured":
        return None
    last = next((n for n in history.nights(machine, last=LATELY) if n.verdict != "not_measured"), None)
    return None if last is None else history.night(last.entry).record


def trend(folder: Path, machine: str, names: Sequence[str], t: Texts) -> Mapping[str, Any] | None:
    """cell, its machine, parameters, texts → their values night by night in its history; None where it has none."""
    place = _place(folder)
    if place is None:
        return None
    from ..history import compensations as happened
    from ..history import opened  # slow to load

    allowed = read_nightly(folder).limits
    with opened(place, create=False) as whole:
        history = whole.as_of(lambda: datetime.now(UTC))
        if machine not in history.machines():
            return None
        known = history.parameters(machine)
        alarms = {s.night.entry: s.record["alarms"] for s in history.alarmed(machine, NIGHTS)}
        every = happened(history, machine)
        events = marked(every, t)
        found = []
        for name in [n for n in names if n in known][:TRENDS]:
            past = history.trend(machine, name)
            value, std = past.value[-NIGHTS:], past.std[-NIGHTS:]
            dates, entries = past.nights[-NIGHTS:], past.entries[-NIGHTS:]
            if len(value) < 2:
                continue
            factor, unit = shown(past.unit)
            back = by_repairs(alarms, history.decisions(machine), past.start_utc[-NIGHTS:], name, (value, std))
            back = by_compensations(begins(every, past.start_utc[-NIGHTS:]), (value, std), back)
            first = date.fromisoformat(dates[0])
            days = [(date.fromisoformat(d) - first).days for d in dates]
            found.append(
                {
                    **{"title": name, "unit": unit, "days": days, "value": (value * factor).tolist()},
                    **{"half": (INTERVAL * std * factor).tolist(), "alarm": [e in alarms for e in entries]},
                    "x_label": between(dates, t),
                    "first": first,
                    "events": placed(events, first, date.fromisoformat(dates[-1])),
                    "limit": allowed.get(name),
                    "jumps": jumps_of(alarms, entries, name, factor, back),
                    "drift": drift_told(alarms, entries, dates, name),
                }
            )
    return {"series": found} if found else None
