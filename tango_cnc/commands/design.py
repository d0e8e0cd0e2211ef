"""`tango design`: choose the touches for a goal and a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from ..diagnose.separate import USUAL, Separation, separation
from ..duration import of_moves
from ..files import later, read_cell, read_readings, read_terms, write_text
from ..files.normals import refuse_inward
from ..files.origin import look_up, made_utc, other_machine
from ..identify import SUBSETS
from ..judgement import Judgement
from ..judging import judged, traced
from ..plan import last_motion, plan
from ..records import Cell, InputError, Readings, TangoError
from ..touches import Touches, of_facets
from ._beside import alone, stated
from ._common import Output, cell_option, dialect, json_option, write_json
from ._handed import printed, typed
from ._progress import Progress
from ._stylus import bought
from ._trust import despite_option, status, usable
from ._trust import told as doubts
from .check import positioning_feed

PLACE = "Plan 10"  # in the list of commands

if TYPE_CHECKING:
    from ..design.propose import Wish
    from ..report.drawn import Drawn


class Finite(click.FloatRange):
    """A number within a range: nan is in none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """text → number. Raises click.BadParameter for one that is none, or outside."""
        found = super().convert(value, param, ctx)
        if not math.isfinite(found):
            self.fail(f"{value} is not in the range {self._describe_range()}.", param, ctx)
        return found


KNOWN = ("-C", "--readings", "--within", "--volume", "--terms", "--degree", "--json")  # what acts where nothing is chosen


@click.command()
@cell_option
@click.option("--goal", help="volume (default), locations, check, D, A, condition, or limits: EX0C=1,EA0C=5 (µm, µrad, µm/m).")
@click.option(
    "--minutes",
    type=Finite(0.5, 600),
    help="Time of the whole run; usual: locations 5, volume 10, check 2.5, or as much longer as it needs to be of use.",
)
@click.option("-o", "output", type=Output(), metavar="FILE", help="The plan as a strategy, with the reasons in comments.")
@click.option("--regular", is_flag=True, help="A plain regular plan of that time instead: what an optimal one has to beat.")
@click.option("--within", type=Finite(0.0, 50.0), help="mm within which facets are where they should be (after a first run).")
@click.option(
    "--readings", type=click.Path(path_type=Path, exists=True), help="Of an earlier run: says --within, and what a check knows."
)
@click.option(
    "--stylus-within",
    "stylus",
    type=Finite(0.0, 5.0),
    default=0.002,
    show_default=True,
    help="For a check: mm within which the stylus comes back to the spindle after the full run; 0: it stayed there.",
)
@click.option(
    "--again",
    type=click.Path(path_type=Path, exists=True),
    multiple=True,
    metavar="FILE",
    help="For a check: readings of a check right after the full run, with the stylus still in the spindle; several are allowed.",
)
@alone(*KNOWN, "--goal", "--minutes", "--again", "--stylus-within", "--despite")(
    "--judge",
    type=click.Path(path_type=Path, exists=True),
    metavar="FILE",
    help="Readings of a check: has the machine changed since --readings?",
)
@click.option(
    "--volume", metavar="X0:X1,Y0:Y1,Z0:Z1", help="Where parts are made, mm in the table frame, instead of above the facets."
)
@click.option(
    "--early",
    type=Finite(0.0, 100.0),
    default=3.0,
    show_default=True,
    help="Percent that the whole plan may lose so that a run that is broken off is worth more.",
)
@click.option("--compare", is_flag=True, help="Also a regular plan of that time, and the best of 100 random ones.")
@click.option("--styli", is_flag=True, help="Also say which ISO figures the plan decides, and what a second stylus would add.")
@click.option(
    "--picture", type=Output(), metavar="FILE", help="What is known when, where touches are, the volume (.png .svg .pdf)."
)
@alone("-C", "-o")(
    "--facets",
    metavar="BODY",
    help="artefact.yaml for box:X0:X1,Y0:Y1,Z0:Z1, cylinder:RADIUS,Z0:Z1, table:WIDTH,DEPTH or mesh:FILE.stl.",
)
@alone("-C", "--terms", "--json")(
    "--separate", nargs=2, metavar="CAUSE CAUSE", help="Which touches would separate these two causes."
)
@click.option(
    "--terms", help="What is to be estimated, instead of S4 (volume, D, A, condition) or S3: S1 … S4 or a list, e.g. S3,EYX2."
)
@click.option("--degree", type=click.IntRange(1, 6), default=3, show_default=True, help="Highest degree of the polynomials of S4.")
@despite_option
@json_option
def command(
    folder: Path,
    goal: str | None,
    minutes: float | None,
    output: Path | None,
    regular: bool,
    within: float | None,
    readings: Path | None,
    stylus: float,
    again: tuple[Path, ...],
    judge: Path | None,
    volume: str | None,
    early: float,
    compare: bool,
    styli: bool,
    picture: Path | None,
    facets: str | None,
    separate: tuple[str, str] | None,
    terms: str | None,
    degree: int,
    despite: bool,
    json_file: str | None,
) -> int:
    """Chooses the touches for a goal and a time, and says how close they come to the best that is possible.

    The file of -o is a strategy as 'check', 'plan' and 'run' take it: name it in tango.yaml. Time is that of this machine, by its
    rapids, accelerations and clamps and the positioning feed of its post. With --separate: indexations to append to the strategy
    that separate two causes. Exit status 1 when limits are not kept or hardly a touch is to spare, and when --readings give no
    plausible estimate.
    """
    if facets is not None:
        return _facets(facets, output)
    cell = read_cell(folder, strategy=separate is not None)
    if separate:
        found = separation(planned(cell), cell.terms if terms is None else read_terms(terms, cell.folder), *separate)
        if not write_json(json_file, as_json(found)):
            printed(as_text(found))
        return 0
    refuse_inward(cell)
    if judge is not None and readings is None:
        raise InputError("--judge: state --readings of the full run too; allowed: --readings full.csv --judge check.csv")
    check = judge is not None or goal == "check"
    if not check and stated("stylus-within"):
        raise InputError("--stylus-within: found without a check; allowed: with --goal check or --judge")
    before = None if readings is None else earlier_run(cell, readings, despite, check)
    asked = _wish(
        cell,
        ("check" if judge else "volume") if goal is None else goal,
        minutes,
        within,
        before,
        readings,
        volume,
        terms,
        degree,
        stylus,
    )
    asked = replace(asked[0], loss=early / 100), asked[1]
    if again:
        asked = _also(cell, asked[0], again), asked[1]
    if judge is not None and readings is not None:
        return _judge(cell, asked[0], readings, judge, despite, json_file)
    return _design(cell, *asked, regular=regular, compare=compare, styli=styli, output=output, picture=picture, json_file=json_file)


