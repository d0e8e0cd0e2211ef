"""`tango plan`: write the NC program and plan.csv."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..capability.programs import KINDS, Kind
from ..capability.programs import program as capability_program
from ..files import artefact_text, blamed_on, drawn_sizes, read_cell, strategy_text
from ..files.normals import refuse_inward
from ..files.plan import Content, plan_lines, write_together
from ..files.targets import same, spared, writable
from ..link.lock import holding
from ..records import Cell, InputError, LacksSettingError, Plan
from . import _handed, _trusted
from ._common import Output, ahead, cell_option, json_option, json_text, writing
from ._common import dialect as dialect_of
from ._plan import as_json, as_text, dry, obstructed_option, warnings
from ._stylus import folder_of, left, of_stylus, stylus_option

if TYPE_CHECKING:
    from postprocessors import Post

PLACE = "Plan 20"  # in the list of commands

CELL_FILES = ("artefact.yaml", "strategy.yaml")  # what --capability writes beside its program
ANY = "COM3"  # in place of a port that is not stated yet: its settings alone matter
DRAWN = (".png", ".svg", ".pdf")


@click.command()
@cell_option
@click.option("--post", metavar="NAME|FILE.py", help="Dialect, or your own post; default: controller.post of the cell.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder of the program; default: program/ in the cell. The program of stylus 2 is in stylus2/ there.",
)
@obstructed_option
@stylus_option
@click.option(
    "--capability",
    type=click.Choice(KINDS),
    help="Plan the touches that measure the probe instead, into capability/KIND/ with their artefact and strategy.",
)
@click.option(
    "--split",
    "most",
    type=click.IntRange(1),
    metavar="N",
    help="Write several programs of at most N touches, cut between indexations; 'tango run --split N' runs them in turn. "
    "Default: as few programs as fit controller.memory.",
)
@click.option("--dry-run", is_flag=True, help="Print the moves instead of writing programs.")
@click.option(
    "--picture",
    type=Output(),
    metavar="FILE",
    help="Also draw the path of the stylus tip: .png, .svg or .pdf (pip install 'tango-cnc[report]').",
)
@click.option("--indexation", type=click.IntRange(1), metavar="N", help="Draw this indexation only: the N-th of the strategy.")
@json_option
def command(
    folder: Path,
    post: str | None,
    out: Path | None,
    obstructed: str | None,
    stylus: int | None,
    capability: Kind | None,
    most: int | None,
    dry_run: bool,
    picture: Path | None,
    indexation: int | None,
    json_file: str | None,
) -> None:
    """Writes the NC program and plan.csv: where every touch happens and how the probe gets there."""
    from .. import plan as planner

    _checked(dry_run, json_file, out, picture, indexation)
    whole = read_cell(folder)
    refuse_inward(whole)
    cell = of_stylus(whole, stylus)
    chosen = _chosen(cell, folder, post, dry_run)
    target = folder_of(out or folder / "program", cell) if capability is None else out or folder / "capability" / capability
    if not dry_run:  # before the work; the names of programs are known after it
        _kept("--out", [target / n for n in ("plan.csv", *(CELL_FILES if capability else ()))], folder, post)
    if capability is not None:
        within = planner.reachable(cell, obstructed)  # what is touched hundreds of times is a facet that can be touched
        artefact, strategy = capability_program(capability, cell.machine, cell.artefact, within)
        cell = replace(cell, artefact=artefact, strategy=strategy)
    made = planner.plan(cell, obstructed)
    for text in (*warnings(made), *(left(whole, cell, "tango plan") if capability is None else ())):
        _handed.printed(text, err=True)
    beside = {} if picture is None else {"--picture": (picture, _drawn(made, picture, indexation))}
    if dry_run:
        shown = _parts(chosen, made, most, folder)
        _write({}, beside, folder, post)
        for line in dry(shown):
            click.echo(line)
        return
    _program(_Wanted(cell, made, chosen, target, folder, post, capability, most, json_file), beside)


@dataclass(frozen=True)
class _Chosen:
    """The post of a plan, and what the profile of the cell says for it."""

    name: str | None  # None: the cell has no control yet
    dialect: Post | None
    own: bool  # the one of the cell's profile
    options: dict[str, Any]


@dataclass(frozen=True)
class _Wanted:
    """A plan whose program is written."""

    cell: Cell
    made: Plan
    chosen: _Chosen
    target: Path  # folder of the program
    folder: Path  # of the cell
    post: str | None  # --post
    capability: Kind | None
    most: int | None  # --split
    json_file: str | None


def _checked(dry_run: bool, json_file: str | None, out: Path | None, picture: Path | None, indexation: int | None) -> None:
    """--dry-run, --json, --out, --picture, --indexation → nothing. Raises InputError for those that do not go together."""
    from ..report import pictures

    if dry_run and json_file is not None:
        raise InputError("--dry-run and --json: a dry run writes no program, so there is nothing for --json; leave one of them out")
    if dry_run and out is not None:
        raise InputError("--out: found with --dry-run, which writes no program; leave one of them out")
    if indexation is not None and picture is None:
        raise InputError("--indexation: it says what --picture draws; give --picture FILE too")
    if picture is not None:
        if picture.suffix.lower() not in DRAWN:
            raise InputError(f"--picture: found {str(picture)!r}; allowed: a name that ends with {', '.join(DRAWN)}")
        pictures.needed()


def _chosen(cell: Cell, folder: Path, post: str | None, dry_run: bool) -> _Chosen:
    """cell, its folder, --post, --dry-run → the post and its options. Raises InputError for a program that no post writes."""
    import postprocessors as posts

    name = post or (cell.controller.post if cell.controller else None)
    if name is None and not dry_run:
        raise InputError(f"{folder / 'tango.yaml'}: no controller.post; state it there or with --post ({', '.join(posts.names())})")
    if post is not None and posts.is_own(post):
        _trusted.needed(Path(post))
    dialect = posts.load(post, "--post") if post else dialect_of(cell) if name is not None else None
    # Fields of the cell's profile belong to the cell's post; another one given by --post starts from its own defaults.
    own = cell.controller is not None and (post is None or post == cell.controller.post)
    options = dict(cell.controller.options) if cell.controller and own else {}
    if dialect is not None and own:
        writing(cell)
    if cell.controller and cell.controller.options and not own:
        given = ", ".join(cell.controller.options)
        click.echo(
            f"WARNING: {folder / 'tango.yaml'} states {given} for {cell.controller.post}: the program for {post} is made without "
            f"them. State post: {post} there where they hold for it, too",
            err=True,
        )
    return _Chosen(name, dialect, own, options)


def _drawn(made: Plan, picture: Path, indexation: int | None) -> Content:
    """plan, --picture, --indexation → what goes into that file."""
    from ..report import path, pictures

    return partial(pictures.encoded, path.picture(made, indexation), picture.suffix[1:].lower())


def _parts(chosen: _Chosen, made: Plan, most: int | None, folder: Path) -> Sequence[Plan]:
    """post, plan, --split, folder of the cell → the plan in as many parts as it has programs."""
    import postprocessors as posts

    from .. import plan as planner
    from ..program import parts

    if chosen.dialect is None:  # the moves of a cell for no control yet can be looked at all the same
        return (made,) if most is None else planner.split(made, most)
    with blamed_on(folder / "tango.yaml") if chosen.options else nullcontext():
        posts.begins(chosen.dialect, made, chosen.options)
        return parts(chosen.dialect, made, chosen.options, most)


def _program(w: _Wanted, beside: Mapping[str, tuple[Path, Content]]) -> None:
    """plan whose program is wanted, {option: file of it} → program, plan.csv and what belongs to them are written and named."""
    import postprocessors as posts

    from ..program import programs, stale
    from ._proofs import proven

    name, dialect, options, target = w.chosen.name, w.chosen.dialect, w.chosen.options, w.target
    assert name is not None and dialect is not None
    made, gate = w.made, options.get("gate")
    if w.chosen.own and w.capability is None and gate == "facet":
        from ._night_gate import as_found  # with the nights comes their database

        made = as_found(w.cell, made, dialect)
    with blamed_on(w.folder / "tango.yaml") if options else nullcontext():
        written = programs(dialect, made, options, w.most)
        companions = posts.companions(dialect, made, options)
    doubts = (*posts.unverified(dialect, options), *posts.reach(made), *dict.fromkeys(d for p in written for d in p.unread))
    files: dict[Path, Content] = {target / p.name: p.lines for p in written}
    files[target / "plan.csv"] = lambda: plan_lines(made)
    files |= {target / name_beside: partial(iter, texts) for name_beside, texts in companions.items()}
    if w.capability is not None:
        texts = artefact_text(w.cell.artefact), strategy_text(w.cell.strategy)
        files |= {target / n: partial(iter, text.splitlines()) for n, text in zip(CELL_FILES, texts, strict=True)}
    result = as_json(made, name, target, written, doubts, proven(w.cell, dialect) if w.chosen.own else {}, str(gate))
    result |= {
        "drawings": drawn_sizes(w.cell.machine, w.cell.artefact),
        "companions": [str(target / name_beside) for name_beside in companions],
    }
    if w.json_file not in (None, "-"):
        beside = {**beside, "--json": (Path(str(w.json_file)), lambda: [json_text(result)])}
    _write(files, beside, w.folder, w.post)
    if w.json_file == "-":
        click.echo(json_text(result))
    else:
        _handed.printed(as_text(made, result))
    for text in stale(target, set(files), result["plan_hash"]):
        click.echo(text, err=True)
    if w.json_file != "-" and w.capability is None:
        tried = result["proven"]
        ahead(w.folder, *(() if tried and "FAIL" not in tried.values() else ("commission",)), "run", first=_first(w, dialect.link))


def _first(w: _Wanted, link: str) -> str:
    """plan whose program is written, protocol of its post → what has to stand in tango.yaml before it can be run; '' for nothing.

    Commands that go to the control take the post of the cell: nobody is to try another one than that of the program.
    """
    import postprocessors as posts

    from ..link.measure import fitting

    controller = w.cell.controller
    if not w.chosen.own:
        name = str(w.chosen.name)
        if posts.is_own(name):
            name = f"./{Path(os.path.relpath(name, w.folder)).as_posix()}"
        other = "" if controller is None else f" in place of {controller.post}"
        port = " and its port" if controller is None else ""
        return f"state post: {name}{port} under controller: in {w.folder / 'tango.yaml'}{other}"
    assert controller is not None
    try:
        fitting(controller.port or ANY, link, w.made)
    except LacksSettingError as error:
        said = str(error) if controller.port else f"controller.port: found none; with it goes ?{error.setting}"
        click.echo(f"WARNING: {w.folder / 'tango.yaml'}: {said}. A run refuses the plan without it", err=True)
        return f"correct controller.port in {w.folder / 'tango.yaml'}"
    except InputError:
        return ""  # 'tango check' and whatever opens the port say it
    return ""


def _write(files: Mapping[Path, Content], beside: Mapping[str, tuple[Path, Content]], folder: Path, post: str | None) -> None:
    """files of the program, those of other options, folder of the cell, --post → all are written, or none.

    Raises InputError where one would replace what the plan is made from, or another one, or cannot be written; LinkError while
    another program is at work in the folder.
    """
    _kept("--out", files, folder, post)
    for option, (file, _) in beside.items():
        _kept(option, [file], folder, post)
        if any(same(file, other) for other in files):
            raise InputError(f"{option}: found {file}, a file of the program itself; allowed: another name")
    within = any(file.resolve().is_relative_to(folder.resolve()) for file in files)
    with holding(folder, "tango plan") if within else nullcontext():  # not while a run executes what stands there
        write_together({**files, **dict(beside.values())})


def _kept(option: str, files: Iterable[Path], folder: Path, post: str | None) -> None:
    for file in files:
        spared(option, file, folder, () if post is None else (Path(post),))
        writable(option, file)
