"""`tango nightly`: one night for a timer: measure, decide, keep, tell."""

from __future__ import annotations

import getpass
import re
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import click

from ..files import read_cell, write_text
from ..files.nightly import NAME, Nightly, history_of
from ..records import Cell, InputError, LinkError, TangoError
from ..report.texts import Texts
from ..texts import say
from ._beside import alone, stated
from ._common import address_of, attended, cell_option, controller_of, dialect, json_option, write_json
from ._handed import printed
from ._shop import looked_at, of_shop

PLACE = "Keep 10"
NOT_OF_TIMER = ("port", "history", "simulated", "json")  # options of a night that is typed
AT = "02:00"  # when a timer begins a night, where nothing else is asked for


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
@alone("-C", "--history", "--json")(
    "--status", "status", is_flag=True, help="Say how the last nights went, what waits to be sent, and what comes next."
)
@alone("-C")("--tell", "tell", is_flag=True, help="Send the messages that wait in nights/outbox, and end.")
@click.option(
    "--install", "kind", type=click.Choice(["systemd", "cron", "windows"]), help="Write the timer for this system, and end."
)
@click.option("--at", metavar="HH:MM", help=f"With --install: time of day.  [default: {AT}]")
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
    at: str | None,
    json_file: str | None,
) -> int:
    """Measures the machine, judges it, keeps the result and sends a message: one night, started by a timer.

    Nothing moves unless every point of the preflight has passed. Exit status 0: as it should be; 1: changed, out of limits, not
    certain to be within them, or in doubt; 2: wrong input; 3: not measured. Settings are in nightly.yaml (docs/nightly.md).
    """
    from ..history import opened
    from ..nightly import Ports, exit_of, night
    from ..nightly.night import sentence
    from ..nightly.notify import Notifier
    from ..plan import plan
    from ._cell_nights import nights_of, twin
    from ._compensated import recorded
    from ._cut_off import keep_readings, told_of_signals
    from ._night_world import RealClock, RealControl, RealDisk, locked
    from ._unreadable import OfAnother, settings_of

    if dry_run and kind is not None:
        raise InputError("--dry-run: found beside --install; allowed: one of them")
    if at is not None and kind is None:
        raise InputError(f"--at: found {at!r} without --install; a night would begin at once. Write the timer: --install and --at")
    _meant(folder, port)
    settings, wrong = settings_of(folder)
    disk, mail = RealDisk(folder), Notifier(settings.notify)
    t = of_shop(settings)
    if tell:
        return _tell(disk, mail, t)
    if status:
        from ._nightly_status import status as told

        return told(folder, settings, wrong, where, disk, json_file, t)
    begun = RealClock().now()
    stamp = begun.astimezone(UTC).strftime("%Y-%m-%dT%H%M%SZ")
    try:
        if wrong is not None:
            raise wrong
        cell = read_cell(folder)
        if kind is not None:
            return _install(cell, kind, at or AT)
        place = history_of(folder, settings, where)
        controller_of(cell)
        made = plan(cell)
        analysis = nights_of(cell, settings, made)
        control = RealControl(cell, settings, made, analysis.check, stamp, port, simulated, attended() and not dry_run)
        if dry_run:
            place = looked_at(place)
        with opened(place) as history:
            if dry_run:
                control.twin = partial(twin, history, cell.machine.name, folder, where)
                return _dry(control, analysis, history, begun, disk, settings, json_file, t)
            past: Any = history.as_of(lambda: begun)
            if (other := twin(past, cell.machine.name, folder, where)) is None:
                recorded(folder, history)
            else:  # the nights there are those of another machine
                past = OfAnother()
            unwritten = keep_readings(folder, control.planned)
            control.twin = lambda: other
            with told_of_signals() as ending:
                open_ = (*_noticed(history), *unwritten)
                world = Ports(_Held(begun), disk, control, mail, past, analysis, locked(folder), analysis.happened, ending, open_)
                record = night(cell.machine.name, str(folder.resolve()), settings, world)
            newest = _newest(past, record)
            seen = _known(past, record)
    except Exception as error:  # whatever it is: no night ends without a message
        if not dry_run and kind is None and ((folder / NAME).exists() or (folder / "nights").exists()):
            known = error if isinstance(error, TangoError) else TangoError(sentence(error))
            _unread(folder, settings, where, begun, disk, mail, known)
            if isinstance(error, OSError):  # it is no wrong input: the night was not measured
                raise LinkError(str(known)) from None
        raise
    try:
        from ..report import morning
        from ..report.units import Units

        for name, units in (("morning.html", Units()), ("morning.inch.html", Units("inch"))):  # as pages are asked for
            page = morning.render(record, units=units, folder=settings.templates, **seen)
            disk.write(Path(record["artefacts"]["folder"]).name, name, page)
    except (OSError, InputError) as error:  # a template that cannot be used hides no verdict
        why = str(error.strerror or error) if isinstance(error, OSError) else str(error)
        click.echo(t("night.night.not_written", name=f"{record['artefacts']['folder']}/morning.html", why=why), err=True)
    if not write_json(json_file, record):
        from ..nightly.mail import message

        subject, text = message(record, record.get("trouble", ()), (), newest, t=t)
        click.echo(f"{subject}\n\n{text}", nl=False)
    for delivery in record.get("notifications", ()):
        if not delivery["sent"]:
            click.echo(t("cli.nightly.unsent", to=delivery["to"], why=delivery["why"]), err=True)
    return exit_of(record)


