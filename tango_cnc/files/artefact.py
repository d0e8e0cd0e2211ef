"""artefact.yaml → facets, balls, scale bar and obstacles (docs/formats.md)."""

from __future__ import annotations

from pathlib import Path

from ..judgement import TableTolerances
from ..records import Artefact, Ball, Facet, Id, ScaleBar, Surface
from .balls import check_bar, check_facets
from .checked import Node, load, parse
from .gathered import gathered
from .obstacle import read_obstacle
from .tolerances import TABLE_TOLERANCES, read_tolerances


def read_artefact(file: Path, text: str | None = None) -> Artefact:
    """artefact.yaml, its text where it is not that of the file → artefact.

    Raises InputError for a facet on, or a bar between, balls that nothing defines or elsewhere.
    """
    with gathered() as read:
        fields = read.fields(
            load(file) if text is None else parse(file, text), ["name", "facets"], ["balls", "scale_bar", "obstacles", "tolerances"]
        )
        name = read(lambda: fields["name"].text())
        solids = read(lambda: fields["obstacles"].list()) if "obstacles" in fields else []
        obstacles = read.each(solids or (), read_obstacle)
        tolerances = read(lambda: TableTolerances(**read_tolerances(fields.get("tolerances"), TABLE_TOLERANCES)))
        balls = _balls(fields["balls"]) if "balls" in fields else {}
        facets = _facets(fields["facets"], balls)
        check_facets(facets, balls, fields)
        bar = _scale_bar(fields["scale_bar"], balls) if "scale_bar" in fields else None
    return Artefact(name, facets, balls, bar, tuple(obstacles), tolerances)


def _balls(node: Node) -> dict[Id, Ball]:
    with gathered() as read:
        items = read.once(node)
        balls = read.each(items, lambda item: _ball(*item))
    return {ball.id: ball for ball in balls}


def _facets(node: Node, balls: dict[Id, Ball]) -> dict[Id, Facet]:
    with gathered() as read:
        items = read.once(node)
        facets = read.each(items, lambda item: _facet(*item, balls))
        if not items:
            raise node.wrong("at least one facet", "none")
    return {facet.id: facet for facet in facets}


def _ball(key: Id, node: Node) -> Ball:
    fields = node.fields(["centre", "radius"])
    return Ball(node.called(key), fields["centre"].vector(), fields["radius"].size())


def _known_ball(node: Node, balls: dict[Id, Ball]) -> Id:
    ball = node.identifier()
    if ball not in balls:
        raise node.wrong(f"a ball of this file ({', '.join(balls) or 'it defines none'})")
    return ball


def _facet(key: Id, node: Node, balls: dict[Id, Ball]) -> Facet:
    with gathered() as read:
        fields = read.fields(node, ["point", "normal"], ["ball", "uncertainty", "surface"])
        point, normal = read(lambda: fields["point"].vector()), read(lambda: fields["normal"].unit_vector())
        ball = read(lambda: _known_ball(fields["ball"], balls)) if "ball" in fields else None
        uncertainty = read(fields["uncertainty"].size) if "uncertainty" in fields else None
        surface = read(lambda: _surface(fields["surface"])) if "surface" in fields else None
        name = read(lambda: node.called(key))
    return Facet(name, point, normal, ball, uncertainty, surface)


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