def _facets(text: str, output: Path | None) -> int:
    from ..design.facets import of_text
    from ..files import artefact_text

    found = artefact_text(of_text(text))
    if output is None:
        click.echo(found, nl=False)
    else:
        write_text(output, found)
        click.echo(f"artefact written to {output}: measure where the facets are, or let the probe find them", err=True)
        if text.startswith("table:"):
            click.echo(
                "The middle of the top of the table is taken to be at X 0 Y 0 Z 0 of the machine frame, with all axes at zero. "
                "Where it stands elsewhere, state its corners: --facets box:X0:X1,Y0:Y1,Z0:Z1",
                err=True,
            )
    return 0


def earlier_run(cell: Cell, source: Path, despite: bool, check: bool) -> Readings:
    """cell, file, --despite, whether a check rests on it → readings of an earlier run.

    A check takes whole error motions of its full run. So where the terms of the cell do not explain that run, S4 may.
    Raises TangoError where nothing may be made of what they say.
    """
    readings = read_readings(source, cell.machine, cell.artefact)
    found = judged(cell, readings, cell.terms, source=source)[1]
    if check and status(found, False) and "S4" not in cell.terms:
        more = ("S4", *(item for item in cell.terms if item not in SUBSETS))
        with suppress(TangoError):
            whole = judged(cell, readings, more, source=source)[1]
            if not status(whole, False):
                click.echo(f"{source} is judged with the terms S4: those of tango.yaml do not explain it", err=True)
                found = whole
    usable(found, despite, "design --readings")
    return readings