class _Held:
    """A clock whose first look is the moment that named the folder of the night."""

    def __init__(self, first: datetime) -> None:
        self._first: datetime | None = first

    def now(self) -> datetime:
        """→ now, with the local zone."""
        first, self._first = self._first, None
        return first or datetime.now().astimezone()


def _noticed(history: Any) -> tuple[str, ...]:
    """history → what the message says of it: tables that anybody may change."""
    from ..history.guards import without_triggers

    open_ = without_triggers(history.engine)
    return (say("night.night.unguarded", tables=", ".join(open_)),) if open_ else ()


def _known(history: Any, record: Mapping[str, Any]) -> dict[str, Any]:
    """history, record of tonight → what its page needs beside it: decisions, last night that measured, last one in limits."""
    from ..history import compensations
    from ..history.answers import every_decision
    from ..report.morning import volumes_of
    from ..report.suspects import last_within, never_within

    machine = record["machine"]
    with suppress(TangoError, OSError):
        if machine in history.machines():
            nights = history.nights(machine)
            last = next((n for n in nights if n.verdict != "not_measured"), None) if record["verdict"] == "not_measured" else None
            signs = [(n.night, n.verdict) for n in nights]
            before = None if last is None else history.night(last.entry).record
            known: dict[str, Any] = {"decisions": every_decision(history, machine), "before": before, "within": last_within(signs)}
            unsure = history.unsure([n.entry for n in nights])
            known["unsure"] = {n.night for n in nights if n.entry in unsure}
            known |= {"never": never_within(signs), "volumes": volumes_of(nights), "signs": signs}
            return known | {"events": compensations(history, machine)}
    return {}


def _newest(history: Any, record: Mapping[str, Any]) -> tuple[int, str] | None:
    """history, record of tonight → entries and newest hash; None where it is not in the history."""
    with suppress(TangoError):
        return None if record.get("trouble") else history.newest_hashes().get(record["machine"])
    return None


def _unread(folder: Path, settings: Nightly, where: str | None, begun: datetime, disk: Any, mail: Any, error: TangoError) -> None:
    """Puts a night on record whose cell or history cannot be read, as far as that goes, and tells whoever is to be told."""
    from ..history import opened
    from ..nightly import Ports, night
    from ._cell_nights import twin
    from ._night_world import locked
    from ._unreadable import NoHistory, OfAnother, Unreadable, machine_of

    none, cell = Unreadable(error), str(folder.resolve())

    def begin(past: Any, name: str, noticed: Sequence[str] = ()) -> None:
        night(name, cell, settings, Ports(_Held(begun), disk, none, mail, past, none, locked(folder), noticed=noticed))

    with ExitStack() as stack:
        try:
            place = history_of(folder, settings, where)
            history = stack.enter_context(opened(place))
            name = machine_of(folder, history.machines())
            other = twin(history, name, folder, str(place))
        except TangoError as second:
            begin(NoHistory(second), machine_of(folder, ()))
        else:
            if other is None:
                begin(history, name, _noticed(history))
            else:  # the nights there are those of another machine: nothing of this one is put among them
                begin(OfAnother(), name, (say("night.night.of_another", name=name, other=other),))


