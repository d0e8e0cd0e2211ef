"""`tango nightly`: one night for a timer: measure, decide, keep, tell."""

from __future__ import annotations

import getpass
import re
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..files import read_cell, write_text
from ..files.nightly import NAME, Nightly, history_of
from ..link.lock import cut_off, unsent
from ..records import Cell, InputError, TangoError
from ..report.texts import Texts
from ..texts import joined, say
from ._common import cell_option, controller_of, json_option, on_terminal, table, write_json
from ._shop import headlines, note_simulated, of_shop

if TYPE_CHECKING:
    from ..history import History

PLACE = "Keep 10"


@click.command()
@cell_option
@click.option(
    "--history", "where", metavar="FILE|URL", help="Instead of the history of nightly.yaml [default: history.db in the cell]."
)
@click.option("--port", metavar="URL", help="Instead of controller.port.")
@click.option("--simulated", is_flag=True, help="The control is a simulated one: message, pages and exports then say so.")
@click.option(
    "--dry-run", is_flag=True, help="Say what this night would measure and whether it could begin; nothing moves or is kept."
)
@click.option("--status", "status", is_flag=True, help="Say how the last nights went, what waits to be sent, and what comes next.")
@click.option("--tell", "tell", is_flag=True, help="Send the messages that wait in nights/outbox, and end.")
@click.option(
    "--install", "kind", type=click.Choice(["systemd", "cron", "windows"]), help="Write the timer for this system, and end."
)
@click.option("--at", default="02:00", show_default=True, metavar="HH:MM", help="With --install: time of day.")
@json_option
def command(
    folder: Path,
    where: str | None,
    port: str | None,
    simulated: bool,
    dry_run: bool,
    status: bool,
    tell: bool,
    kind: str | None,
    at: str,
    json_file: str | None,
) -> int:
    """Measures the machine, judges it, keeps the result and sends a message: one night, started by a timer.

    Nothing moves unless every point of the preflight has passed. Exit status 0: as it should be; 1: changed, out of limits or in
    doubt; 2: wrong input; 3: not measured. Settings are in nightly.yaml (docs/nightly.md).
    """
    from ..history import opened
    from ..nightly import EXIT, Ports, night
    from ..nightly.night import sentence
    from ..nightly.notify import Notifier
    from ..plan import plan
    from ._cell_nights import nights_of
    from ._compensated import recorded
    from ._cut_off import keep_readings, told_of_signals
    from ._night_world import RealClock, RealControl, RealDisk, locked
    from ._unreadable import settings_of

    if sum([dry_run, status, tell, kind is not None]) > 1:
        raise InputError("--dry-run, --status, --tell, --install: found more than one; allowed: one of them")
    settings, wrong = settings_of(folder)
    disk, mail = RealDisk(folder), Notifier(settings.notify)
    t = of_shop(settings)
    if tell:
        return _tell(disk, mail, t)
    if status:
        return _status(folder, settings, wrong, where, disk, json_file, t)
    begun = RealClock().now()
    stamp = begun.astimezone(UTC).strftime("%Y-%m-%dT%H%M%SZ")
    try:
        if wrong is not None:
            raise wrong
        cell = read_cell(folder)
        if kind is not None:
            return _install(cell, kind, at)
        place = history_of(folder, settings, where)
        controller_of(cell)
        made = plan(cell)
        analysis = nights_of(cell, settings, made)
        control = RealControl(cell, settings, made, analysis.check, stamp, port, simulated)
        if dry_run:
            place = _looked_at(place)
        with opened(place) as history:
            if dry_run:
                return _dry(control, analysis, history, begun, disk, settings, json_file, t)
            recorded(folder, history)
            keep_readings(folder, control.planned)
            past = history.as_of(lambda: begun)
            with told_of_signals() as ending:
                world = Ports(_Held(begun), disk, control, mail, past, analysis, locked(folder), analysis.happened, ending)
                record = night(cell.machine.name, str(folder.resolve()), settings, world)
            newest = _newest(history, record)
            seen = _known(history, record)
    except Exception as error:  # whatever it is: no night ends without a message
        if not dry_run and kind is None and ((folder / NAME).exists() or (folder / "nights").exists()):
            known = error if isinstance(error, TangoError) else TangoError(sentence(error))
            _unread(folder, settings, where, begun, disk, mail, known)
        raise
    try:
        from ..report import morning

        page = morning.render(record, folder=settings.templates, **seen)
        disk.write(Path(record["artefacts"]["folder"]).name, "morning.html", page)
    except (OSError, InputError) as error:  # a template that cannot be used hides no verdict
        why = str(error.strerror or error) if isinstance(error, OSError) else str(error)
        click.echo(t("night.night.not_written", name=f"{record['artefacts']['folder']}/morning.html", why=why), err=True)
    if not write_json(json_file, record):
        from ..nightly.words import message

        subject, text = message(record, record.get("trouble", ()), (), newest, t=t)
        click.echo(f"{subject}\n\n{text}", nl=False)
    for delivery in record.get("notifications", ()):
        if not delivery["sent"]:
            click.echo(t("cli.nightly.unsent", to=delivery["to"], why=delivery["why"]), err=True)
    return EXIT[record["verdict"]]