def _also(cell: Cell, wish: Wish, again: Sequence[Path]) -> Wish:
    """wish for a check, readings of checks right after its full run → the same, resting on all of them.

    Raises InputError where one of these says that the machine was not what the full run says.
    """
    from ..design import propose
    from ..design.changed import changed

    if wish.before is None or wish.goal.word != "check":
        raise InputError(
            "--again: found neither a check nor its full run; allowed: with --readings full.csv, and --goal check or --judge"
        )
    ready, before = propose.setting(cell, wish), wish.before
    for file in again:
        run = read_readings(file, cell.machine, cell.artefact)
        if changed(ready.problem.choice, ready.lever, wish.before, run).changed:
            raise InputError(
                f"--again: found {file}, by which the machine has changed since the full run; allowed: checks made before anything "
                "changed. Make a full run, and these checks after it"
            )
        before = later(before, run)
    return replace(wish, before=before)


def _wish(
    cell: Cell,
    goal: str,
    minutes: float | None,
    within: float | None,
    before: Readings | None,
    readings: Path | None,
    volume: str | None,
    terms: str | None,
    degree: int,
    stylus: float,
) -> tuple[Wish, str]:
    """options → what is asked for, and why facets are touched as they are."""
    from ..design import goals, propose, touching

    aim = goals.read(goal)
    source = "--within"
    if within is None and before is not None:
        within, source = touching.known_within(cell, before), f"learned from {readings}"
    how = touching.touching(cell.strategy.approach, within, source)
    wanted = propose.usual_terms(aim, cell.terms) if terms is None else read_terms(terms, cell.folder)
    feed, gate = positioning_feed(cell), gate_of(cell)
    wish = propose.Wish(aim, minutes, wanted, how.approach, degree, feed, _box(volume), before, stylus, gate, typed("terms"))
    return wish, how.why


def gate_of(cell: Cell) -> str:
    """cell → what proves the probe alive in its programs: its time is part of the run."""
    import postprocessors as posts

    if cell.controller is None:
        return "none"
    return str(posts.settings(dialect(cell), cell.controller.options).get("gate", "none"))


def _judge(cell: Cell, wish: Wish, full: Path, source: Path, despite: bool, json_file: str | None) -> int:
    """Says whether the machine has changed → exit status, 1 when it has."""
    from ..design import propose
    from ..design.changed import changed
    from . import _design as told

    if wish.goal.word != "check":
        raise InputError(f"--judge: found --goal {wish.goal.text}; allowed: --goal check, or no --goal")
    ready = propose.setting(cell, wish)
    few = read_readings(source, cell.machine, cell.artefact)
    origin = look_up(source)
    if (named := other_machine(origin, cell.folder)) and not despite:
        raise InputError(
            f"--judge: found {source} of the machine {named[0]!r}; allowed: a check of {named[1]!r}, which "
            "made the full run. If it is one machine with a new name: --despite"
        )
    began, full_began = made_utc(origin), made_utc(look_up(full))
    if began and full_began and began < full_began and not despite:
        raise InputError(
            f"--judge: found {source} of {began:%Y-%m-%d %H:%M} UTC, before the full run ({full}, {full_began:%Y-%m-%d %H:%M} UTC)"
            "; allowed: a check made after it. --despite compares them all the same: what it says has changed is then reversed"
        )
    known = traced(Judgement("trustworthy"), origin, cell.folder)
    for line in doubts(known):
        printed(line, err=True)
    assert wish.before is not None  # full
    found = changed(ready.problem.choice, ready.lever, wish.before, few)
    if not write_json(json_file, told.change_json(found, known)):
        printed(told.change_text(found))
    return int(found.changed)


def _design(
    cell: Cell,
    wish: Wish,
    why: str,
    *,
    regular: bool,
    compare: bool,
    styli: bool,
    output: Path | None,
    picture: Path | None,
    json_file: str | None,
) -> int:
    from ..design import check, propose
    from ..design.enough import believed, promised
    from . import _design as told

    if picture is not None:
        drawable(picture)
    aim = wish.goal
    with Progress() as progress:
        ready = propose.setting(cell, wish, progress.stage)
        found = propose.regular(ready) if regular else propose.propose(ready)
        sees = check.power(found, ready.lever) if aim.word == "check" else None
        others = propose.competitors(ready, found) if compare else {}
        progress.stage("what it is worth, and no other plan can reach")
        data = told.as_json(ready, found, why, sees, others)
    if styli:
        data["second_stylus"] = bought(found.plan, wish.terms, wish.degree)
    lines = told.as_text(ready, data)
    if output is not None:
        write_text(output, told.strategy_text(found, data, lines.splitlines()))
    if picture is not None:
        _draw(picture, told.drawn(ready, found), data)
    if not write_json(json_file, data):
        printed(lines)
        click.echo(f"strategy written to {output}" if output is not None else "-o FILE writes the strategy", err=True)
    return int((bool(aim.limits) and (promised(found) > 1 or not believed(found))) or not data["determined"])


