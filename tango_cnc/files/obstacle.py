"""Entries of `obstacles` of artefact.yaml and machine.yaml: solids that nothing must hit (docs/formats.md)."""

from __future__ import annotations

import numpy as np

from ..records import InputError, Obstacle
from .checked import Node, complaint
from .hull import corners, read_hull

FOUNDATION = ("f", "b")  # as in a topology
KEYS = {"box": ["low", "high"], "cylinder": ["base", "axis", "radius", "height"], "hull": []}


def read_obstacle(node: Node, bodies: tuple[str, ...] | None = None, table: str | None = None) -> Obstacle:
    """entry, bodies that it may be on (None: the table, and no key says so), the body that is the table → obstacle.

    Raises InputError for another shape or body.
    """
    given = dict(node.items())
    kind = given.get("kind", node).text(list(KEYS))
    if bodies is None and "on" in given:
        raise given["on"].wrong(
            "no 'on' in artefact.yaml, where all stands on the table; what another body carries is in machine.yaml"
        )
    if bodies is not None and "on" not in given:
        raise complaint(node.file, node.line, node.path, "no key 'on'", f"'on' is required here: one of {', '.join(bodies)}")
    more = ["file", "shift", "points"] if kind == "hull" else []
    fields = node.fields(["kind", *KEYS[kind], *(["on"] if bodies is not None else [])], ["name", *more])
    title = fields["name"].text() if "name" in fields else None
    on = None if bodies is None else _body(fields["on"], bodies, table)
    if kind == "hull":
        return _hull(node, fields, title, on)
    if kind == "box":
        return Obstacle("box", low=fields["low"].vector(), high=fields["high"].vector(), title=title, on=on)
    return Obstacle(
        "cylinder",
        base=fields["base"].vector(),
        axis=fields["axis"].unit_vector(),
        radius=fields["radius"].size(),
        height=fields["height"].size(),
        title=title,
        on=on,
    )


def _body(node: Node, bodies: tuple[str, ...], table: str | None) -> str:
    """entry `on`, bodies, the one that is the table → the body, f for the foundation whatever the topology calls it."""
    found = "f" if node.text() in FOUNDATION else node.text()
    if found in ("table", "w", table):
        said = f"{found!r}, which is the table" if found == table else repr(found)
        raise node.wrong(f"{', '.join(bodies)}; what stands on the table is described in artefact.yaml", said)
    if found in ("S", "t", "spindle", "probe"):
        said = "the probe is described under probe: body_radius, body_length, nose_radius"
        raise node.wrong(f"{', '.join(bodies)}; {said}", repr(found))
    if found not in bodies:
        node.text(bodies)
    return found


def _hull(node: Node, fields: dict[str, Node], title: str | None, on: str | None) -> Obstacle:
    shapes = [key for key in fields if key in ("file", "shift", "points")]
    if ("file" in shapes) == ("points" in shapes) or ("shift" in shapes and "points" in shapes):
        raise node.wrong("a 'file', with a 'shift' if need be, or 'points'", " and ".join(["kind", *shapes]))
    try:
        if "points" in fields:
            points = np.array([item.vector() for item in fields["points"].list()]).reshape(-1, 3)
            return Obstacle("hull", points=corners("points", points), title=title, on=on)
        name, drawing = fields["file"].text(), fields["file"].named(node.file.parent)
        shift = fields["shift"].vector() if "shift" in fields else (0.0, 0.0, 0.0)
        return Obstacle("hull", points=read_hull(drawing, shift, node.file.name), file=name, title=title, on=on)
    except InputError as error:
        raise (
            error if str(error).startswith(f"{node.file}:") else InputError(f"{node.file}:{node.line}: {node.path}: {error}")
        ) from None