class _Held:
    """A clock whose first look is the moment that named the folder of the night."""

    def __init__(self, first: datetime) -> None:
        self._first: datetime | None = first

    def now(self) -> datetime:
        """→ now, with the local zone."""
        first, self._first = self._first, None
        return first or datetime.now().astimezone()


def _known(history: History, record: Mapping[str, Any]) -> dict[str, Any]:
    """history, record of tonight → what its page is told by: decisions, last night that measured, last one in limits."""
    from ..history import compensations
    from ..report.morning import last_within, never_within, volumes_of

    machine = record["machine"]
    with suppress(TangoError, OSError):
        if machine in history.machines():
            nights = history.nights(machine)
            last = next((n for n in nights if n.verdict != "not_measured"), None) if record["verdict"] == "not_measured" else None
            signs = [(n.night, n.verdict) for n in nights]
            before = None if last is None else history.night(last.entry).record
            known: dict[str, Any] = {"decisions": history.decisions(machine), "before": before, "within": last_within(signs)}
            known |= {"never": never_within(signs), "volumes": volumes_of(nights), "signs": signs}
            return known | {"events": compensations(history, machine)}
    return {}


def _newest(history: History, record: Mapping[str, Any]) -> tuple[int, str] | None:
    """history, record of the night that was just told → entries and newest hash; None where it is not in the history."""
    with suppress(TangoError):
        return None if record.get("trouble") else history.newest_hashes().get(record["machine"])
    return None


def _unread(folder: Path, settings: Nightly, where: str | None, begun: datetime, disk: Any, mail: Any, error: TangoError) -> None:
    """Puts a night on record whose cell or history cannot be read, as far as that goes, and tells whoever is to be told."""
    from ..history import opened
    from ..nightly import Ports, night
    from ._night_world import locked
    from ._unreadable import NoHistory, Unreadable, machine_of

    none, cell = Unreadable(error), str(folder.resolve())

    def begin(past: Any, name: str) -> None:
        night(name, cell, settings, Ports(_Held(begun), disk, none, mail, past, none, locked(folder)))

    with ExitStack() as stack:
        try:
            history = stack.enter_context(opened(history_of(folder, settings, where)))
            name = machine_of(folder, history.machines())
        except TangoError as second:
            begin(NoHistory(second), machine_of(folder, ()))
        else:
            begin(history, name)


def _install(cell: Cell, kind: str, at: str) -> int:
    from ..nightly.install import ENCODING, advice, skipped, units

    if not re.fullmatch(r"([01]\d|2[0-3]):[0-5]\d", at):
        raise InputError(f"--at: found {at!r}; allowed: a time of day such as 02:00")
    target = cell.folder / "nights" / "timer"
    who = getpass.getuser()
    written = units(kind, cell.folder.resolve(), at, cell.machine.name, "" if who == "root" else who)
    for name, text in written.items():
        write_text(target / name, text, ENCODING.get(kind, "utf-8"))
    click.echo("\n".join(str(target / name) for name in written))
    click.echo(f"{say('cli.nightly.set_going')}\n    {advice(kind, list(written), target, who)}")
    if kind == "systemd" and (day := skipped(at, datetime.now().astimezone().date())) is not None:
        click.echo(say("cli.nightly.skipped", at=at, date=str(day)))
    return 0


