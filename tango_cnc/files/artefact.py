"""artefact.yaml → facets, balls, scale bar and obstacles (docs/formats.md)."""

from __future__ import annotations

from pathlib import Path

from ..judgement import TableTolerances
from ..records import Artefact, Ball, Facet, Id, ScaleBar, Surface
from .balls import check_bar, check_facets
from .checked import Node, load
from .obstacle import read_obstacle
from .tolerances import TABLE_TOLERANCES, read_tolerances


def read_artefact(file: Path) -> Artefact:
    """artefact.yaml → artefact. Raises InputError for a facet on, or a bar between, balls that nothing defines or elsewhere."""
    fields = load(file).fields(["name", "facets"], ["balls", "scale_bar", "obstacles", "tolerances"])
    balls = {key: _ball(key, child) for key, child in fields["balls"].items()} if "balls" in fields else {}
    facets = {key: _facet(key, child, balls) for key, child in fields["facets"].items()}
    if not facets:
        raise fields["facets"].wrong("at least one facet", "none")
    check_facets(facets, balls, fields)
    bar = _scale_bar(fields["scale_bar"], balls) if "scale_bar" in fields else None
    obstacles = tuple(read_obstacle(item) for item in fields["obstacles"].list()) if "obstacles" in fields else ()
    tolerances = TableTolerances(**read_tolerances(fields.get("tolerances"), TABLE_TOLERANCES))
    return Artefact(fields["name"].text(), facets, balls, bar, obstacles, tolerances)


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
