"""`tango fleet`: list all machines: answers, alarms, overdue measurements."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..files import read_cell
from ..files.nightly import Nightly, history_of, read_nightly
from ..link.lock import broken_off, cut_off, ended
from ..link.progress import minutes_left
from ..records import InputError, Machine, TangoError
from ..report.newer import newer_answer
from ..report.repeated import as_found, on_another_day
from ..report.tonight import is_unsure, sized
from ..texts import instead, joined, say, unstopped
from ._answered import answer_now, in_short, run_without_report, unanswered
from ._beside import alone, beside
from ._common import cells_in, folders_option, json_option, on_terminal, table, write_json
from ._shop import ENDED, headlines, note_simulated

if TYPE_CHECKING:
    from ..history import History, Night, Standing
    from ..report.answer import Answer, May
    from ..report.texts import Texts

PLACE = "Keep 30"
LATE = Nightly().late_hours  # of a history alone
PATIENCE = 20.0  # s for which somebody at a terminal waits for a database that does not answer
AT_ONCE = 64  # servers with a history that are asked at the same time
NIGHTS = 14  # of the sparkline of the tool tip


@dataclass(frozen=True)
class _Known:
    """A cell whose nights are looked for."""

    folder: Path
    name: str  # of its machine
    late_hours: float
    answers_for: float  # days
    axes: Machine


@dataclass(frozen=True)
class _Row:
    """A line of the list."""

    standing: Standing
    cell: Path | None
    tip: tuple[float, ...] = ()  # µm of the last nights, oldest first
    said: str = ""
    former: bool = False  # another name of a machine that has a line of its own
    cut_off: tuple[str, ...] = ()  # nights of its cell that were begun and never ended
    moving: str = ""  # the answer of its page, where its control may still execute a program
    stale: int = 0  # nights since the last measurement, where these are too many for an answer of today
    left: int | None = None  # minutes that a run or a night still takes which is at work in its cell
    told: Answer | None = None  # the answer of its page, where the verdict of its newest night is not all of it
    ran: str = ""  # when a run after its newest night began of which no report was written (UTC)
    unsure: bool = False  # whether nobody knows if the last night that measured was within its limits
    unanswered: int | None = None  # causes without an answer, as pages count them, where that may be less than its alarms

    @property
    def wants_somebody(self) -> bool:
        """→ whether somebody has to look; of a former name because of an alarm without an answer alone."""
        if self.former:
            return self.standing.alarms_open > 0
        of_cell = self.cut_off or self.stale or self.moving or self.unsure or self.by_newer("no", "but")
        return bool(of_cell) or self.standing.wants_somebody

    def by_newer(self, *may: May) -> bool:
        """answers → whether newer readings have given the answer of its page, and it is one of them."""
        return self.told is not None and self.told.by_newer(*may)


@click.command()
@click.argument("cells", nargs=-1, type=click.Path(path_type=Path))
@folders_option
@click.option("--history", "where", metavar="FILE|URL", help="One history of many machines, e.g. postgresql://….")
@click.option(
    "--late",
    type=click.FloatRange(1, 10_000),
    metavar="HOURS",
    help="Late after this, without a complete night [default: late_hours of nightly.yaml, 36 without it].",
)
@alone("CELLS", "-C", "--history", "--dask", "--json")(
    "--again",
    "target",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Estimate all nights of the cells again, into this folder.",
)
@beside("--again")("--dask", metavar="ADDRESS", help="With --again: spread the machines over a Dask cluster, tcp://host:port.")
@json_option
def command(
    cells: tuple[Path, ...],
    folders: tuple[Path, ...],
    where: str | None,
    late: float | None,
    target: Path | None,
    dask: str | None,
    json_file: str | None,
) -> int:
    """Last night of every machine: who is late, who alarms, who is fine.

    Of one history (--history), or of the histories of the cells that are named. Exit status 1 when a machine needs somebody: it is
    late, an alarm has no answer, or its last night was out of limits, not certain to be within them, in doubt or measured nothing.

    --again estimates the whole history of the cells once more, after a change of the model: into new files, one a machine. What
    was cut off goes on when it is called again.
    """
    from ..report.texts import texts

    cells = tuple(c for cell in (*cells, *folders) for c in cells_in(cell) or [cell])
    cells = cells or (() if where is not None else tuple(cells_in(Path("."))))
    if target is not None:
        return _again(cells, where, target, dask, json_file)
    if (where is None) == (not cells):
        raise InputError("fleet: found neither or both of cells and --history; allowed: folders of cells, or one history")
    trouble: dict[str, str] = {}
    places = {where if "://" in where else Path(where): []} if where else _places(cells, trouble)
    found = _rows(places, len(cells), late, trouble, texts() if json_file is None else None)
    if not write_json(json_file, {"format": "tango-fleet/1", "machines": _as_json(found), "unreadable": trouble}):
        click.echo(table(_table(found, texts()), "<<<><<<", on_terminal()))
    for folder, why in trouble.items():
        click.echo(texts()("cli.fleet.unreadable", cell=folder, why=why), err=True)
    return 1 if trouble or any(row.wants_somebody for row in found) else 0


def _rows(
    places: Mapping[str | Path, Sequence[_Known]], cells: int, late: float | None, trouble: dict[str, str], t: Texts | None
) -> list[_Row]:
    """{history: cells that name it}, how many cells in all, --late, {cell: why it cannot be read} that is added to, texts of notes
    on stderr → a line a machine, those first that want somebody.
    """
    from ..history import opened

    found: list[_Row] = []
    now = datetime.now(UTC).isoformat()
    off = _not_answering([place for place in places if isinstance(place, str)]) if cells > 1 else {}
    for place, known in places.items():
        if place in off:
            trouble |= {str(c.folder): off[place] for c in known}
            continue
        if cells > 1 and isinstance(place, Path) and not place.exists():
            found += [_Row(_never(c.name), c.folder) for c in known]  # no night yet
            continue
        try:
            with opened(place, create=False, patience=PATIENCE) as whole:
                found.extend(
                    _of_history(whole.as_of(lambda: datetime.fromisoformat(now)), place, known, late, now, t)
                )  # those before an error stay
        except TangoError as error:  # one machine that cannot be read hides no other one
            if not known or cells == 1:
                raise
            trouble |= {str(c.folder): str(error) for c in known}
    clock = time.time()
    found = [
        row
        if row.former or row.cell is None
        else replace(row, cut_off=tuple(cut_off(row.cell)), left=minutes_left(row.cell, clock))
        for row in found
    ]
    return sorted(found, key=lambda row: (not row.wants_somebody, row.standing.machine, str(row.cell)))


def _not_answering(servers: Sequence[str]) -> dict[str | Path, str]:
    """URLs of histories → those that cannot be read, and why: all are asked at once, as one that is silent takes `PATIENCE`."""
    from ..history import opened

    def ask(where: str) -> str:
        try:
            with opened(where, create=False, patience=PATIENCE) as history:
                history.machines()
        except TangoError as error:
            return str(error)
        return ""

    with ThreadPoolExecutor(AT_ONCE) as threads:
        return {where: why for where, why in zip(servers, threads.map(ask, servers), strict=True) if why}


def _of_history(
    history: History, place: str | Path, known: Sequence[_Known], late: float | None, now: str, t: Texts | None
) -> Iterator[_Row]:
    """history, where it is, cells that name it (none: all machines), --late, UTC, texts of notes on stderr → their lines."""
    wanted = {c.name: late or c.late_hours for c in known} or {"": late or LATE}
    own = [s for name, most in wanted.items() for s in history.fleet(now, most) if name in ("", s.machine)]
    for s in own:
        yield from _of_machine(history, place, s, next((c for c in known if c.name == s.machine), None), late)
        if t is not None:
            note_simulated(history, s.machine, t)
    there = {s.machine for s in own}
    yield from (_Row(_never(c.name), c.folder) for c in known if c.name not in there)
    for c in known:
        yield from _former(history, place, c, known, c.name not in there)


def _of_machine(history: History, place: str | Path, s: Standing, cell: _Known | None, late: float | None) -> Iterator[_Row]:
    """history, where it is, standing of a machine, its cell, --late → its line, and one for nights that are dated in the future."""
    from ..history import Standing
    from ..history.clock import asks, in_future, told
    from ..report.texts import texts

    nights = history.nights(s.machine, last=NIGHTS)
    tip = [math.nan if n.volume_um is None else n.volume_um for n in reversed(nights)]
    said = headlines(history, nights[:1], by_now=False)[nights[0].entry] if nights else ""
    record = history.night(nights[0].entry).record if nights else {}
    said = on_another_day(as_found(said, record), record)
    if nights and nights[0].night < f"{datetime.now().astimezone():%Y-%m-%d}":  # it is read on another day
        said = instead(said, "last night", say("check.night_before", date=nights[0].night))
    said = sized(said, record)
    stale = _stale(history, nights, Nightly(late_hours=late or LATE).answers_for if cell is None else cell.answers_for)
    folder = None if cell is None else cell.folder
    newer, page = newer_answer(folder, record.get("end_utc")), None
    if cell is not None and nights and (newer is not None or nights[0].verdict == "not_measured"):
        with suppress(TangoError):
            page = answer_now(cell.folder, cell.axes, place, newer, texts())
    more: dict[str, Any] = {"moving": _moving(history, nights, folder, stale), "stale": stale, "told": page}
    more["ran"] = "" if folder is None else run_without_report(folder, record)
    more["unsure"] = bool(nights) and is_unsure(_before(history, nights) or record)
    if s.alarms_open > 1:  # of two of one cause pages have one
        axes = None if cell is None else cell.axes
        more["unanswered"] = unanswered(history, s.machine, axes, _before(history, nights), texts())
    yield _Row(s, folder, tuple(tip), said, **more)
    if (future := in_future(history, s.machine)) is not None:
        yield _Row(Standing(s.machine, future, s.nights, int(asks(future)), False), folder, (), told(future), former=True)


def _as_json(found: Sequence[_Row]) -> list[dict[str, Any]]:
    """lines → machines of tango-fleet/1."""
    return [
        {
            **vars(row.standing),
            "alarms_unanswered": row.standing.alarms_open,
            "last": None if row.standing.last is None else vars(row.standing.last) | ({} if row.former else {"headline": row.said}),
            "cell": None if row.cell is None else str(row.cell),
            "cut_off": row.cut_off,
            "stale_nights": row.stale,
            "moving": bool(row.moving),
            "measuring_minutes_left": row.left,
            "newer_no": row.by_newer("no"),
            "newer_but": row.by_newer("but"),
            "run_without_report": row.ran or None,
            "newer_beside": (row.told.beside if row.told is not None else "") or None,
        }
        for row in found
    ]


def _table(found: Sequence[_Row], t: Texts) -> list[list[str]]:
    """lines, texts → the table that is printed, its heads first."""
    from ..report.age import night_of_stamp
    from ..report.characters import sparkline
    from ..report.days import at
    from ..report.texts import code

    heads = [t("cli.fleet.machine"), t("cli.fleet.last_night"), t("cli.history.verdict"), t("cli.fleet.alarms")]
    rows = [[*heads, "", t("cli.fleet.tip"), t("cli.history.what")]]
    named = Counter(row.standing.machine for row in found)
    for row in found:
        s = row.standing
        last = (t("cli.fleet.never"), "") if s.last is None else (s.last.night, code(s.last.verdict))
        size = "" if s.last is None or s.last.volume_um is None else f"{s.last.volume_um:.1f}"
        late = t("cli.nightly.stale", nights=row.stale) if row.stale else t("cli.nightly.late") if s.late and s.last else ""
        how_long = t("web.left_short" if row.left else "web.begun_short", minutes=row.left)
        busy = row.left is not None and f"{t('may.measuring')}, {how_long}"
        measured = s.last is not None and s.last.verdict != "not_measured"
        by_page = "" if measured and row.told is not None and row.told.beside else _told(row.told, t)  # its verdict says the No
        late = busy or row.moving or by_page or late
        known = () if row.told is None else in_short(row.told) if by_page else (unstopped(row.told.beside),)
        name = s.machine if named[s.machine] == 1 or row.cell is None else f"{s.machine} ({row.cell})"
        drawn = f"{sparkline(row.tip, NIGHTS):<{NIGHTS}} {size:>6}".rstrip()
        ran = unstopped(t("web.ran_since", date=at(row.ran, t))) if row.ran and row.left is None else ""
        how = {} if row.cell is None else ended(row.cell, row.cut_off)
        keys = {stamp: f"cli.nightly.{ENDED.get(how.get(stamp, ''), 'cut_off')}" for stamp in row.cut_off}
        cut = joined("; ", [t(key, stamp=night_of_stamp(stamp)) for stamp, key in keys.items()])
        count = s.alarms_open if row.unanswered is None else row.unanswered
        rows.append([name, *last, str(count or ""), late, drawn, joined("; ", [x for x in (cut, *known, ran, row.said) if x])])
    return rows


def _told(told: Answer | None, t: Texts) -> str:
    """answer of the page of a machine → what stands beside its alarms: by newer readings, or a No of a night that measured
    nothing; '' where the verdict of its newest night says it.
    """
    if told is None or (not told.newer and told.may != "no"):
        return ""
    from ..report.orders import low

    return f"{told.word}, {low(t('morning.newer'))}" if told.newer else told.word


def _former(history: History, place: str | Path, own: _Known, known: Sequence[_Known], new: bool) -> list[_Row]:
    """history, where it is, a cell, all cells that name this history, whether it has no night yet → a line for every other name
    of its machine with an alarm that nobody has closed, or with nights where it has none. It asks for somebody by its alarms only.
    """
    from ..history import Standing
    from ..history.former import formers, of_folder

    rows = []
    for f in formers(history, own.name, own.folder, of_folder(place, own.folder), {c.name for c in known}):
        if f.alarms or f.held or new:
            last = history.nights(f.machine, last=1)[0]
            standing = Standing(f.machine, last, f.nights, len(f.alarms), False, len(f.held))
            rows.append(_Row(standing, own.folder, (), f.told(own.name, new), former=True))
    return rows


def _stale(history: History, nights: Sequence[Night], most: float) -> int:
    """history, last nights of a machine, days for which a result is an answer → nights since it was measured, 0 where it is one."""
    from ..report.age import due, measured_on, nights_old
    from ..report.days import local_day

    last = next((n for n in nights if n.verdict != "not_measured"), None)
    measured = (
        max(local_day(last.end_utc), last.night)
        if last is not None
        else measured_on(history.night(nights[0].entry).record)
        if nights
        else ""
    )
    return nights_old(measured, due(datetime.now(UTC), "" if last is None else last.start_utc), most)


def _moving(history: History, nights: Sequence[Night], folder: Path | None, stale: int) -> str:
    """history, last nights of a machine, its cell, nights since it was measured where these are too many → the answer of its page
    where its control may still execute a program, else ''.
    """
    from ..report.answer import of_moving, said_broken_off, said_cut_off
    from ..report.texts import texts

    cut = () if folder is None else cut_off(folder)
    off = () if folder is None else said_broken_off(broken_off(folder))
    former = off if folder is None else (*said_cut_off(cut, ended(folder, cut)), *off)
    if not nights or not (former or nights[0].verdict == "not_measured"):
        return ""
    told = of_moving(history.night(nights[0].entry).record, texts(), _before(history, nights), former, stale)
    return "" if told is None else told.word


def _before(history: History, nights: Sequence[Night]) -> Mapping[str, Any] | None:
    """history, last nights of a machine, newest first → record of the last one that measured, where the newest did not."""
    last = next((n for n in nights if n.verdict != "not_measured"), None)
    return None if last is None or last.entry == nights[0].entry else history.night(last.entry).record


def _never(name: str) -> Standing:
    from ..history import Standing

    return Standing(name, None, 0, 0, True)


def _places(cells: Sequence[Path], trouble: dict[str, str]) -> dict[str | Path, list[_Known]]:
    """cells, {cell: why it cannot be read} that is added to → {history: the cells that name it}.

    Cells of one machine name stay apart by their folders: they are copied from each other. Raises InputError for the only cell.
    """
    places: dict[str | Path, list[_Known]] = {}
    for cell in dict.fromkeys(cells):
        try:
            settings = read_nightly(cell)
            known = _Known(cell, (axes := read_cell(cell).machine).name, settings.late_hours, settings.answers_for, axes)
            place = history_of(cell, settings)
            same = places.setdefault(place.resolve() if isinstance(place, Path) else place, [])
            if other := next((k for k in same if k.name == known.name), None):
                trouble[str(cell)] = say("cli.fleet.twin", name=known.name, folder=str(other.folder))
            else:
                same.append(known)
        except TangoError as error:
            if len(cells) == 1:
                raise
            trouble[str(cell)] = str(error)
    return places


def _again(cells: tuple[Path, ...], where: str | None, target: Path, dask: str | None, json_file: str | None) -> int:
    from contextlib import ExitStack

    from ..uncertainty.fleet import cluster
    from ._again import again

    if not cells:
        raise InputError("--again: found no cell; allowed: folders of cells, whose models and readings are used")
    with ExitStack() as stack:
        spread: Any = map if dask is None else stack.enter_context(cluster(dask))
        done = again(cells, where, target, spread)
    if not write_json(json_file, {"format": "tango-fleet-again/1", "machines": [vars(d) for d in done]}):
        names = ("machine", "again_nights", "again_now", "again_differ", "again_then", "again_alarms")
        rows = [[say(f"cli.fleet.{name}")[:] for name in names]]
        rows += [[d.machine, *(str(n) for n in (d.nights, d.added, d.differ, d.alarms_then, d.alarms_now))] for d in done]
        click.echo(table(rows, "<>>>>>"))
        click.echo(say("cli.fleet.again_kept", target=str(target)))
    return 0