def _answer(folder: Path, place: str | Path, t: Texts) -> str:
    """cell, its history, texts → whether parts may be made, as on its page and in its report; '' where no night says so."""
    from ..report.units import Units
    from .report import nights

    with suppress(TangoError):  # what is wrong with the cell is said above
        machine, u = read_cell(folder).machine, Units()
        found = None if isinstance(place, Path) and not place.exists() else nights(folder, machine, u, t, where=place)
        if found is not None:
            told = found.answer(u, t, machine)
            lines = (f"{told.word}{', ' + told.old if told.old else ''}.", told.why, f"{told.numbers}." if told.numbers else "")
            return f"{t('may.ask')} {' '.join(x for x in (*lines, told.soon) if x)}"
    return ""


def _looked_at(place: str | Path) -> str | Path:
    """history → itself, or an empty one in memory where the file is missing, so that a mere look creates no file."""
    return "sqlite://" if isinstance(place, Path) and not place.exists() else place


def _tell(disk: Any, mail: Any, t: Texts) -> int:
    from ..nightly.night import delivered

    failed = 0
    for stamp, words in disk.unsent():
        deliveries = delivered(disk, mail, stamp, words)
        if all(d.sent for d in deliveries):
            click.echo(t("cli.nightly.sent", subject=words.partition("\n")[0]))
        for delivery in deliveries:
            if not delivery.sent:
                failed += 1
                click.echo(t("cli.nightly.not_sent", to=delivery.to, why=delivery.why), err=True)
    for stamp, _ in disk.unfinished():
        click.echo(t("cli.nightly.unfinished", stamp=stamp), err=True)
    return 3 if failed else 0


def _dry(
    control: Any, analysis: Any, history: Any, now: datetime, disk: Any, settings: Nightly, json_file: str | None, t: Texts
) -> int:
    from ..nightly import day_of
    from ..nightly.night import room
    from ..report.texts import code

    kind, why, touches = analysis.choice(history, day_of(now))
    points = [room(disk, settings), *control.preflight(kind, touches)]
    count = len(touches) or len((analysis.check or analysis.cell).strategy.indexations)
    data = {
        **{"format": "tango-nightly-dry-run/1", "kind": kind, "why": why, "touches": list(touches)},
        **{"preflight": [vars(p) for p in points], "passed": all(p.passed for p in points)},
    }
    if not write_json(json_file, data):
        what = t("cli.nightly.touches", count=count) if touches else t("cli.nightly.whole") if kind == "full" else "check.yaml"
        click.echo(t("cli.nightly.would_be", kind=code(kind), why=why, what=what))
        room_for = max(len(t("cli.nightly.ok")), len(t("cli.nightly.failed")))
        for p in points:
            word = t("cli.nightly.ok" if p.passed else "cli.nightly.failed")
            name = t(f"check_name.{p.check}") if f"check_name.{p.check}" in t else p.check
            click.echo(f"  {word:<{room_for}} {name}: {t.of(p.found)}{'; ' + t.of(p.do) if p.do else ''}")
        click.echo(t("cli.nightly.nothing_moved"))
    return 0 if data["passed"] else 1