def drawable(file: Path) -> None:
    """file → nothing. Raises InputError where no picture of that kind can be made."""
    from ..report import pictures

    if file.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise InputError(f"--picture: found {file}; allowed: a file .png, .svg or .pdf")
    if not pictures.available():
        raise InputError("--picture: matplotlib is not installed: pip install 'tango-cnc[report]'")


def _draw(file: Path, drawn: Drawn, data: dict[str, Any]) -> None:
    from ..report import design as drawing
    from ..report import pictures

    minutes = data["time_s"] / 60
    others = [(name, minutes, value) for name, value in data.get("competitors", {}).items()]
    title = f"{data['machine']}: {data['touches']} touches in {minutes:.1f} min for {data['goal']}"
    file.write_bytes(pictures.encoded(drawing.figure(drawn, title, others), file.suffix[1:].lower()))


def _box(text: str | None) -> tuple[tuple[float, float], ...] | None:
    """'-200:200,-200:200,0:150' → three spans in mm. Raises InputError for anything else."""
    if text is None:
        return None
    try:
        spans = tuple((float(low), float(high)) for low, high in (part.split(":") for part in text.split(",")))
    except ValueError:
        spans = ()
    if len(spans) != 3 or not all(low < high for low, high in spans):
        raise InputError(
            f"--volume: found {text!r}; allowed: three spans in mm, each from the smaller end, e.g. -200:200,-200:200,0:150"
        )
    return spans


def planned(cell: Cell) -> Touches:
    """cell → the touches of its plan at the times at which they are expected."""
    from dataclasses import replace

    made = plan(cell, "leave-out")
    position = np.array([touch.contact for touch in made.touches])
    touches = of_facets(cell.machine, cell.artefact, [t.facet for t in made.touches], position, last_motion(made))
    spent, row = np.zeros(len(touches)), {touch.number: row for row, touch in enumerate(made.touches)}
    for move, seconds in zip(made.moves, of_moves(made, positioning_feed(cell)), strict=True):
        spent[row[move.touch]] += seconds
    return replace(touches, time=np.cumsum(spent), feed=np.full(len(touches), cell.strategy.approach.feed))


def _indexation(position: dict[str, float], facets: tuple[str, ...]) -> dict[str, Any]:
    return {**{k: round(float(np.degrees(v)), 6) + 0.0 for k, v in position.items()}, "facets": list(facets)}


def as_json(found: Separation) -> dict[str, Any]:
    """separation → plain data."""
    return {
        "format": "tango-separation/1",
        "causes": list(found.causes),
        "settings": [{k: list(v) if isinstance(v, tuple) else v for k, v in s.items()} for s in found.settings],
        "apart": found.apart,
        "evidence": found.evidence,
        "together": found.together,
        "append": [{**_indexation(a.position, a.facets), "apart": a.apart, "evidence": a.evidence} for a in found.additions],
    }


def as_text(found: Separation) -> str:
    """separation → what a person reads, with lines to append to strategy.yaml."""
    one, other = found.causes
    lines = [
        f"Of the {one} that looks most like {other}, this plan sees {100 * found.apart:.1f} % that {other} cannot imitate.",
        f"An effect of {USUAL * 1e3:g} µm is distinguished with a score of {found.evidence:.1f} (10: very strong; 2: none).",
    ]
    if found.together < found.evidence + 1.0:
        again = "No indexation of this plan, made again at its end, changes that: touch other facets or at other angles."
        return "\n".join([*lines, again])
    lines.append("One of these lines, appended to the indexations of strategy.yaml, raises that score to the number before it:")
    for a in found.additions:
        entry = _indexation(a.position, a.facets)
        facets = ", ".join(entry.pop("facets"))
        place = ", ".join(f"{k}: {v:g}" for k, v in entry.items())
        lines.append(f"  {a.evidence:6.1f}   - {{{place}, facets: [{facets}]}}")
    lines.append(f"All of them together raise it to {found.together:.1f}.")
    return "\n".join(lines)
