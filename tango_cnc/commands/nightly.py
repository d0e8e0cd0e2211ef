"""`tango nightly`: one night for a timer: measure, decide, keep, tell."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..files import read_cell, write_text
from ..files.nightly import NAME, Nightly, history_of
from ..records import Cell, InputError, TangoError
from ._common import cell_option, controller_of, json_option, write_json

if TYPE_CHECKING:
    from ..history import History

PLACE = "Keep 10"


@click.command()
@cell_option
@click.option(
    "--history", "where", metavar="FILE|URL", help="Instead of the history of nightly.yaml [default: history.db in the cell]."
)
@click.option("--port", metavar="URL", help="Instead of controller.port.")
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
    from ._night_world import RealClock, RealControl, RealDisk, locked
    from ._unreadable import settings_of

    if sum([dry_run, status, tell, kind is not None]) > 1:
        raise InputError("--dry-run, --status, --tell, --install: found more than one; allowed: one of them")
    settings, wrong = settings_of(folder)
    disk, mail = RealDisk(folder), Notifier(settings.notify)
    if tell:
        return _tell(disk, mail)
    if status:
        return _status(folder, settings, wrong, where, disk, json_file)
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
        control = RealControl(cell, settings, made, analysis.check, stamp, port)
        if dry_run:
            place = _looked_at(place)
        with opened(place) as history:
            if dry_run:
                return _dry(control, analysis, history, begun, disk, settings, json_file)
            recorded(folder, history)
            world = Ports(_Held(begun), disk, control, mail, history, analysis, locked(folder))
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

        disk.write(Path(record["artefacts"]["folder"]).name, "morning.html", morning.render(record, **seen))
    except OSError as error:
        click.echo(f"{record['artefacts']['folder']}/morning.html could not be written ({error.strerror or error})", err=True)
    if not write_json(json_file, record):
        from ..nightly.words import message

        subject, text = message(record, record.get("trouble", ()), (), newest)
        click.echo(f"{subject}\n\n{text}", nl=False)
    for delivery in record.get("notifications", ()):
        if not delivery["sent"]:
            click.echo(f"not sent: {delivery['to']}: {delivery['why']}; the message waits in nights/outbox", err=True)
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
    from ..report.morning import last_within, last_written

    machine = record["machine"]
    with suppress(TangoError, OSError):
        if machine in history.machines():
            nights = history.nights(machine)
            last = next((n for n in nights if n.verdict != "not_measured"), None) if record["verdict"] == "not_measured" else None
            within = last_within([(n.night, n.verdict) for n in nights])
            before = None if last is None else history.night(last.entry).record
            known = {"decisions": history.decisions(machine), "before": before, "within": within}
            return known | {"written": last_written(compensations(history, machine))}
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
    from ..nightly.install import advice, units

    if not re.fullmatch(r"([01]\d|2[0-3]):[0-5]\d", at):
        raise InputError(f"--at: found {at!r}; allowed: a time of day such as 02:00")
    target = cell.folder / "nights" / "timer"
    written = units(kind, cell.folder.resolve(), at, cell.machine.name)
    for name, text in written.items():
        write_text(target / name, text)
    click.echo("\n".join(str(target / name) for name in written))
    click.echo(f"to set it going:\n    {advice(kind, list(written), target)}")
    return 0


def _looked_at(place: str | Path) -> str | Path:
    """history → itself, or an empty one in memory where the file is missing, so that a mere look creates no file."""
    return "sqlite://" if isinstance(place, Path) and not place.exists() else place


def _tell(disk: Any, mail: Any) -> int:
    from ..nightly.night import delivered

    failed = 0
    for stamp, words in disk.unsent():
        deliveries = delivered(disk, mail, stamp, words)
        if all(d.sent for d in deliveries):
            click.echo(f"sent: {words.partition(chr(10))[0]}")
        for delivery in deliveries:
            if not delivery.sent:
                failed += 1
                click.echo(f"not sent: {delivery.to}: {delivery.why}", err=True)
    for stamp, _ in disk.unfinished():
        click.echo(f"the night {stamp} was begun and has not ended; the next one puts it on record", err=True)
    return 3 if failed else 0


def _dry(control: Any, analysis: Any, history: Any, now: datetime, disk: Any, settings: Nightly, json_file: str | None) -> int:
    from ..nightly import day_of
    from ..nightly.night import room

    kind, why, touches = analysis.choice(history, day_of(now))
    points = [room(disk, settings), *control.preflight(kind, touches)]
    count = len(touches) or len((analysis.check or analysis.cell).strategy.indexations)
    data = {
        **{"format": "tango-nightly-dry-run/1", "kind": kind, "why": why, "touches": list(touches)},
        **{"preflight": [vars(p) for p in points], "passed": all(p.passed for p in points)},
    }
    if not write_json(json_file, data):
        what = f"{count} touches" if touches else "the whole strategy" if kind == "full" else "check.yaml"
        click.echo(f"this night would be a {kind} one ({why}): {what}")
        for p in points:
            click.echo(f"  {'ok    ' if p.passed else 'FAILED'} {p.check}: {p.found}{'; ' + p.do if p.do else ''}")
        click.echo("nothing was moved, nothing was kept")
    return 0 if data["passed"] else 1


def _status(folder: Path, settings: Nightly, wrong: TangoError | None, where: str | None, disk: Any, json_file: str | None) -> int:
    from ..history import opened
    from ._unreadable import machine_of

    name = ""
    try:
        name = read_cell(folder).machine.name
    except TangoError as error:
        wrong = wrong or error
    with opened(_looked_at(history_of(folder, settings, where))) as history:
        name = name or machine_of(folder, history.machines())
        nights = history.nights(name, last=7) if name in history.machines() else ()
        newest = max(nights, key=lambda n: n.end_utc, default=None)  # one that was refused began after the one at work
        waiting = [stamp for stamp, _ in disk.unsent()]
        unfinished = [stamp for stamp, _ in disk.unfinished()]
        alarms = history.open_alarms(name) if nights else ()
        record = history.night(newest.entry).record if newest else {}
    late = (
        newest is None
        or (datetime.now(UTC) - datetime.fromisoformat(newest.start_utc)).total_seconds() > settings.late_hours * 3600
    )
    data = {
        **{"format": "tango-nightly-status/1", "machine": name, "late": late, "waiting": waiting, "unfinished": unfinished},
        "trouble": None if wrong is None else str(wrong),
        **{"open_alarms": list(alarms), "nights": [vars(n) for n in nights], "next": record.get("next")},
    }
    if not write_json(json_file, data):
        click.echo(f"{name}: {'no night yet' if not nights else 'LATE' if late else 'on time'}")
        if wrong is not None:
            click.echo(f"  no night can begin: {wrong}")
        for n in nights:
            click.echo(f"  {n.night} {n.kind:5} {n.status:8} {n.verdict:13} {n.headline}")
        for alarm in alarms:
            click.echo(
                f"  open alarm {alarm['id']}: {alarm['text']}; 'tango history decide {alarm['id']} --action … --owner …' answers it"
            )
        for stamp in waiting:
            click.echo(f"  not sent yet: {stamp}; 'tango nightly --tell' sends it again")
        for stamp in unfinished:
            click.echo(f"  begun and not ended: {stamp}")
        if record.get("next"):
            click.echo(f"  next night: {record['next']['kind']} ({record['next']['why']})")
    return 1 if late or alarms or wrong is not None else 0
