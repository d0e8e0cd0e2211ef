"""Records → YAML text in the public formats, and files that are either written whole or not at all."""

from __future__ import annotations

import math
import os
import stat
import tempfile
from pathlib import Path
from typing import Any

import yaml

from ..records import Artefact, Axis, Facet, Id, Machine, Obstacle, Probe, Strategy, World
from .tolerances import tolerances_given


class _Dumper(yaml.SafeDumper):
    """Mappings of a file's first two levels in block style, whatever is below in one line."""


def _quoted(dumper: yaml.SafeDumper, text: str) -> yaml.Node:
    """text → scalar, in quotes where a reader would take it for a number, as the hash 2E9312264611."""
    try:
        float(text)
    except ValueError:
        return dumper.represent_str(text)
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style="'")


_Dumper.add_representer(str, _quoted)


def dump(data: Any) -> str:
    """plain data → YAML text, keys in the given order."""
    return yaml.dump(data, Dumper=_Dumper, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)


def write_text(file: Path, text: str, encoding: str = "utf-8") -> None:
    """text, encoding → file, durable and never half written: a temporary file in the same folder takes its place.

    Raises OSError with the name of the file: a disk that is full does not say what was written.
    """
    try:
        _replaced(file, text, encoding)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(file)) from error


def _replaced(file: Path, text: str, encoding: str) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}.")
    try:
        with os.fdopen(handle, "w", encoding=encoding, newline="\n") as out:
            out.write(text)
            out.flush()
            os.fsync(out.fileno())
        os.chmod(name, mode(file))
        os.replace(name, file)
    except BaseException:
        os.unlink(name)
        raise


def mode(file: Path) -> int:
    """file that is written → its rights: those that it has, else what the person's umask leaves."""
    try:
        return stat.S_IMODE(file.stat().st_mode)
    except OSError:
        before = os.umask(0o077)
        os.umask(before)
        return 0o666 & ~before


def _id(value: Id) -> int | str:
    return int(value) if value.isdecimal() and str(int(value)) == value else value


def _degrees(value: float) -> float:
    return round(math.degrees(value), 10) + 0.0


def machine_text(machine: Machine) -> str:
    """machine → text of machine.yaml."""
    usual = ("nose_radius", "max_feed")  # not written where they are as usual
    first = machine.styli[0] if machine.styli else machine.probe
    probe = {k: v for k, v in vars(first).items() if k not in usual or v != getattr(Probe, k)}
    styli = [{k: getattr(other, k) for k in ("length", "tip_radius", "stylus_radius")} for other in machine.styli[1:]]
    axes = {axis.name: _axis(axis) for axis in machine.axes}
    data = {"name": machine.name, "topology": machine.topology, "axes": axes, "probe": probe}
    given = tolerances_given(machine.tolerances)
    obstacles = [_obstacle(obstacle) for obstacle in machine.obstacles]
    more = {"styli": styli, "tolerances": given, "overhead": machine.overhead, "obstacles": obstacles}
    return dump(data | {key: value for key, value in more.items() if value})


def _axis(axis: Axis) -> dict[str, Any]:
    unit = (lambda v: v) if axis.kind == "linear" else _degrees
    data: dict[str, Any] = {"kind": axis.kind, "direction": list(axis.direction)}
    if axis.kind != "linear" or any(axis.point):
        data["point"] = list(axis.point)
    if axis.travel is not None:
        data["travel"] = [unit(value) for value in axis.travel]
    elif axis.kind == "rotary":
        data["endless"] = True
    if axis.rapid is not None:
        data["rapid"] = unit(axis.rapid)
    if axis.acceleration is not None:
        data["acceleration"] = axis.acceleration
    if axis.clamp_time:
        data["clamp_time"] = axis.clamp_time
    if axis.nearer:
        data["nearer"] = True
    return data


def artefact_text(artefact: Artefact) -> str:
    """artefact → text of artefact.yaml."""
    data: dict[str, Any] = {"name": artefact.name, "facets": {_id(f.id): _facet(f) for f in artefact.facets.values()}}
    if artefact.balls:
        data["balls"] = {_id(b.id): {"centre": list(b.centre), "radius": b.radius} for b in artefact.balls.values()}
    if artefact.scale_bar is not None:
        bar = artefact.scale_bar
        data["scale_bar"] = {"balls": [_id(b) for b in bar.balls], "length": bar.length, "uncertainty": bar.uncertainty}
    if artefact.obstacles:
        data["obstacles"] = [_obstacle(obstacle) for obstacle in artefact.obstacles]
    if given := tolerances_given(artefact.tolerances):
        data["tolerances"] = given
    return dump(data)


def _facet(facet: Facet) -> dict[str, Any]:
    data: dict[str, Any] = {"point": list(facet.point), "normal": list(facet.normal)}
    if facet.ball is not None:
        data["ball"] = _id(facet.ball)
    if facet.uncertainty is not None:
        data["uncertainty"] = facet.uncertainty
    if facet.surface is not None:
        surface = facet.surface
        data["surface"] = {"kind": surface.kind, "radius": surface.radius}
        if surface.axis is not None:
            data["surface"]["axis"] = list(surface.axis)
        if surface.inside:
            data["surface"]["inside"] = True
    return data


def _obstacle(obstacle: Obstacle) -> dict[str, Any]:
    named = {"name": obstacle.title, "on": obstacle.on}
    said = {key: value for key, value in named.items() if value is not None}
    if obstacle.points is not None:  # the file stays where it is: what is written here can be read from anywhere
        return {"kind": "hull", "points": [list(point) for point in obstacle.points], **said}
    own = {key: value for key, value in vars(obstacle).items() if value is not None and key not in ("title", "on")}
    return {key: list(value) if isinstance(value, tuple) else value for key, value in own.items()} | said


def strategy_text(strategy: Strategy) -> str:
    """strategy → text of strategy.yaml."""
    indexations = [
        {
            **{name: _degrees(value) for name, value in i.position.items()},
            **({"stylus": i.stylus} if i.stylus != 1 else {}),
            "facets": [_id(f) for f in i.facets],
        }
        for i in strategy.indexations
    ]
    approach = {key: value for key, value in vars(strategy.approach).items() if value is not None}
    if strategy.approach.find is not None:
        approach["find"] = dict(vars(strategy.approach.find))
    own = {} if strategy.obstructed is None else {"obstructed": strategy.obstructed}
    return dump({"name": strategy.name, "approach": approach, **own, "indexations": indexations})


def world_text(world: World) -> str:
    """world → text of world.yaml."""
    data: dict[str, Any] = {"errors": dict(world.errors), "stylus": dict(world.stylus)}
    data |= {"facets": {_id(key): value for key, value in world.facets.items()}, "noise": world.noise}
    data |= {"effects": [dict(effect) for effect in world.effects], "seed": world.seed}
    return dump(data)