def _status(
    folder: Path, settings: Nightly, wrong: TangoError | None, where: str | None, disk: Any, json_file: str | None, t: Texts
) -> int:
    from ..history import opened
    from ..history.clock import asks, in_future
    from ..history.clock import told as told_of
    from ..history.former import formers, of_folder
    from ..nightly.words import answer
    from ..report.age import measured_on, night_of_stamp, nights_old
    from ..report.morning import next_night
    from ..report.repeated import shortened
    from ..report.texts import code
    from ..report.tonight import by_tonight
    from ._unreadable import machine_of

    name = ""
    if not folder.is_dir():
        read_cell(folder)  # says that there is no such cell
    try:
        name = read_cell(folder).machine.name
    except TangoError as error:
        wrong = wrong or error
    place = history_of(folder, settings, where)
    with opened(_looked_at(place)) as whole:
        history = whole.as_of(lambda: datetime.now(UTC))
        name = name or machine_of(folder, history.machines())
        renamed = formers(history, name, folder, of_folder(place, folder))
        future = in_future(history, name)
        nights = history.nights(name, last=7) if name in history.machines() else ()
        newest = max(nights, key=lambda n: n.end_utc, default=None)  # one that was refused began after the one at work
        waiting = [stamp for stamp, _ in disk.unsent()]
        unfinished = [stamp for stamp, _ in disk.unfinished()]
        cut = cut_off(folder)
        early = unsent(folder, cut)
        alarms = history.open_alarms(name, today=f"{datetime.now().astimezone():%Y-%m-%d}") if nights else ()
        record = history.night(newest.entry).record if newest else {}
        told = {a["id"]: a for a in record.get("standing") or ()}
        alarms = tuple(
            {**a, **{key: told[a["id"]][key] for key in ("text", "now", "total")}, **by_tonight(told[a["id"]])}
            if a["id"] in told
            else a
            for a in alarms
        )
        last = next((n for n in nights if n.verdict != "not_measured"), None)
        before = record if last is None or newest is None or last.entry == newest.entry else history.night(last.entry).record
        coming = next_night(record, history.decisions(name), before) if nights else {}
        said = headlines(history, nights)
        standings = history.fleet(datetime.now(UTC).isoformat(), settings.late_hours)
        standing = next((s for s in standings if s.machine == name), None)  # as in the list of all machines
        late = standing is None or standing.late
        stale = (
            nights_old(measured_on(record, before), f"{datetime.now().astimezone():%Y-%m-%d}", settings.answers_for)
            if nights
            else 0
        )
        if json_file is None:
            note_simulated(history, name, t)
    data = {
        **{
            "format": "tango-nightly-status/1",
            "machine": name,
            "late": late,
            "stale_nights": stale,
            "waiting": waiting,
            "unfinished": unfinished,
        },
        "cut_off": cut,
        "trouble": None if wrong is None else str(wrong),
        "left_out": None if future is None else vars(future),
        **{"open_alarms": list(alarms), "nights": [vars(n) for n in nights], "next": coming or None},
        "former": [
            {"machine": f.machine, "nights": f.nights, "last": f.last, "open_alarms": list(f.alarms), "held_alarms": list(f.held)}
            for f in renamed
        ],
    }
    if not write_json(json_file, data):
        word = t("cli.nightly.no_night" if not nights else "cli.nightly.late" if late else "cli.nightly.on_time")
        click.echo(f"{name}: {t('cli.nightly.stale', nights=stale) if stale else word}")
        if told_now := _answer(folder, place, t):
            click.echo(f"  {told_now}")
        if stale:
            click.echo(f"  {t('morning.old_todo')}")
        if wrong is not None:
            click.echo("  " + t("cli.nightly.cannot_begin", why=str(wrong)))
        if future is not None:
            click.echo(f"  {t.of(told_of(future))}")
        for f in renamed:
            if f.alarms or f.held or not nights:
                click.echo(f"  {t.of(f.told(name, not nights))}")
        rows = [[""] * 5]  # no heads
        for n, text in zip(nights, shortened([said.get(n.entry) or n.headline for n in nights]), strict=True):
            rows.append([n.night, *(t.of(code(word)) for word in (n.kind, n.status, n.verdict)), " ".join(t.of(text).split())])
        columns = on_terminal()
        listed = table(rows, "<<<<<", None if columns is None else columns - 2)
        click.echo("".join(f"  {line}\n" for line in listed.splitlines() if line.strip()), nl=False)
        for alarm in alarms:
            command = answer(alarm["id"], str(folder), where)
            click.echo(
                "  "
                + t("cli.nightly.open_alarm", id=alarm["id"], text=joined("; ", (alarm["text"], alarm.get("now"))), command=command)
            )
        for stamp in waiting:
            click.echo("  " + t("cli.nightly.waits", stamp=stamp))
        for stamp in unfinished:
            key = "ended_before" if stamp in early else "cut_off" if stamp in cut else "begun"
            click.echo("  " + t(f"cli.nightly.{key}", stamp=stamp if key == "begun" else night_of_stamp(stamp)))
        if coming:
            click.echo("  " + t("cli.nightly.next", kind=code(coming["kind"]), why=coming["why"]))
    wanted = standing is None or standing.wants_somebody or stale > 0
    wanted |= future is not None and asks(future)
    return 1 if wanted or cut or alarms or wrong is not None or any(f.alarms for f in renamed) else 0
