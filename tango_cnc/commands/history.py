"""`tango history`: what the nights found, and what was decided about it."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..files import read_cell, write_text
from ..files.nightly import history_of, read_nightly
from ..records import InputError
from ..report.repeated import shortened
from ..report.units import shown
from ..texts import say
from ._common import fitted, json_option, on_terminal, table, write_json
from ._handed import handed
from ._many_nights import TEMPERATURE, broken_chains, each_of, followed, heads, lines, trend_of
from ._shop import headlines, here, note_simulated

if TYPE_CHECKING:
    from ..history import Compensation, History
    from ..report.texts import Texts

PLACE = "Keep 20"


@click.group()
@click.option("-C", "folder", type=click.Path(path_type=Path), metavar="DIR", help="The cell; may also follow the command.")
@click.pass_context
def command(context: click.Context, folder: Path | None) -> None:
    """Lists, shows, plots, compares and exports what the nights of a machine found, and keeps what was decided.

    The history is that of the cell (-C, default: here) or a FILE or URL with --history.
    """
    if folder is not None:
        context.default_map = {name: {"folder": folder} for name in command.commands}


def _options(machine: bool = True) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """→ decorator: -C, --history and --machine become the open history and the name of the machine."""

    def decorate(call: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(call)
        def run(folder: Path, where: str | None, name: str | None = None, **given: Any) -> Any:
            from ..history import opened

            with handed():
                place = _place(folder, where)
                with opened(place, create=False) as history:
                    chosen = _machine(history, folder, name) if machine else name
                    return call(history, chosen, **given)

        wanted = run
        if machine:
            wanted = click.option("--machine", "name", metavar="NAME", help="Where a history has several machines.")(wanted)
        wanted = click.option("--history", "where", metavar="FILE|URL", help="Instead of the history of the cell.")(wanted)
        return click.option("-C", "folder", type=click.Path(path_type=Path), default=Path("."), metavar="DIR", help="The cell.")(
            wanted
        )

    return decorate


def _place(folder: Path, where: str | None) -> str | Path:
    return history_of(folder, read_nightly(folder), where)


def _machine(history: History, folder: Path, name: str | None) -> str:
    known = history.machines()
    if name is not None:
        if name not in known:
            raise InputError(f"--machine: found {name!r}; allowed: {', '.join(known) or 'none yet'}")
        return name
    if (folder / "tango.yaml").exists() and (own := read_cell(folder).machine.name) in known:
        return own
    if len(known) == 1:
        return known[0]
    if not known:
        raise InputError("history: it holds no night yet; 'tango nightly' adds one, 'tango history import' those of old cells")
    raise InputError(f"--machine: found none; allowed: {', '.join(known)}")


def _night(history: History, machine: str, which: str) -> int:
    """history, machine, 'last', a date or the number of an entry → the entry. Raises InputError."""
    nights = history.nights(machine)
    if not nights:
        raise InputError(f"history: found no night of {machine} yet; 'tango nightly' adds one, 'tango history list' shows the rest")
    found = [n for n in nights if which in ("last", str(n.entry), n.night, n.start_utc)]
    if not found:
        raise InputError(f"night: found {which!r}; allowed: last, a date such as {nights[0].night}, the number of a night's entry")
    measured = [n for n in found if n.touches]
    return (measured or found)[0].entry


@command.command("list")
@_options()
@click.option("--last", type=click.IntRange(1), help="How many nights, newest first [default: all].")
@click.option("--since", metavar="DATE", help="From this date on.")
@json_option
def list_(history: History, machine: str, last: int | None, since: str | None, json_file: str | None) -> None:
    """Nights and what happened to compensations, newest first."""
    from ..history import compensations
    from ..report.texts import code

    nights = history.nights(machine, last, since)
    events = compensations(history, machine, nights[-1].start_utc if last is not None and nights else since)
    data = {"nights": [vars(n) for n in nights], "compensations": [vars(e) for e in events]}
    if write_json(json_file, {"format": "tango-history-list/1", "machine": machine, **data}):
        return
    t, known = here(), headlines(history, nights)
    rows = []
    for n, text in zip(nights, shortened([known[n.entry] for n in nights]), strict=True):
        volume = "" if n.volume_um is None else f"{n.volume_um:.1f}"
        words = [t.of(code(word)) for word in (n.kind, n.status, n.verdict)]
        rows.append((n.start_utc, n.entry, [n.night, _at(n.start_utc), *words, volume, " ".join(t.of(text).split())]))
    for e in events:
        rows.append((e.utc, e.entry, ["", _at(e.utc), t("cli.history.compensation"), e.event, "", "", _said(e, t)]))
    rows.sort(key=lambda row: row[:2], reverse=True)
    head = heads(t, "entry", "date", "", "kind", "status", "verdict", "", "what")
    head[2], head[6] = t("cli.history.begun", zone=datetime.now().astimezone().strftime("%Z")), "µm"
    note_simulated(history, machine, t)
    click.echo(table([head, *([str(entry), *row] for _, entry, row in rows)], "><<<<<><", on_terminal()))


def _at(utc: str) -> str:
    """moment (UTC) → 2026-11-23 03:00 by the clock of this computer: nights and compensations stand in the order of this one."""
    return datetime.fromisoformat(utc).astimezone().strftime("%Y-%m-%d %H:%M")


def _said(event: Compensation, t: Texts) -> str:
    what = f"{event.number} ({event.target})"
    if event.event == "proposed" and event.before_um is not None and event.promised_um is not None:
        sizes = {"promised": f"{event.promised_um:.2f}", "before": f"{event.before_um:.2f}"}
        return t("cli.history.left", number=what, **sizes)
    return f"{what}: {event.text}" if event.text else what


@command.command()
@_options()
@click.argument("night", default="last")
@click.option("--readings", "readings_file", type=click.Path(path_type=Path), metavar="FILE", help="Also write its readings.")
@json_option
def show(history: History, machine: str, night: str, readings_file: Path | None, json_file: str | None) -> None:
    """One night whole: last, a date, or the number of an entry."""
    from ..history.answers import every_decision
    from ..nightly.mail import message
    from ..report.tonight import by_tonight

    stored = history.night(_night(history, machine, night))
    if readings_file is not None:
        if stored.readings is None:
            raise InputError(f"--readings: the night {stored.night.night} has no readings")
        write_text(readings_file, stored.readings)
    data = dict(stored.record)
    if data.get("standing"):  # as the text does, the JSON says what an alarm did to a part by that night
        data["standing"] = [{**a, **by_tonight(a)} for a in data["standing"]]
    if write_json(json_file, data):
        return
    record: dict[str, Any] = {"artefacts": {"folder": ""}, **stored.record}
    t = here()
    click.echo(fitted("\n".join(message(record, (), (), None, every_decision(history, machine), t))))
    rows = [heads(t, "parameter", "value", "std", "change", "")]
    for name, p in (record.get("parameters") or {}).items():
        factor, unit = shown(p["unit"])
        change = "" if p.get("change") is None else f"{p['change'] * factor:+.2f}"
        rows.append([name, f"{p['value'] * factor:.2f}", f"{p['std'] * factor:.2f}", change, unit])
    click.echo(table(rows, "<>>><", on_terminal()))


@command.command()
@_options()
@click.argument("one")
@click.argument("other", default="last")
@json_option
def compare(history: History, machine: str, one: str, other: str, json_file: str | None) -> None:
    """Two nights: what differs, and by how many of its standard deviations."""
    a, b = (history.night(_night(history, machine, which)).record for which in (one, other))
    found = {}
    for name, p in (b.get("parameters") or {}).items():
        if name in (a.get("parameters") or {}):
            q = a["parameters"][name]
            spread = (p["std"] ** 2 + q["std"] ** 2) ** 0.5
            change = p["value"] - q["value"]
            found[name] = {"change": change, "unit": p["unit"], "std": spread, "sigmas": change / spread if spread else 0.0}
    data = {"format": "tango-history-compare/1", "machine": machine, "from": a["night"], "to": b["night"], "parameters": found}
    if write_json(json_file, data):
        return
    note_simulated(history, machine, here())
    if not found:
        without = next((n for n in (a, b) if not n.get("parameters")), None)
        key = "nothing_shared" if without is None else "in_doubt" if without.get("verdict") == "doubtful" else "no_values"
        raise InputError(
            say(f"cli.history.{key}", night="" if without is None else without["night"], one=a["night"], other=b["night"])
        )
    rows = [heads(here(), "parameter", "change", "std", "", "sigmas")]
    for name, f in sorted(found.items(), key=lambda item: -abs(item[1]["sigmas"])):
        factor, unit = shown(f["unit"])
        rows.append([name, f"{f['change'] * factor:+.2f}", f"{f['std'] * factor:.2f}", unit, f"{f['sigmas']:+.1f}"])
    click.echo(f"{a['night']} → {b['night']}\n{table(rows, '<>><>')}")


@command.command()
@_options()
@click.argument("parameter", nargs=-1)
@click.option(
    "-o", "output", type=click.Path(path_type=Path), metavar="FILE", help=".png, .svg or .pdf; without it: on the terminal"
)
@click.option("--chart", type=click.Choice(["none", "shewhart", "ewma", "cusum"]), default="none", show_default=True)
@click.option("--smooth", is_flag=True, help="As the past is known today, from the nights before and after; no chart.")
def plot(history: History, machine: str, parameter: tuple[str, ...], output: Path | None, chart: str, smooth: bool) -> None:
    """Parameters over the nights, with 95 % intervals; without names those that have moved most.

    Of the names that alarms have, scales is every linear scale, and temperature that of the nights.
    """
    from ..nightly.lookback import smooth as smoothed

    names = each_of(history, machine, parameter) or tuple(_moved(history, machine))
    if chart != "none" and smooth:
        raise InputError("--chart, --smooth: found both; allowed: one of them: a chart is of nights as they came")
    if TEMPERATURE in names and (chart != "none" or smooth):
        raise InputError("--chart, --smooth: found temperature; allowed: parameters, which the nights estimate")
    trends = [smoothed(history, machine, name) if smooth else trend_of(history, machine, name) for name in names]
    if output is None:
        if chart != "none":
            raise InputError("--chart: found no -o FILE; allowed: a chart in a file")
        note_simulated(history, machine, here())
        click.echo(lines(trends, {n.start_utc for n in history.nights(machine) if n.alarms}))
        return
    from ..history.picture import picture

    picture(history, machine, trends, output, None if chart == "none" else chart)
    click.echo(f"{', '.join(names)} → {output}")


def _moved(history: History, machine: str) -> list[str]:
    sizes = {}
    for name in history.parameters(machine):
        trend = history.trend(machine, name)
        sizes[name] = float((trend.value.max() - trend.value.min()) / max(trend.std.min(), 1e-12))
    return sorted(sizes, key=lambda name: -sizes[name])[:6]


@command.command()
@_options()
@json_option
def causes(history: History, machine: str, json_file: str | None) -> None:
    """What the parameters follow over many nights: the season, the temperature, wear since the last alarm, a drift."""
    from ..nightly.lookback import RARE, looked_back

    found = looked_back(history, machine)
    if write_json(json_file, {"format": "tango-history-causes/1", "machine": machine, "causes": [vars(f) for f in found]}):
        return
    t = here()
    note_simulated(history, machine, t)
    click.echo(followed(found, t))
    click.echo(t("cli.history.one_of", count=round(1 / RARE)))


@command.command()
@_options()
@click.argument("alarm")
@click.option("--action", type=click.Choice(["accept", "acknowledge", "repaired", "ignore"]), required=True)
@click.option("--owner", required=True, metavar="NAME", help="Who decides.")
@click.option("--note", default="", help="Why, for those who come later.")
@click.option("--until", metavar="DATE", help="With ignore: to hear nothing of it until then.")
def decide(history: History, machine: str, alarm: str, action: str, owner: str, note: str, until: str | None) -> None:
    """What somebody decided about an alarm; it is kept with the nights.

    accept: the machine is like this now, and that is good enough. The alarm is closed.

    acknowledge: somebody has it and looks into it. The alarm stays in every morning's message, with that name.

    repaired: somebody put it right. The alarm is closed. The next night measures everything, and alarms where it is not right.

    ignore: not now. Until the date of --until no alarm while it stays within what was seen: its size, and the rate of a drift. More
    than that alarms again, and every morning says what has moved.
    """
    from ..history import Decision
    from ..nightly.answered import meaning
    from ..nightly.mail import decided
    from ..report.texts import code

    before, t = [d for d in history.decisions(machine) if d.alarm == alarm], here()
    history.decide(machine, decision := Decision(alarm, action, owner, note, until))
    for d in before:
        click.echo(t("cli.history.decided_before", text=decided(replace(d, note=""))))
    click.echo(t("cli.history.decided", alarm=alarm, action=code(action), owner=owner))
    click.echo(t.of(meaning(history, machine, decision)))


@command.command()
@_options()
@click.argument("output", type=click.Path(path_type=Path))
@click.option("--as", "kind", metavar="KIND", help="csv, parquet, qdas, isg or dcc [default: by the ending of the file].")
@click.option("--night", default="last", show_default=True, help="Of isg and dcc: which night; last of isg is the last full one.")
@click.pass_context
def export(context: click.Context, history: History, machine: str, output: Path, kind: str | None, night: str) -> None:
    """Parameters of all nights (CSV, Parquet, Q-DAS .dfq), or one night (ISG/Etalon, digital calibration certificate).

    ISG/Etalon (isg) is the errors themselves, actual minus commanded; it is estimated from the readings of the night with the cell.
    """
    from ..history import exchange
    from ._export_isg import full_night, write

    if kind == exchange.ESTIMATED:
        entry = full_night(history, machine) if night == "last" else _night(history, machine, night)
        write(history, context.params["folder"], output, entry)
    else:
        exchange.target(kind, output).write(history, machine, output, _night(history, machine, night))
    click.echo(f"{machine} → {output}")


@command.command()
@_options(machine=False)
@click.option(
    "--holds", "digest", metavar="HASH", help="Of a morning's message: is the entry still there that was the newest then?"
)
@json_option
def verify(history: History, machine: str | None, digest: str | None, json_file: str | None) -> int:
    """Follows the chain of hashes: is everything as it was added, and nothing gone?"""
    from ..history.guards import unguarded

    wrong = (*history.verify(), *unguarded(history.engine))
    newest = history.newest_hashes()
    if digest is not None and not history.holds(digest.strip().lower()):
        wrong = (*wrong, say("cli.history.cut_off", digest=digest))
    if not write_json(json_file, {"format": "tango-history-verify/1", "wrong": list(wrong), "newest": newest}):
        t = here()
        for name, (number, digest) in newest.items():
            click.echo(t(f"cli.history.newest{'_one' if number == 1 else ''}", machine=name, count=number, digest=digest))
        click.echo("\n".join(t.of(text) for text in wrong) if wrong else t("cli.history.whole"))
    return 1 if wrong else 0


@command.command("import")
@click.argument("cells", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("-C", "folder", type=click.Path(path_type=Path), default=Path("."), metavar="DIR", help="The cell.")
@click.option("--history", "where", metavar="FILE|URL", help="Instead of the history of the cell.")
@click.option("--despite", is_flag=True, help="Also readings of a machine with another name, and such as somebody has edited.")
def import_(cells: tuple[Path, ...], folder: Path, where: str | None, despite: bool) -> None:
    """Adds the readings of old cells, oldest first: each folder with readings.csv and readings.json becomes a full night."""
    from ..history import opened
    from ._import import imported

    with opened(_place(folder, where)) as history:
        for cell, record in imported(history, cells, folder, despite):
            click.echo(f"{cell}: {record['night']} {record['verdict']}: {record['headline']}")


@command.command()
@_options(machine=False)
@click.argument("output", type=click.Path(path_type=Path))
def backup(history: History, machine: str | None, output: Path) -> int:
    """The whole history as one SQLite file, verified, while nights may go on.

    A chain that somebody has broken is copied as it is, and named. Exit status 1 then.
    """
    from ..history.copy import copied

    if output.exists():
        raise InputError(f"{output}: it exists; allowed: a new file")
    count, wrong = copied(history, output)
    click.echo(here()(f"cli.history.entries{'_one' if count == 1 else ''}", count=count, file=str(output)))
    return broken_chains(wrong, here())


@contextmanager
def _set_aside(place: str | Path) -> Iterator[Path | None]:
    """place of a history → within it the one that is there has another name, which is given; after an error its own again."""
    if not isinstance(place, Path) or not place.exists():
        yield None
        return
    kept = Path(f"{place}.{datetime.now(UTC).strftime('%Y%m%dT%H%M%S')}")
    files = [(Path(f"{place}{ending}"), Path(f"{kept}{ending}")) for ending in ("", "-wal", "-shm")]
    moved = [(old, new) for old, new in files if old.exists()]
    for old, new in moved:
        shutil.move(old, new)
    try:
        yield kept
    except BaseException:
        for old, _ in files:
            old.unlink(missing_ok=True)
        for old, new in moved:
            shutil.move(new, old)
        raise


@command.command()
@click.argument("source", type=click.Path(path_type=Path))
@click.option("-C", "folder", type=click.Path(path_type=Path), default=Path("."), metavar="DIR", help="The cell.")
@click.option("--history", "where", metavar="FILE|URL", help="Instead of the history of the cell.")
def restore(source: Path, folder: Path, where: str | None) -> int:
    """A backup becomes the history. One that is there is kept beside it; a database that is not empty is refused.

    A chain that was broken in it is named. Exit status 1 then.
    """
    from ..history import opened, shown
    from ..history.copy import copied

    place = _place(folder, where)
    with opened(source, create=False) as history, _set_aside(place) as kept:
        count, wrong = copied(history, place)
    if kept is not None:
        click.echo(here()("cli.history.kept_beside", file=str(kept)), err=True)
    click.echo(here()(f"cli.history.entries{'_one' if count == 1 else ''}", count=count, file=shown(place)))
    return broken_chains(wrong, here())


@command.command()
@click.argument("output", type=click.Path(path_type=Path))
@click.option("-C", "folder", type=click.Path(path_type=Path), default=Path("."), metavar="DIR", help="The cell, with world.yaml.")
@click.option("--nights", "count", type=click.IntRange(1, 4000), default=30, show_default=True)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
def simulate(output: Path, folder: Path, count: int, seed: int) -> None:
    """Nights of a simulated machine that drifts, is knocked on night 12 and warms from night 20, as a history to look at.

    The last one is last night. Owner and limits are those of nightly.yaml.
    """
    from ..files import read_world
    from ..history import opened
    from ._simulated_nights import nights

    if output.exists():
        raise InputError(f"{output}: it exists; allowed: a new file")
    cell, world = read_cell(folder), read_world(folder / "world.yaml")
    settings = replace(read_nightly(folder), diagnose=False)
    last = (datetime.now().astimezone() - timedelta(hours=3)).replace(hour=2, minute=0, second=0, microsecond=0)
    first = last - timedelta(days=count - 1)
    with opened(output) as history:
        for record, _ in nights(cell, world, history, count, seed, settings=settings, first=first):
            click.echo(f"{record['night']} {record['kind']:5} {record['verdict']:13} {record['headline']}")
    click.echo(f"→ {output}")
