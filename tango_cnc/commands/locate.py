"""`tango locate`: where the table really stands, by a few touches with long slow searches."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from ..astray import AGREES, FILE
from ..files import artefact_text, read_cell, read_readings, write_text
from ..files.origin import set_aside
from ..files.targets import spared
from ..records import Cell, InputError, LinkError, NothingSentError
from ._beside import alone
from ._common import Output, address_of, asks_for_a_finger, cell_option, controller_of, json_option, json_text, writing
from ._handed import Kept, hands, whole
from ._live import Live
from ._start import counts, in_spindle
from ._written import conducted, said_beside, written

if TYPE_CHECKING:
    from ..locate import Located
    from ..probe_length import OtherLength
    from ..records import Plan, Readings
    from ..telling import OtherSize

PLACE = "Measure 40"  # in the list of commands
FAILED = 1  # exit status: the touches were made, and do not say where the table stands
KEPT = Kept(("port", "within", "stated", "length", "out"), {"file": ("port",)})
RESET = "reset while"  # in what a control says of its stop
FOLDER = "locate"  # of the cell: program, readings and the artefact in its place


@click.command()
@cell_option
@click.option("--port", metavar="URL", help="Default: controller.port of the cell.")
@alone("-C", "--within", "--agrees", "--length")(
    "--program", "only_program", is_flag=True, help="Write the program and stop: nothing is sent."
)
@alone("-C", "--within", "--agrees", "--length", "--out", "--json")(
    "--readings", "file", type=click.Path(path_type=Path), metavar="FILE", help="Readings of the locating program: nothing is run."
)
@click.option(
    "--within",
    type=click.FloatRange(1, 20),
    default=20.0,
    show_default=True,
    metavar="MM",
    help="How far from its file the table may stand; less means shorter searches.",
)
@click.option(
    "--agrees",
    "stated",
    type=click.FloatRange(0.01, 1.0),
    metavar="MM",
    help="How well artefact.yaml has the facets beside each other, and the size of the table; a drawing is right to some 0.3 mm. "
    "Default: 0.05 for the facets; nothing is stated of the size.",
)
@click.option(
    "--length",
    type=click.FloatRange(0, 1000, min_open=True),
    metavar="MM",
    help="Length of the probe as you have measured it today, from the reference point of the spindle to the centre of the ball. "
    "It has to be that of machine.yaml. Needed where the table is found higher or lower, and that would matter at another tilt.",
)
@click.option("--yes", is_flag=True, help="Do not ask before the machine moves.")
@click.option("-o", "--out", type=Output(), metavar="FILE", help="The artefact in its place; default: locate/artefact.yaml.")
@json_option
@hands(KEPT)
def command(
    folder: Path,
    port: str | None,
    only_program: bool,
    file: Path | None,
    within: float,
    stated: float | None,
    length: float | None,
    yes: bool,
    out: Path | None,
    json_file: str | None,
) -> None:
    """Finds where the table stands, when its file is right to 20 mm and 3 degrees only.

    Eight to eleven slow guarded searches from far, at one indexation. The artefact in its place goes into locate/artefact.yaml; the
    cell's own file stays as it is: look at the numbers, then copy it.
    """
    from .. import locate, probe_length, telling
    from ..duration import duration, spoken
    from ..link.lock import holding
    from ..plan import by_stylus, plan_hash
    from .check import positioning_feed

    agrees = stated or AGREES
    cell = by_stylus(read_cell(folder))[0]  # with the first stylus, where there are several
    if length is not None:
        probe_length.agrees(cell.machine, length)
    post = writing(cell) if file is None and controller_of(cell) else None
    address = None if post is None or only_program else address_of(cell, port, post.link)
    made = locate.strategy(cell, within=within)
    target = folder / FOLDER / "readings.csv"
    if post is not None:
        options = asks_for_a_finger(controller_of(cell).options)
        enough = min(max(len(made.touches) - locate.LEAST + 1, 2), 3)
        if counts(post):
            options["misses"] = enough  # by then too few are left to place the table, and a probe that has died presses on
        programs = written(cell, folder / FOLDER / "program", post, made, options)
        notice = whole(_notice(made, within, stated), KEPT)
        if address is None:
            said_beside(programs)
            lasts = spoken(sum(duration(made, positioning_feed(cell)).values()))
            then = whole("'tango locate --port 'file:///FOLDER/TANGO.TXT?from=last' --yes'", KEPT)
            click.echo(
                f"{programs[0].file}: run it ({lasts}), so that the control prints into a file. Then {then} makes readings of "
                "that file and says where the table stands"
            )
            click.echo(f"before it: {notice}")
            return
        if yes:
            click.echo(notice, err=True)
        gate, again = str(options.get("gate", "finger")), "'tango locate' makes all of them again"
        placed_in = out or folder / FOLDER / "artefact.yaml"
        with holding(folder, "tango locate"), Live(None) as live, _broken_off(placed_in, out, cell, made):
            readings = conducted(
                cell, post, made, programs, address, target, live, gate=gate, yes=yes, then=again, misses=enough, notice=notice
            )
    else:
        assert file is not None
        readings = read_readings(file, cell.machine, cell.artefact)
    where = out or folder / FOLDER / "artefact.yaml"
    before = set_aside(where) if out is None and post is not None else None
    try:
        found = locate.locate(made, readings, stated)
        placed = _by_length(made, readings, found, length is not None)
    except InputError as error:
        click.echo("" if post is None else "\n", nl=False, err=True)  # below the bar of the touches
        said = whole(str(error).rstrip("."), KEPT, FILE=file or target)
        click.echo(f"tango: {said}{_before(where, before)}", err=True)
        raise click.exceptions.Exit(FAILED) from None
    spared("-o", where, folder)
    write_text(where, artefact_text(found.artefact))
    known, unseen = telling.known_to(made.artefact, found.counted, agrees), telling.unseen(made.artefact, found.counted)
    other = telling.unsized(made.artefact, found.counted, stated)
    by, farthest = telling.unseen_by(made.artefact, found.counted, unseen)
    result: dict[str, Any] = {
        "format": "tango-located/1",
        "moved_mm": [round(float(v), 4) for v in found.moved],
        "turned_deg": [round(float(v), 5) for v in np.degrees(found.turned)],
        "residual_mm": [round(float(v), 4) for v in found.residual],
        "left_out": list(found.left_out),
        "missed": list(found.missed),
        "known_mm": round(known[0], 3),
        "unseen": list(unseen),
        "unseen_mm": round(by, 3),
        "unsized_mm": round(other.beside, 3),
        "unsized_deg": round(other.turned, 3),
        "longer_mm": round(placed.longer, 4),
        "longer_beside_mm": round(placed.beside, 3),
        "obstacles": list(found.obstacles),
        "plan_hash": plan_hash(made),
        "artefact": str(where),
    }
    if json_file == "-":
        click.echo(json_text(result))
        return
    if json_file is not None:
        write_text(Path(json_file), json_text(result) + "\n")
    _told(found, result, agrees, known[1], farthest, other, math.nan if length is not None else made.machine.probe.length)


def _by_length(made: Plan, readings: Readings, found: Located, measured: bool) -> OtherLength:
    """plan of the cycle, its readings, where the table stands, whether somebody has measured the probe → what a stylus of
    another length explains as well. Raises InputError where that is more than a short search finds, and nobody has measured.
    """
    from .. import locate, probe_length

    names = list(found.counted)
    here, there = (np.array([table.facets[name].point for name in names]) for table in (made.artefact, found.artefact))
    other = probe_length.of_length(made.machine, readings.position, here, there)
    if not measured and other.beside > locate.KNOWN:
        length = made.machine.probe.length
        raise InputError(
            f"the touches agree, and yet {other.text(length)}. Measure the probe in the spindle, {probe_length.WORDS}. If it is "
            f"{length:g} mm, 'tango locate --readings {FILE} --length {length:g}' places the table from these same touches; "
            "nothing moves. If it is not, correct machine.yaml (probe: length) and read the same touches again"
        )
    return other


@contextmanager
def _broken_off(where: Path, out: Path | None, cell: Cell, made: Plan) -> Iterator[None]:
    """file of the artefact in its place, that of -o, cell, plan of the cycle → within it, touches that do not come to their end
    say how to go on, and that what an earlier locating found is not of today: it is set aside. Raises LinkError.
    """
    try:
        yield
    except NothingSentError:
        raise
    except LinkError as error:
        from .. import locate

        aside, said, advice = set_aside(where) if out is None else None, str(error).rstrip("."), locate.advice(made)
        page, length = f"docs/controls/{controller_of(cell).post}.md", made.machine.probe.length
        asks = (
            f"Is the probe alive, and is it {length:g} mm long, as machine.yaml has it? If so, and nothing was in the way: "
            f"{advice[0].lower()}{advice[1:]}"
        )
        if RESET in said:  # neither the probe nor the place of the table did that
            asks = "What has reset the control: somebody at the panel, a door, a limit? See to that first"
        raise type(error)(
            f"{said}{'' if said.endswith('?') else '.'} After a stop: read the screen of the control, clear the alarm, and move "
            f"the probe up along the tool by hand before anything turns ({page}). {asks}{_before(where, aside)}"
        ) from None


def _told(
    found: Located, result: dict[str, Any], agrees: float, worst: str, farthest: str, other: OtherSize, unmeasured: float
) -> None:
    """where the table stands, the same for --json, mm of --agrees, the facet known worst, the worst of those that nobody sees, what
    another size may do, mm of a probe that nobody has measured (NaN: somebody has) → says it.
    """
    moved, turned = result["moved_mm"], result["turned_deg"]
    click.echo(f"the table is moved by X {moved[0]:+.3f} Y {moved[1]:+.3f} Z {moved[2]:+.3f} mm")
    parts = " ".join(f"about {name} {value:+.4f}" for name, value in zip("XYZ", turned, strict=True))
    click.echo(f"and turned by {float(np.linalg.norm(turned)):.4f} deg: {parts}")
    click.echo(f"largest difference of a touch that counts: {_worst(found):.4f} mm")
    if found.left_out:
        off = float(found.residual[np.argmax(np.abs(found.residual))])
        click.echo(
            f"facet {found.left_out[0]} does not count: its touch is {off:+.2f} mm from where the others place the "
            "table. Something else was met there: see what it is before you go on"
        )
    if found.missed:
        click.echo(
            f"nothing was met at facet{'s' if len(found.missed) > 1 else ''} {', '.join(found.missed)}: see why before you go on. "
            f"The other {len(found.residual)} touches place the table"
        )
    click.echo(
        f"facets that are right to {agrees:g} mm on a table of the size of its file are known to {result['known_mm']:.2f} mm now "
        f"(one standard deviation), the worst is {worst}"
    )
    if agrees > AGREES:
        many = len(found.counted)
        click.echo(
            f"{many} touches count, {many - 6} more than the place of a table needs, and they may be {agrees:g} mm off: one that "
            "met something else by a little more than that is not noticed. Touch three facets by hand before you go on"
        )
    if unseen := result["unseen"]:
        click.echo(
            f"no touch was on the side of facets {', '.join(unseen)}: these are where the size of the table in artefact.yaml has "
            f"them. On one that is 1 % larger facet {farthest}, the worst, is {result['unseen_mm']:.1f} mm beside that. Measure "
            "that size before you trust a short search there"
        )
    if other.beside > 1.0:
        click.echo(f"{other.text}. Measure that size before you trust a short search")
    if names := ", ".join(found.obstacles):
        click.echo(
            f"{names}: no touch says whether what stands on the table has moved with it. What is written has each in both places, "
            "as declared and as moved with the table, so that nothing is hit. Look where they stand, and take the other ones out: "
            "touches beside them are left out until then"
        )
    if not math.isnan(unmeasured):
        click.echo(
            f"this is for a probe of {unmeasured:g} mm, as machine.yaml has it: these touches take one that is 1 mm longer for a "
            "table that is 1 mm higher. Measure the probe, and state its length: --length MM"
        )
    click.echo(f"→ {result['artefact']}; copy it over artefact.yaml of the cell if this is right")


def _notice(made: Plan, within: float, stated: float | None) -> str:
    """plan of the cycle, mm by which the table may stand elsewhere, mm of --agrees → what is said before it moves."""
    from .. import locate, telling

    approach = made.strategy.approach
    notice = (
        f"{in_spindle(made)} in the spindle and on. Measure its length: these touches take a longer stylus for a higher table. "
        f"The table may stand {within:g} mm and {locate.turned(within):g} deg elsewhere than its file says: each touch is "
        f"searched over {approach.standoff + approach.search:.0f} mm. Obstacles have to stand where they are declared"
    )
    on_table = ", ".join(solid.title or solid.kind for solid in made.artefact.obstacles)
    notice += (
        f", those on the table too: if {on_table} moved with it, correct artefact.yaml first."
        if on_table
        else ". None is declared on the table: if anything else is on it (a vice, a clamp), declare it in artefact.yaml first. The "
        "probe crosses the table fast, and near its facets."
    )
    near, most = locate.beside(made, within)
    if most < within:
        notice += (
            f" Facets {', '.join(near)} have an edge nearer than that: a table more than {most} mm away may show the "
            f"ball something else there. Then it is refused, and nothing is hit. 'tango locate --within {max(most, 1)}' is for "
            "a table whose place is known so well."
        )
    if (other := telling.unsized(made.artefact, [touch.facet for touch in made.touches], stated)).beside > locate.KNOWN:
        later = "" if stated else " Without --agrees the table is not placed then."
        notice += f" Measure the size of the table first: {other.text}.{later}"
    return notice


def _before(where: Path, aside: str | None) -> str:
    """file of the artefact in its place, name under which an earlier one is kept → what is said of an earlier one; '' for none."""
    if aside is not None:
        return f". What was found before is kept as {where.with_name(aside)}: the table may have moved since"
    return f". {where} is of an earlier locating, not of these readings" if where.exists() else ""


def _worst(found: Located) -> float:
    """what was found → mm, the largest difference of a touch that counts."""
    return float(np.sort(np.abs(found.residual))[: len(found.residual) - len(found.left_out)].max())