def _meant(folder: Path, port: str | None) -> None:
    """cell, --port → nothing. Raises InputError for a port that no run can use: who typed it sees it, and no night is kept."""
    if port is None:
        return
    try:
        cell = read_cell(folder)
        link = "" if cell.controller is None else dialect(cell).link
    except TangoError:
        return  # a night says it, and tells whoever is to be told
    if link:
        address_of(cell, port, link)


def _install(cell: Cell, kind: str, at: str) -> int:
    """cell, --install, --at → exit status; the timer is in nights/timer, and what to do with it is said."""
    from ..nightly.install import ENCODING, advice, skipped, units

    if lost := [f"--{name}" for name in NOT_OF_TIMER if stated(name)]:
        raise InputError(
            f"{lost[0]}: found with --install, and the timer would not have it; allowed: without it. A night that a timer begins "
            "has the port of tango.yaml and the history of nightly.yaml, and measures a real machine"
        )
    if not re.fullmatch(r"([01]\d|2[0-3]):[0-5]\d", at):
        raise InputError(f"--at: found {at!r}; allowed: a time of day such as 02:00")
    if cell.controller is not None and cell.controller.port is not None:
        from ..files.nightly import read_nightly
        from ._night_start import starts

        address_of(cell, None, dialect(cell).link)
        begins = starts(cell, cell.controller.port, read_nightly(cell.folder).control_starts_within)
        if begins is not None and not begins.passed:
            raise InputError(f"--install: found port {begins.found}; {begins.do}. No timer was written")
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


def _tell(disk: Any, mail: Any, t: Texts) -> int:
    """disk, mail, texts → exit status: 3 where a message that waits could not be sent again."""
    from ..nightly.night import delivered

    failed = 0
    for stamp, words in disk.unsent():
        deliveries = delivered(disk, mail, stamp, words)
        if all(d.sent for d in deliveries):
            click.echo(t("cli.nightly.sent", subject=words.partition("\n")[0]))
        for delivery in deliveries:
            if not delivery.sent:
                failed += 1
                printed(t("cli.nightly.not_sent", to=delivery.to, why=delivery.why), err=True)
    for stamp, _ in disk.unfinished():
        printed(t("cli.nightly.unfinished", stamp=stamp), err=True)
    return 3 if failed else 0


def _dry(
    control: Any, analysis: Any, history: Any, now: datetime, disk: Any, settings: Nightly, json_file: str | None, t: Texts
) -> int:
    """control, analysis, history, now, disk, settings, --json, texts → exit status: 1 where this night could not begin."""
    from ..nightly import day_of
    from ..nightly.night import room
    from ..report.texts import code

    kind, why, touches = analysis.choice(history, day_of(now))
    points = [room(disk, settings), *control.preflight(kind, touches)]
    count = len(touches) or len((analysis.check or analysis.cell).strategy.indexations)
    data = {
        **{"format": "tango-nightly-dry-run/1", "kind": kind, "why": why, "touches": list(touches)},
        **{"preflight": [p.as_json() for p in points], "passed": all(p.passed for p in points)},
    }
    if not write_json(json_file, data):
        what = t("cli.nightly.touches", count=count) if touches else t("cli.nightly.whole") if kind == "full" else "check.yaml"
        printed(t("cli.nightly.would_be", kind=code(kind), why=why, what=what))
        room_for = max(len(t("cli.nightly.ok")), len(t("cli.nightly.failed")))
        for p in points:
            word = t("cli.nightly.ok" if p.passed else "cli.nightly.failed")
            name = t(f"check_name.{p.check}") if f"check_name.{p.check}" in t else p.check
            printed(f"  {word:<{room_for}} {name}: {t.of(p.found)}{'; ' + t.of(p.do) if p.do else ''}")
        click.echo(t("cli.nightly.nothing_moved"))
    return 0 if data["passed"] else 1
