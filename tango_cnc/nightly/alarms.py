"""What changed → an alarm: its text, since when, what it does to parts, and what to do."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..records import Array, Cell
from ..report.texts import texts
from ..state import Frame, Hypothesis, Named, State, Tonight, hypotheses
from ..state.effect import Effect, alike, like_the_stylus, moved_on_parts, on_parts
from ..state.filter import sigma_of
from ..texts import joined, say
from ..texts.number import number
from .dates import Since
from .words import as_recorded, cause_texts, changed, on_part, sizes_of, value

FAR = 1e-6  # p-value of what a story leaves, below which it is not the whole story
MOSTLY = 0.95  # share of what has changed that a story explains for it to be reported as the whole one
FARTHEST = 5.0  # mm that a stylus, a table or a ball moves and is still touched as planned
TURNED = re.compile(r"E[ABC]0([XYZABCS])")


@dataclass(frozen=True)
class Known:
    """What alarms are worded with: the cell, what is followed, and (m, 3, p) mm of the volume by unknown."""

    cell: Cell
    followed: Frame
    lever: Array

    @cached_property
    def tried(self) -> tuple[Hypothesis, ...]:
        """→ every cause of a change, but for that of a temperature: the same every night."""
        return hypotheses(self.followed, None)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """→ (p,) names under which the record has what is followed."""
        return tuple(self.followed.selection.label(name) for name in self.followed.names)

    def worst(self, moved: Array) -> float:
        """(p,) change of the unknowns → µm at the worst pose of the volume."""
        return float(np.linalg.norm(self.lever @ moved, axis=1).max()) * 1e3

    def spread(self, directions: Array, size: Array, std: Array) -> float:
        """(p, m) directions, (m,) sizes, (m,) their standard deviations → mm, of the error at the pose where it is largest."""
        error = self.lever @ (directions @ size)
        pose = int(np.argmax(np.linalg.norm(error, axis=1)))
        along = (self.lever[pose] @ directions).T @ error[pose] / max(float(np.linalg.norm(error[pose])), 1e-12)
        return float(np.linalg.norm(along * np.where(np.isfinite(std), std, 0.0)))


def alarms_of(k: Known, before: Since, ahead: State, tonight: Tonight, named: Named | None) -> list[dict[str, Any]]:
    """what is known, since when, prediction, test of the night, its best story → the alarms of the record: one for each cause, so
    that each is answered by itself, one for what they do not explain, and one for single touches that scatter.
    """
    whole = tonight.statistic / tonight.scale
    scatters = [_scatter(k, before, ahead, tonight)] if tonight.wider > 1 else []
    if named is None or (named.remains < FAR and named.told < 0.5 * whole):
        if tonight.p_noise < tonight.p_machine:
            return scatters or [_scatter(k, before, ahead, tonight)]
        return [_unknown(k, before, tonight, named), *scatters]
    found = [of_cause(k, before, one) for one in named.all]
    left = whole - named.told
    plain = bool(named.more) and named.more[0].explained >= 0.5 * (left - tonight.dof)
    if plain or (named.all[-1].remains < FAR and named.told < MOSTLY * whole):
        found.append(_rest(k, before, named, left - tonight.dof))
    return [*found, *scatters]


def of_cause(k: Known, before: Since, named: Named) -> dict[str, Any]:
    """what is known, since when, a cause with its size → its alarm."""
    h = named.hypothesis
    size, std, text = said_of(k, before, named)
    alarm = _alarm(before, h.cause, h.parameter, text, named.sigmas) | {"size": size, "std": std, "unit": h.unit}
    alarm["instead"] = others(k, h.parameter, named.instead)
    alarm |= as_recorded(alike(k.cell.machine, h.parameter))
    effect, on_part, do = effect_of(k, h.cause, h.parameter, size, h.unit, h.directions @ named.size, before.date)
    if h.cause == "stylus" and (pivot := _pivot(k, named)) is not None:
        name, found = pivot
        (axis, angle), *_ = found.turned.items()
        told = {"axis": axis, "angle": f"{abs(angle):.0f}", "effect": number(found.worst, "µm", signed=False), "since": before.date}
        effect, on_part, do = found.worst, texts()("part.pivot_since", **told), texts()("part.pivot_do", axis=axis)
        alarm["instead"] = [name, *(x for x in alarm["instead"] if x != name)]
    return alarm | {"on_part_um": effect, "on_part": on_part, "do": do}


def _alarm(before: Since, cause: str, parameter: str, text: str, sigmas: float) -> dict[str, Any]:
    told: dict[str, Any] = {"id": "", "since": before.date, "rate_per_day": None, "instead": []}
    told |= {"cause": cause, "parameter": parameter}
    return told | {"text": text, "size": 0.0, "std": 0.0, "unit": "", "sigmas": sigmas}


def _scatter(k: Known, before: Since, ahead: State, tonight: Tonight) -> dict[str, Any]:
    """→ the alarm of a night whose single touches scatter."""
    dof = max(tonight.noise[1], 1)
    size = float(np.sqrt(tonight.noise[0] / dof))
    sigmas = float(np.sqrt(2 * max(-np.log(max(tonight.p_noise, 1e-300)), 0.0)))
    usual = number(sigma_of(ahead) * 1e3, "µm", signed=False, decimals=2)
    text = texts()("changed.noise_level", size=number(size * 1e3, "µm", signed=False, decimals=2), usual=usual)
    alarm = _alarm(before, "noise_level", "probe", text, sigmas)
    return _of_nothing(k, before, alarm | {"size": size, "std": size / float(np.sqrt(2 * dof)), "unit": "mm"})


def _unknown(k: Known, before: Since, tonight: Tonight, named: Named | None) -> dict[str, Any]:
    """→ the alarm of a night that no cause explains: the machine is not as it was."""
    sigmas = float(np.sqrt(max(tonight.statistic / tonight.scale - tonight.dof, 0.0)))
    alarm = _alarm(before, "unknown", "several", texts()("changed.unknown"), sigmas)
    if named is not None:
        alarm["instead"] = [named.hypothesis.parameter, *named.instead]
    return _of_nothing(k, before, alarm)


def _of_nothing(k: Known, before: Since, alarm: dict[str, Any]) -> dict[str, Any]:
    """→ an alarm that is of no parameter of the machine, with what it does to parts and what to do."""
    nothing = np.zeros(len(k.followed.names))
    told = effect_of(k, alarm["cause"], alarm["parameter"], alarm["size"], alarm["unit"], nothing, before.date)
    return alarm | dict(zip(("on_part_um", "on_part", "do"), told, strict=True))


def _rest(k: Known, before: Since, named: Named, left: float) -> dict[str, Any]:
    """→ the alarm of what the causes of the night leave, above chance: what it looks like, where it looks like anything."""
    alarm = _alarm(before, "unknown", "several", texts()("changed.rest"), float(np.sqrt(max(left, 0.0))))
    if named.more:
        first = named.more[0]
        like = said_of(k, before, first)[2]
        alarm |= {"text": texts()("changed.rest_like", like=like), "instead": [n.hypothesis.parameter for n in named.more]}
    return _of_nothing(k, before, alarm)


def effect_of(
    k: Known, cause: str, parameter: str, size: float, unit: str, moved: Array, since: str = ""
) -> tuple[float, str, str]:
    """cause, parameter, size in its unit, (p,) change of the unknowns, date of the last night without the change ('': the size is
    the whole error) → µm at most on a part, what that means, what to do.
    """
    t = texts()
    match = TURNED.fullmatch(parameter) if cause == "axis_location" else None
    if match and match[1] in k.cell.machine.linear:
        length = _range(k.cell, match[1], 1000.0)
        effect = abs(size) * length * 1e3
        sizes = {"length": f"{length:.0f}", "effect": number(effect, "µm", signed=False)}
        return effect, on_part(_key("square", since), since, axis=match[1], **sizes), t("part.square_do")
    if cause == "axis_location" and (found := on_parts(k.cell, parameter, size)) is not None:
        return found.worst, _turned(found, match[1] if match else "", unit, since), t("cause.axis_location.do")
    effect = abs(size) * 1e3 if unit == "mm" else k.worst(moved)
    if cause == "temperature":  # more than the tip after the best set-up: a part is set up once
        effect = max(effect, moved_on_parts(k.cell, {k.labels[i]: float(moved[i]) for i in k.followed.machine}))
    return (effect, *cause_texts(cause, effect, since))


def _turned(found: Effect, tilted: str, unit: str, since: str) -> str:
    """effect on a part, tilted rotary axis or '', unit of the error, date of the change or '' → a sentence."""
    size, turned = number(found.worst, "µm", signed=False), list(found.turned.items())
    if unit == "mm" and turned:
        (axis, angle), *more = turned
        told = {"axis": axis, "angle": f"{abs(angle):.0f}", "effect": size}
        if not more:
            return on_part(_key("turned", since), since, **told)
        return on_part(_key("turned_both", since), since, **told, other=more[0][0], other_angle=f"{abs(more[0][1]):.0f}")
    if tilted and tilted != "S":
        return on_part(_key("tilted", since), since, axis=tilted, effect=size)
    return cause_texts("axis_location", found.worst, since)[0]


def _key(name: str, since: str) -> str:
    return f"part.{name}_since" if since else f"part.{name}"


def others(k: Known, parameter: str, near: Sequence[str] = ()) -> list[str]:
    """what is known, parameter that is named, stories that fit nearly as well → what else it may be: these, and the locations that
    no touch on this machine tells from it.
    """
    return [name for name in dict.fromkeys((*alike(k.cell.machine, parameter), *near)) if name != parameter]


def _pivot(k: Known, named: Named) -> tuple[str, Effect] | None:
    """what is known, a stylus that has moved → location that no touch tells from it, and what that does to a part; or None."""
    moved, spread = np.zeros(3), np.zeros(3)
    for axis, size, std in zip(named.hypothesis.axes, named.size, named.std, strict=True):
        moved["XYZ".index(axis)], spread["XYZ".index(axis)] = size, std if np.isfinite(std) else 0.0
    for name, direction in like_the_stylus(k.cell.machine).items():
        along = np.array(direction)
        size = float(moved @ along / (along @ along))
        if np.all(np.abs(moved - size * along) <= np.maximum(4 * spread, 0.1 * abs(size))):
            found = on_parts(k.cell, name, size)
            if found is not None and found.turned:
                return name, found
    return None


def _range(cell: Cell, axis: str, endless: float) -> float:
    """cell, axis → mm or rad of its travel; `endless` where none is stated."""
    travel = next((a.travel for a in cell.machine.axes if a.name == axis), None)
    return endless if travel is None else travel[1] - travel[0]


def said_of(k: Known, before: Since, named: Named) -> tuple[float, float, str]:
    """what is known, since when, a cause with its size → size, standard deviation, a sentence without its full stop."""
    h = named.hypothesis
    if h.cause == "temperature":
        worst = k.worst(h.directions @ named.size)
        told = texts()("changed.temperature", size=number(worst, "µm", signed=False))
        return worst / 1e3, k.spread(h.directions, named.size, named.std), told
    if h.cause == "ball" or (len(h.axes) == 3 and h.cause in ("table", "stylus")):
        size = named.length
        towards = joined(", ", (joined(" ", (a, value(v, "mm"))) for a, v in zip(h.axes, named.size, strict=True)))
        finite = named.std[np.isfinite(named.std)]
        name = {"name": _place(h.parameter)} if h.cause == "ball" else {}
        told = texts()(f"changed.{h.cause}", size=value(size, "mm", signed=False), towards=towards, since=before.words, **name)
        if size > FARTHEST:
            told = texts()(f"changed.far_{h.cause}", size=f"{FARTHEST:g}", since=before.words, **name)
        return size, float(finite.max()) if len(finite) else 0.0, told
    size, std = float(named.size[0]), float(named.std[0])
    told = value(size, h.unit, std)
    if h.cause in ("facet", "pretravel", "scales"):
        name = {"name": _place(h.parameter)} if h.cause == "facet" else {}
        early = h.cause == "pretravel" and size < 0
        told = value(abs(size), h.unit, std, signed=False) if h.cause == "pretravel" else told
        return (
            size,
            std,
            texts()("changed.pretravel_early" if early else f"changed.{h.cause}", size=told, since=before.words, **name),
        )
    same = alike(k.cell.machine, h.parameter)
    return size, std, changed(h.parameter, told, before.words, same, sizes_of(same, size, std))


def _place(parameter: str) -> str:
    """facet 12, ball 1 → the same as a text."""
    kind, _, name = parameter.partition(" ")
    return say(f"followed.{kind}", name=name)
