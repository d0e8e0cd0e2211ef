"""tango.yaml, machine.yaml and world.yaml → records (docs/formats.md)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from ..judgement import Tolerances
from ..records import (
    LINEAR,
    ROTARY,
    Approach,
    Axis,
    Cell,
    Controller,
    InputError,
    Machine,
    Obstacle,
    Probe,
    Strategy,
    TermItem,
    World,
)
from .angles import angle
from .artefact import read_artefact
from .checked import FURTHEST, Node, complaint, load, parse, suggestion
from .gathered import gathered
from .learned import resolved
from .obstacle import read_obstacle
from .strategy import read_strategy
from .tolerances import TOLERANCES, read_tolerances

SUBSETS = ("S1", "S2", "S3", "S4")
ROUND = 0.35  # deg: two digits of a radian
SLOWEST = {
    "linear": (100.0, 1000, "mm/min", "m/min"),
    "rotary": (60.0, 360, "deg/min", "rpm"),
}  # rapid, and what was meant below it
COARSEST = 0.1  # mm: a probe of a machine tool repeats to micrometres
SUBSET = re.compile(r"[Ss]\d*")  # what is meant for one; the machine has to be known to judge the other words
STYLI = 9  # of one machine
FIRST = Approach(8.0, 4.0, 180.0)  # mm, mm, mm/min: of a table that nobody has touched yet
OFFSET = re.compile(r"E[XYZ]t|E[XYZR]t[2-9]")
TOPOLOGY = re.compile(r"w(?P<workpiece>[XYZABC]*)[fb](?P<tool>[XYZABC]*)\(S\)t")


def read_cell(folder: Path, *, strategy: bool = True) -> Cell:
    """folder with tango.yaml → cell. Raises InputError for whatever is wrong in any of its files.

    `strategy`: whether it needs one. Where it does not, and the file is not there yet, nothing is touched in it (`FIRST`).
    """
    if folder.is_file():
        raise InputError(f"{folder}: found a file; allowed: the folder of the cell, such as -C {folder.parent}")
    file = folder / "tango.yaml"
    made, touched = True, Strategy("none yet", FIRST, ())
    terms: tuple[TermItem, ...] = ("S3",)
    controller = None
    with gathered() as read:
        fields = read.fields(load(file), ["tango", "machine", "artefact", "strategy"], ["terms", "controller"])
        if "tango" in fields and read(fields["tango"].integer) not in (1, None):
            raise fields["tango"].wrong("1, the version of the format that this program reads")
        terms = read(lambda: _terms(fields["terms"], folder)) if "terms" in fields else terms
        files = _files(folder, {key: fields[key] for key in ("machine", "artefact", "strategy")})
        machine, artefact = read(lambda: read_machine(files["machine"])), read(lambda: read_artefact(files["artefact"]))
        made = strategy or files["strategy"].exists()
        if machine and artefact:  # what it may touch and turn
            touched = read(lambda: read_strategy(files["strategy"], machine, artefact)) if made else touched
        if machine and "controller" in fields:
            controller = read(lambda: _controller(fields["controller"], machine))
    return Cell(folder, machine, artefact, touched, terms, controller)


def _files(folder: Path, nodes: dict[str, Node]) -> dict[str, Path]:
    """folder of a cell, {what: name of its file} → paths. Raises InputError when a file that nothing names may be meant."""
    files = {key: node.named(folder) for key, node in nodes.items()}
    others = sorted({f.name for f in folder.glob("*.yaml")} - {f.name for f in files.values()} - {"tango.yaml"})
    for key, file in files.items():
        if file == folder or (not file.exists() and suggestion(file.name, others)):
            hint = suggestion(file.name, others)
            raise nodes[key].wrong(
                f"the name of a file; beside it there are {', '.join(others)}.{hint}", f"{nodes[key].text()!r}, no such file"
            )
    return files


def read_terms(text: str, folder: Path | None) -> tuple[TermItem, ...]:
    """'S3' or '[S3, EYX2]' or 'S3,EYX2' from a command line, folder of the cell for its learned shapes (None: these come
    with their numbers) → terms.

    Raises InputError when it is neither.
    """
    bare = text.strip()
    if not bare:
        raise InputError("--terms: found nothing; allowed: S1, S2, S3, S4 or a list of them, of coefficients (EYX2) and causes")
    return _terms(parse(Path("--terms"), bare if bare.startswith("[") else f"[{bare}]"), folder)


def _terms(node: Node, folder: Path | None) -> tuple[TermItem, ...]:
    value = node.plain()
    items = value if isinstance(value, list) else [value]
    for item in items:
        if not isinstance(item, (str, dict)) or (isinstance(item, dict) and not isinstance(item.get("cause"), str)):
            raise node.wrong("S1, S2, S3, S4 or a list of subset names, coefficients (EYX2) and causes (thermal_drift)", repr(item))
        if isinstance(item, str) and SUBSET.fullmatch(item) and item not in SUBSETS:
            allowed = f"{', '.join(SUBSETS)}, or a list of them, of coefficients (EYX2) and causes (thermal_drift)"
            raise node.wrong(f"{allowed}.{suggestion(item, SUBSETS)}", repr(item))
    return tuple(resolved(item, folder) for item in items)


def _controller(node: Node, machine: Machine) -> Controller:
    items = dict(node.items())
    if "post" not in items:
        raise complaint(node.file, node.line, node.path, "no key 'post'", "'post' is required here, e.g. post: fanuc")
    port = items["port"].text() if "port" in items else None
    options = {key: child.plain() for key, child in items.items() if key not in ("post", "port")}
    if not isinstance(post := items["post"].plain(), str):
        raise items["post"].wrong("the name of a dialect, e.g. fanuc, or the path of your own .py file")
    items["post"].named(node.file.parent)
    rapids = {axis.name: axis.rapid for axis in machine.axes if axis.kind == "linear" and axis.rapid is not None}
    feed = options.get("positioning_feed")
    if rapids and isinstance(feed, int | float) and feed > min(rapids.values()):
        slowest = min(rapids, key=lambda name: rapids[name])
        raise items["positioning_feed"].wrong(f"at most {rapids[slowest]:g} mm/min, the rapid of {slowest} in machine.yaml")
    return Controller(post, port, options)


def read_machine(file: Path, text: str | None = None) -> Machine:
    """machine.yaml, its text where it is not that of the file → machine.

    Raises InputError for a chain that is not 3 linear, 0–2 rotary axes and a spindle.
    """
    with gathered() as read:
        fields = read.fields(
            load(file) if text is None else parse(file, text),
            ["name", "topology", "axes", "probe"],
            ["styli", "tolerances", "overhead", "obstacles"],
        )
        name = read(lambda: fields["name"].text())
        probe = read(lambda: _probe(fields["probe"]))
        tolerances = read(lambda: Tolerances(**read_tolerances(fields.get("tolerances"), TOLERANCES)))
        overhead = read(lambda: fields["overhead"].number(0, 3600)) if "overhead" in fields else 0.0
        topology = fields["topology"].text()
        match = TOPOLOGY.fullmatch(topology)
        letters = match["workpiece"] + match["tool"] if match else ""
        rotary = [letter for letter in letters if letter in ROTARY]
        if match is None or len(set(letters)) != len(letters) or not set(LINEAR) <= set(letters) or len(rotary) > 2:
            raise fields["topology"].wrong(
                "workpiece to tool as in ISO 10791-6, f or b the foundation, X Y Z and up to two of A B C once each and the "
                "spindle, e.g. wCBXfZY(S)t"
            )
        workpiece, tool, names = match["workpiece"], match["tool"], [*LINEAR, *sorted(rotary), "S"]
        axes = read.fields(fields["axes"], names)
        ordered = tuple(read.each(names, lambda name: _axis(name, axes[name])))
        obstacles = read(lambda: _obstacles(fields["obstacles"], workpiece, tool)) if "obstacles" in fields else ()
        others = read.each(fields["styli"].list(), lambda item: _other(item, probe)) if probe and "styli" in fields else []
        if len(others) > STYLI - 1:
            raise fields["styli"].wrong(f"at most {STYLI - 1} beside that of probe", f"{len(others)}")
    return Machine(
        name,
        topology,
        ordered,
        tuple(reversed(workpiece)),
        (*tool, "S"),
        probe,
        tolerances,
        (probe, *others) if others else (),
        overhead=overhead,
        obstacles=obstacles,
    )


def _obstacles(node: Node, workpiece: str, tool: str) -> tuple[Obstacle, ...]:
    """entries, letters from the table to the foundation, from there to the tool → what is in the way beside the table."""
    table, others = (workpiece[0], ("f", *reversed(workpiece[1:]), *tool)) if workpiece else ("f", tuple(tool))
    with gathered() as read:
        solids = read.each(node.list(), lambda item: read_obstacle(item, others, table))
    return tuple(solids)


def _axis(name: str, node: Node) -> Axis:
    kind = "linear" if name in LINEAR else "spindle" if name == "S" else "rotary"
    required = ["kind", "direction"]
    if kind != "linear":
        required.append("point")
    given = dict(node.items())
    endless = kind == "rotary" and "endless" in given and given["endless"].boolean()
    if kind != "spindle" and not endless:
        required.append("travel")
    own = ["endless", "nearer"] if kind == "rotary" else []
    with gathered() as read:
        fields = read.fields(node, required, ["point", "travel", "rapid", "acceleration", "clamp_time", *own])
        read(lambda: fields["kind"].text([kind]))
        direction = read(lambda: fields["direction"].unit_vector())
        point = read(fields["point"].vector) if "point" in fields else (0.0, 0.0, 0.0)
        scale = 1.0 if kind == "linear" else math.pi / 180
        rapid = read(lambda: _rapid(fields["rapid"], kind) * scale) if "rapid" in fields else None
        acceleration = read(lambda: fields["acceleration"].number(0.001, 10_000)) if "acceleration" in fields else None
        clamp_time = read(lambda: fields["clamp_time"].number(0, 3600)) if "clamp_time" in fields else 0.0
        if "travel" in fields and endless:
            raise fields["travel"].wrong("either travel or endless: true; an endless axis has no travel", "both")
        travel = _travel(fields["travel"], kind) if "travel" in fields else None
        nearer = "nearer" in fields and fields["nearer"].boolean()
        if nearer and (travel is None or travel[1] - travel[0] > math.radians(800)):
            raise fields["nearer"].wrong("an axis with travel of at most 800 deg; another takes the nearer way anyway", "true")
    return Axis(name, kind, direction, point, travel, rapid, acceleration, clamp_time, nearer)  # type: ignore[arg-type]


def _travel(node: Node, kind: str) -> tuple[float, float]:
    """→ lower and upper end, mm or rad. Raises InputError for an end that is no position, and for radians."""
    scale = 1.0 if kind == "linear" else math.pi / 180
    low, high = (item.position() if kind == "linear" else angle(item) for item in node.list(2))
    if low >= high:
        raise node.wrong("[low, high] with low below high", f"[{low / scale:g}, {high / scale:g}]")
    if kind == "rotary" and max(abs(low), abs(high)) <= math.radians(math.tau) and all(map(_as_radians, node.list(2))):
        raise node.wrong(
            "degrees. These look like radians: "
            f"[{math.degrees(low / scale):.4g}, {math.degrees(high / scale):.4g}] deg would be meant; write whole degrees",
            f"[{low / scale:g}, {high / scale:g}]",
        )
    return low, high


def _as_radians(node: Node) -> bool:
    """number → whether it is no whole one, but would be some fives of degrees in radians, to the digits that people write."""
    value = node.position()
    off = math.degrees(value) % 5
    return value % 1 != 0 and min(off, 5 - off) < ROUND


def _rapid(node: Node, kind: str) -> float:
    """→ mm/min or deg/min. Raises InputError for what only an axis in m/min or rpm has: no machine tool is as slow as that."""
    rapid = node.number(0.1, 1_000_000)
    if kind in SLOWEST and rapid < (least := SLOWEST[kind])[0]:
        raise node.wrong(f"{least[0]:g} … 1 000 000 {least[2]}. If {least[3]} were meant, write {least[1] * rapid:g}", f"{rapid:g}")
    return rapid


def _probe(node: Node) -> Probe:
    none = ("repeatability", "nose_radius")  # these may be 0
    optional = ["stylus_radius", "body_radius", "body_length", "nose_radius", "max_feed"]
    with gathered() as read:
        fields = read.fields(node, ["length", "tip_radius", "repeatability"], optional)
        values = read.each(fields.items(), lambda item: item[1].number(0, FURTHEST) if item[0] in none else item[1].size())
        if (value := dict(zip(fields, values, strict=True)).get("repeatability")) and value > COARSEST:
            raise fields["repeatability"].wrong(f"at most {COARSEST:g} mm: one standard deviation of a touch, in mm", f"{value:g}")
    return Probe(**dict(zip(fields, values, strict=True)))


def _other(node: Node, probe: Probe) -> Probe:
    """entry of styli, probe → the probe with that stylus; what the entry leaves out is as under probe."""
    fields = node.fields(["length"], ["tip_radius", "stylus_radius"])
    return replace(probe, **{key: child.size() for key, child in fields.items()})


def read_world(file: Path) -> World:
    """world.yaml → what the simulated machine really is. Names of errors and effects are checked by who uses them."""
    fields = load(file).fields([], ["errors", "stylus", "facets", "noise", "effects", "seed"])

    def numbers(key: str) -> dict[str, float]:
        return {name: child.position() for name, child in fields[key].items()} if key in fields else {}

    stylus = numbers("stylus")
    for name in stylus:
        if not OFFSET.fullmatch(name):
            known = ("EXt", "EYt", "EZt")
            raise fields["stylus"].wrong(f"{', '.join(known)}, of stylus 2 EXt2 … and ERt2.{suggestion(name, known)}", repr(name))
    effects = []
    for item in fields["effects"].list() if "effects" in fields else ():
        if "cause" not in dict(item.items()):
            near = next((f"; found {key!r}" for key, _ in item.items() if key.lower() == "cause"), "")
            raise item.wrong(f"a mapping with the key 'cause'{near}", "no cause")
        effects.append(cast("Mapping[str, Any]", resolved(item.plain(), file.parent)))
    return World(
        numbers("errors"),
        stylus,
        numbers("facets"),
        fields["noise"].number(0, FURTHEST) if "noise" in fields else 0.0,
        tuple(effects),
        fields["seed"].integer(0) if "seed" in fields else 0,
    )
