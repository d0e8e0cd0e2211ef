"""tango.yaml, machine.yaml, artefact.yaml, strategy.yaml and world.yaml ↔ records (docs/formats.md)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..records import (
    LINEAR,
    ROTARY,
    Approach,
    Artefact,
    Axis,
    Ball,
    Cell,
    Controller,
    Facet,
    Find,
    Id,
    Indexation,
    InputError,
    Machine,
    Obstacle,
    Probe,
    ScaleBar,
    Strategy,
    Surface,
    TermItem,
    World,
)
from .balls import check_bar, check_facets
from .checked import FURTHEST, Node, complaint, load, suggestion
from .hull import corners, read_hull

# How near a touch may begin and how little past the facet it may end, mm. A probe comes free within hundredths of a mm, controls
# call a move of some hundredths less than programmed arrived, and grbl's post backs off 1.5 mm before a guarded move can follow.
LEAST = {
    "standoff": (2.0, "there the probe has to be free again, which takes a way back from the contact; raise standoff"),
    "search": (0.1, "a contact nearer than that to the end of the move is taken for none; raise search"),
}
LONGEST = 1000.0  # mm of stand-off and search: a probe that looks further at measuring feed looks for minutes
CLEAR_OF_ZONE = 0.5  # mm from where the measuring move of a double touch begins to its search zone
SUBSETS = ("S1", "S2", "S3", "S4")
SUBSET = re.compile(r"[Ss]\d*")  # what is meant for one; the machine has to be known to judge the other words
TOPOLOGY = re.compile(r"w(?P<workpiece>[XYZABC]*)[fb](?P<tool>[XYZABC]*)\(S\)t")


def read_cell(folder: Path) -> Cell:
    """folder with tango.yaml → cell. Raises InputError for whatever is wrong in any of its files."""
    file = folder / "tango.yaml"
    root = load(file)
    fields = root.fields(["tango", "machine", "artefact", "strategy"], ["terms", "controller"])
    if fields["tango"].integer() != 1:
        raise fields["tango"].wrong("1, the version of the format that this program reads")
    files = _files(folder, {key: fields[key] for key in ("machine", "artefact", "strategy")})
    machine, artefact = read_machine(files["machine"]), read_artefact(files["artefact"])
    strategy = read_strategy(files["strategy"], machine, artefact)
    terms = _terms(fields["terms"]) if "terms" in fields else ("S3",)
    controller = _controller(fields["controller"]) if "controller" in fields else None
    return Cell(folder, machine, artefact, strategy, terms, controller)


def _files(folder: Path, nodes: dict[str, Node]) -> dict[str, Path]:
    """folder of a cell, {what: name of its file} → paths. Raises InputError when a file that nothing names may be meant."""
    files = {key: folder / node.text() for key, node in nodes.items()}
    others = sorted({f.name for f in folder.glob("*.yaml")} - {f.name for f in files.values()} - {"tango.yaml"})
    for key, file in files.items():
        if file == folder or (not file.exists() and suggestion(file.name, others)):
            hint = suggestion(file.name, others)
            raise nodes[key].wrong(
                f"the name of a file; beside it there are {', '.join(others)}.{hint}", f"{nodes[key].text()!r}, no such file"
            )
    return files


def read_terms(text: str) -> tuple[TermItem, ...]:
    """'S3' or '[S3, EYX2]' or 'S3,EYX2' from a command line → terms. Raises InputError when it is neither."""
    from .checked import parse

    bare = text.strip()
    if not bare:
        raise InputError("--terms: found nothing; allowed: S1, S2, S3, S4 or a list of them, of coefficients (EYX2) and causes")
    return _terms(parse(Path("--terms"), bare if bare.startswith("[") else f"[{bare}]"))


def _terms(node: Node) -> tuple[TermItem, ...]:
    value = node.plain()
    items = value if isinstance(value, list) else [value]
    for item in items:
        if not isinstance(item, (str, dict)) or (isinstance(item, dict) and not isinstance(item.get("cause"), str)):
            raise node.wrong("S1, S2, S3, S4 or a list of subset names, coefficients (EYX2) and causes (thermal_drift)", repr(item))
        if isinstance(item, str) and SUBSET.fullmatch(item) and item not in SUBSETS:
            raise node.wrong(f"{', '.join(SUBSETS)}.{suggestion(item, SUBSETS)}", repr(item))
    return tuple(items)


def _controller(node: Node) -> Controller:
    items = dict(node.items())
    if "post" not in items:
        raise complaint(node.file, node.line, node.path, "no key 'post'", "'post' is required here, e.g. post: fanuc")
    port = items["port"].text() if "port" in items else None
    options = {key: child.plain() for key, child in items.items() if key not in ("post", "port")}
    if not isinstance(post := items["post"].plain(), str):
        raise items["post"].wrong("the name of a dialect, e.g. fanuc, or the path of your own .py file")
    return Controller(post, port, options)


def read_machine(file: Path) -> Machine:
    """machine.yaml → machine. Raises InputError for a chain that is not 3 linear, 0–2 rotary axes and a spindle."""
    root = load(file)
    fields = root.fields(["name", "topology", "axes", "probe"])
    topology = fields["topology"].text()
    match = TOPOLOGY.fullmatch(topology)
    letters = match["workpiece"] + match["tool"] if match else ""
    rotary = [letter for letter in letters if letter in ROTARY]
    if match is None or len(set(letters)) != len(letters) or not set(LINEAR) <= set(letters) or len(rotary) > 2:
        raise fields["topology"].wrong(
            "workpiece to tool as in ISO 10791-6, f or b the foundation, X Y Z and up to two of A B C once each and the spindle, "
            "e.g. wCBXfZY(S)t"
        )
    names = [*LINEAR, *sorted(rotary), "S"]
    axes = fields["axes"].fields(names)
    ordered = tuple(_axis(name, axes[name]) for name in names)
    return Machine(
        fields["name"].text(),
        topology,
        ordered,
        tuple(reversed(match["workpiece"])),
        (*match["tool"], "S"),
        _probe(fields["probe"]),
    )


def _axis(name: str, node: Node) -> Axis:
    kind = "linear" if name in LINEAR else "spindle" if name == "S" else "rotary"
    required = ["kind", "direction"]
    if kind != "linear":
        required.append("point")
    if kind != "spindle":
        required.append("travel")
    fields = node.fields(required, ["point", "travel", "rapid", "acceleration", "clamp_time"])
    fields["kind"].text([kind])
    scale = 1.0 if kind == "linear" else math.pi / 180
    travel = None
    if "travel" in fields:
        low, high = (item.position() for item in fields["travel"].list(2))
        if low >= high:
            raise fields["travel"].wrong("[low, high] with low below high", f"[{low:g}, {high:g}]")
        travel = (low * scale, high * scale)
    return Axis(
        name,
        kind,  # type: ignore[arg-type]
        fields["direction"].unit_vector(),
        fields["point"].vector() if "point" in fields else (0.0, 0.0, 0.0),
        travel,
        fields["rapid"].number(0.1, 1_000_000) * scale if "rapid" in fields else None,
        fields["acceleration"].number(0.001, 10_000) if "acceleration" in fields else None,
        fields["clamp_time"].number(0, 3600) if "clamp_time" in fields else 0.0,
    )


def _probe(node: Node) -> Probe:
    fields = node.fields(["length", "tip_radius", "repeatability"], ["stylus_radius", "body_radius", "body_length", "nose_radius"])
    none = ("repeatability", "nose_radius")  # these may be 0
    return Probe(**{key: child.number(0, FURTHEST) if key in none else child.size() for key, child in fields.items()})


def read_artefact(file: Path) -> Artefact:
    """artefact.yaml → artefact. Raises InputError for a facet on, or a bar between, balls that nothing defines or elsewhere."""
    fields = load(file).fields(["name", "facets"], ["balls", "scale_bar", "obstacles"])
    balls = {key: _ball(key, child) for key, child in fields["balls"].items()} if "balls" in fields else {}
    facets = {key: _facet(key, child, balls) for key, child in fields["facets"].items()}
    if not facets:
        raise fields["facets"].wrong("at least one facet", "none")
    check_facets(facets, balls, fields)
    bar = _scale_bar(fields["scale_bar"], balls) if "scale_bar" in fields else None
    obstacles = tuple(_obstacle(item) for item in fields["obstacles"].list()) if "obstacles" in fields else ()
    return Artefact(fields["name"].text(), facets, balls, bar, obstacles)


def _ball(key: Id, node: Node) -> Ball:
    fields = node.fields(["centre", "radius"])
    return Ball(key, fields["centre"].vector(), fields["radius"].size())


def _known_ball(node: Node, balls: dict[Id, Ball]) -> Id:
    ball = node.identifier()
    if ball not in balls:
        raise node.wrong(f"a ball of this file ({', '.join(balls) or 'it defines none'})")
    return ball


def _facet(key: Id, node: Node, balls: dict[Id, Ball]) -> Facet:
    fields = node.fields(["point", "normal"], ["ball", "uncertainty", "surface"])
    return Facet(
        key,
        fields["point"].vector(),
        fields["normal"].unit_vector(),
        _known_ball(fields["ball"], balls) if "ball" in fields else None,
        fields["uncertainty"].size() if "uncertainty" in fields else None,
        _surface(fields["surface"]) if "surface" in fields else None,
    )


def _surface(node: Node) -> Surface:
    fields = node.fields(["kind", "radius"], ["axis", "inside"])
    kind = fields["kind"].text(["cylinder", "sphere"])
    if (kind == "cylinder") != ("axis" in fields):
        raise node.wrong("an 'axis' for a cylinder and none for a sphere", "an axis" if "axis" in fields else "no axis")
    return Surface(
        kind,  # type: ignore[arg-type]
        fields["radius"].size(),
        fields["axis"].unit_vector() if "axis" in fields else None,
        fields["inside"].boolean() if "inside" in fields else False,
    )


def _scale_bar(node: Node, balls: dict[Id, Ball]) -> ScaleBar:
    fields = node.fields(["balls", "length", "uncertainty"])
    first, second = (_known_ball(item, balls) for item in fields["balls"].list(2))
    if first == second:
        raise fields["balls"].wrong("two different balls", f"ball {first} twice")
    bar = ScaleBar((first, second), fields["length"].size(), fields["uncertainty"].size())
    check_bar(bar, balls, fields["length"])
    return bar


def _obstacle(node: Node) -> Obstacle:
    kind = dict(node.items()).get("kind", node).text(["box", "cylinder", "hull"])
    if kind == "hull":
        return _hull(node)
    if kind == "box":
        fields = node.fields(["kind", "low", "high"])
        return Obstacle("box", low=fields["low"].vector(), high=fields["high"].vector())
    fields = node.fields(["kind", "base", "axis", "radius", "height"])
    return Obstacle(
        "cylinder",
        base=fields["base"].vector(),
        axis=fields["axis"].unit_vector(),
        radius=fields["radius"].size(),
        height=fields["height"].size(),
    )


def _hull(node: Node) -> Obstacle:
    fields = node.fields(["kind"], ["file", "shift", "points"])
    if ("file" in fields) == ("points" in fields) or ("shift" in fields and "points" in fields):
        raise node.wrong("a 'file', with a 'shift' if need be, or 'points'", " and ".join(fields))
    try:
        if "points" in fields:
            points = np.array([item.vector() for item in fields["points"].list()]).reshape(-1, 3)
            return Obstacle("hull", points=corners("points", points))
        name = fields["file"].text()
        shift = fields["shift"].vector() if "shift" in fields else (0.0, 0.0, 0.0)
        return Obstacle("hull", points=read_hull(node.file.parent / name, shift), file=name)
    except InputError as error:
        raise (
            error if str(error).startswith(f"{node.file}:") else InputError(f"{node.file}:{node.line}: {node.path}: {error}")
        ) from None


def read_strategy(file: Path, machine: Machine, artefact: Artefact) -> Strategy:
    """strategy.yaml of a machine and artefact → strategy. Raises InputError for a facet or axis that nothing defines."""
    fields = load(file).fields(["name", "approach", "indexations"])
    approach = fields["approach"].fields(["standoff", "search", "feed"], ["find"])
    indexations = [_indexation(item, machine, artefact) for item in fields["indexations"].list()]
    if not indexations:
        raise fields["indexations"].wrong("at least one indexation", "none")
    return Strategy(fields["name"].text(), _approach(approach), tuple(indexations))


def _approach(fields: Mapping[str, Node]) -> Approach:
    given = {key: child for key, child in fields.items() if key != "find"}
    values = {
        key: child.number(0.1, 100_000) if key == "feed" else child.number(above=0, high=LONGEST) for key, child in given.items()
    }
    for key, (least, why) in LEAST.items():
        if values[key] < least:
            raise fields[key].wrong(f"a finite number at least {least:g}: {why}")
    single = Approach(values["standoff"], values["search"], values["feed"])
    return replace(single, find=_find(fields["find"].fields(["feed", "retreat"]), single)) if "find" in fields else single


def _find(fields: Mapping[str, Node], single: Approach) -> Find:
    """The measuring move begins outside of its search zone, so that a probe that is not free by then shows as an early contact."""
    feed, retreat = fields["feed"].number(0.1, 100_000), fields["retreat"].number(above=0)
    if feed < single.feed:
        raise fields["feed"].wrong(f"at least {single.feed:g}, the measuring feed: finding is to be the quicker touch")
    least = max(LEAST["standoff"][0], single.search + CLEAR_OF_ZONE)
    if retreat < least:
        raise fields["retreat"].wrong(
            f"at least {least:g}: the measuring move begins free of the facet and {CLEAR_OF_ZONE:g} mm before the search zone; "
            "raise retreat or lower search"
        )
    if retreat > single.standoff:
        raise fields["retreat"].wrong(f"at most {single.standoff:g}, the standoff")
    return Find(feed, retreat)


def _indexation(node: Node, machine: Machine, artefact: Artefact) -> Indexation:
    fields = node.fields([*machine.rotary, "facets"], ["S"])
    position = {name: 0.0 for name in (*machine.rotary, "S")}
    position |= {name: math.radians(child.position()) for name, child in fields.items() if name != "facets"}
    facets = []
    for item in fields["facets"].list():
        facet = item.identifier()
        if facet not in artefact.facets:
            known = list(artefact.facets)
            raise item.wrong(f"a facet of artefact {artefact.name!r} ({', '.join(known)}).{suggestion(facet, known)}")
        facets.append(facet)
    if not facets:
        raise fields["facets"].wrong("at least one facet", "none")
    return Indexation(position, tuple(facets))


def read_world(file: Path) -> World:
    """world.yaml → what the simulated machine really is. Names of errors and effects are checked by who uses them."""
    fields = load(file).fields([], ["errors", "stylus", "facets", "noise", "effects", "seed"])

    def numbers(key: str) -> dict[str, float]:
        return {name: child.position() for name, child in fields[key].items()} if key in fields else {}

    stylus = numbers("stylus")
    for name in stylus:
        if name not in ("EXt", "EYt", "EZt"):
            raise fields["stylus"].wrong(f"EXt, EYt, EZt.{suggestion(name, ('EXt', 'EYt', 'EZt'))}", repr(name))
    effects = []
    for item in fields["effects"].list() if "effects" in fields else ():
        if "cause" not in dict(item.items()):
            near = next((f"; found {key!r}" for key, _ in item.items() if key.lower() == "cause"), "")
            raise item.wrong(f"a mapping with the key 'cause'{near}", "no cause")
        effects.append(item.plain())
    return World(
        numbers("errors"),
        stylus,
        numbers("facets"),
        fields["noise"].number(0, FURTHEST) if "noise" in fields else 0.0,
        tuple(effects),
        fields["seed"].integer(0) if "seed" in fields else 0,
    )
