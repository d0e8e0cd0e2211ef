"""What `tango design` tells of a plan that it proposes: strategy.yaml with reasons, JSON, text."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import yaml

from .. import kinematics
from ..design import doubts, floor, order, propose, region, sequence, timed
from ..design.balls import unknowns
from ..design.changed import Change
from ..design.check import ALARMS, POWER, Power
from ..design.enough import SPARE, determined, to_spare, widened
from ..design.goals import COARSE, USUAL_MINUTES
from ..design.here import most_in_a_row
from ..design.left_out import left_out, sentences
from ..design.problem import Chosen
from ..design.propose import Setting
from ..design.relaxed import efficiency
from ..design.shortest import touches_hold
from ..duration import spoken
from ..files.learned import FIELDS
from ..files.write import dump
from ..judgement import Judgement
from ..records import Array, Strategy, TermItem
from ..report.drawn import Drawn
from ..report.texts import texts
from ..report.units import shown
from ..terms import inter_axis
from ._stylus import lengths_said

REASONS = 3  # parameters that are named for an indexation
TELLS = 1.05  # times a standard deviation grows without an indexation that tells something of the parameter


def as_json(ready: Setting, found: Chosen, why: str, sees: Power | None, others: Mapping[str, float]) -> dict[str, Any]:
    """setting, plan, why it touches as it does, what a check sees, φ of other plans → plain data of the format tango-design/1."""
    facets = [touch.facet for touch in found.plan.touches]
    widens = widened(ready.problem.choice, facets)
    amount, unit = propose.reached(ready, found.value, widens)
    data: dict[str, Any] = {
        "format": "tango-design/1",
        "goal": ready.wish.goal.text,
        "machine": found.cell.machine.name,
        "terms": list(ready.wish.terms),
        "touches": len(found.rows),
        "indexations": len(found.cell.strategy.indexations),
        "unknowns": unknowns(ready.problem.choice, facets),
        "time_s": round(found.seconds, 3),
        "time_by_part_s": {part: round(s, 3) for part, s in timed.parts_of(found).items()},
        "positioning_feed": ready.problem.feed,
        "criterion": {"value": amount, "unit": unit, "most_uncertain": propose.most_uncertain(ready, found.information)},
        "determined": determined(found.problem, found.information),
        "widened": widens,
        "to_spare": None if sees is not None else to_spare(found),
        "approach": why,
        "region": region.counted(found.cell.machine, ready.where, ready.lever.position),
        "correlation_with_time": _with_time(found),
        "expected_std": {n: {"std": s, "unit": u} for n, (s, u) in propose.std_of(ready, found.information, widens).items()},
        "not_identifiable": [c.text for c in ready.problem.choice.selection.unseen],
        "weak": doubts.weak(ready, found, widens),
        **doubts.untrusted(ready, found),
    }
    if (without := left_out(ready.problem)) is not None and (said := sentences(without)):
        data["left_out"] = {**asdict(without), "text": said}
    if not ready.wish.goal.word and ready.wish.minutes is None:
        data["no_shorter"] = no_shorter(data["unknowns"], data["touches"]) if touches_hold(found) else None
    if others:
        data["competitors"] = {name: propose.reached(ready, phi, widens)[0] for name, phi in others.items()}
    if np.isfinite(found.bound):
        data["certificate"] = {
            "bound": propose.reached(ready, found.bound, widens)[0],
            "efficiency": found.efficiency,
            "bound_at_these_indexations": propose.reached(ready, found.here, widens)[0],
            "efficiency_at_these_indexations": efficiency(
                found.problem.criterion, found.value, found.here, len(found.problem.held)
            ),
            "touches_in_a_row": most_in_a_row(found),
            "seconds_per_facet": found.costs[0] / found.problem.times * most_in_a_row(found),
            "seconds_per_indexation": found.costs[1],
        }
    if sees is None and not ready.problem.criterion.determinant:
        data["broken_off"] = _broken_off(ready, found)
    if sees is not None:
        data["check"] = {
            "power": POWER,
            "false_alarms": ALARMS,
            "stylus_um": 1e3 * ready.wish.stylus,
            "full_run_s": None if ready.full is None else round(ready.full, 3),
            "limit_um": 1e3 * sees.limit,
            "size_um": 1e3 * sees.size,
            "missed_below_um": {n: 1e3 * s for n, s in sees.others.items() if math.isfinite(s)},
            "unseen": [n for n, s in sees.others.items() if not math.isfinite(s)],
        }
        least = floor.floor(found, sees.size) if np.isfinite(found.bound) else None
        data["check"]["floor"] = None if least is None else _floored(least, sees.size)
    return data


def _floored(least: floor.Floor, size: float) -> dict[str, Any]:
    """what no check sees, mm that this one sees → plain data."""
    return {
        "this_time_um": 1e3 * least.now,
        "any_time_um": 1e3 * least.ever,
        "wished_um": 1e3 * floor.WISHED,
        "wished_minutes": least.minutes,
        "text": floor.lines(least, size),
    }


def _broken_off(ready: Setting, found: Chosen) -> list[dict[str, Any]]:
    """setting, plan → of parts of the time what they are worth, what a plan of that time is, and how many times that it is."""
    parts, said = (*sequence.FRACTIONS, 1.0), []
    for part, phi in zip(parts, timed.broken_off(found, parts), strict=True):
        one: dict[str, Any] = {"part": part, "value": propose.reached(ready, float(phi))[0] if phi < np.inf else None}
        if part < 1:
            other = found.designed.get(part)
            one["designed"] = None if other is None else propose.reached(ready, other)[0]
            one["times"] = None if other is None or phi == np.inf else float((phi / other) ** 0.5)
        said.append(one)
    return said


def _with_time(found: Chosen) -> float:
    rotary = [found.cell.machine.column(name) for name in found.cell.machine.rotary]
    position = np.array([touch.contact for touch in found.plan.touches])[:, rotary]
    return round(order.runs_with_time(position, found.time), 3)


def as_text(ready: Setting, data: dict[str, Any]) -> str:
    """setting, result of `as_json` → what a person reads on the terminal."""
    value, unit = data["criterion"]["value"], data["criterion"]["unit"]
    lines = [
        f"{data['touches']} touches at {data['indexations']} indexations, predicted time {_clock(data['time_s'])}: "
        + ", ".join(f"{part} {_clock(s)}" for part, s in data["time_by_part_s"].items()),
        *data.get("left_out", {}).get("text", ()),
        f"approach: {data['approach']}",
        _means(data["goal"], value, unit, data["criterion"]["most_uncertain"]),
    ]
    lines += [data["no_shorter"]] if data.get("no_shorter") else []
    if not data["determined"]:
        lines.append("these touches do not determine what the goal asks for: take no number of it at its word, and allow more time")
    if data["to_spare"] is not None and data["to_spare"] < SPARE:
        lines.append(
            f"there are {data['to_spare']} touches to spare; with fewer than {SPARE} nothing shows whether the result may be "
            "believed: allow more time"
        )
    lines += _not_usual(ready, data)
    if "certificate" in data:
        own = data["certificate"]
        lines.append(
            f"no plan of this time with {own['seconds_per_facet'] / own['touches_in_a_row']:.1f} s for a touch, "
            f"{own['touches_in_a_row']} of a facet in a row at most, and "
            f"{own['seconds_per_indexation']:.1f} s for a turn gets below {own['bound']:.3g} {unit}, "
            f"not even with parts of a turn: efficiency {100 * own['efficiency']:.0f} %"
        )
        if own["bound_at_these_indexations"] > own["bound"]:
            lines.append(
                f"no other choice of facets at these indexations gets below {own['bound_at_these_indexations']:.3g} {unit}: "
                f"efficiency {100 * own['efficiency_at_these_indexations']:.0f} %"
            )
    if "competitors" in data:
        said = ", ".join(f"{name} {other:.3g}" for name, other in data["competitors"].items())
        lines.append(f"other plans of this time ({unit}): {said}")
    if "second_stylus" in data:
        own = data["second_stylus"]
        more = ", ".join(name for name in own["more"] if name not in own["by_length"]["adds"]) or "none"
        lines.append(f"ISO figures that it decides: {own['alone']} of {own['figures']} ('tango iso230')")
        again = f"every touch again with a stylus of {own['length_mm']:g} mm: {own['together']}, in twice the time"
        lines.append(f"{again}; more by their number: {more}")
        lines.append(lengths_said(own["by_length"], ", ".join))
    if "broken_off" in data:
        said = ", ".join(f"{_known(b['value'])} at {100 * b['part']:.0f} %{_beside(b)}" for b in data["broken_off"])
        lines.append(f"broken off, what 'tango estimate' then makes of it ({unit}): {said}")
    if "check" in data:
        lines += [*longer(data["time_s"], data["check"]["full_run_s"]), *_seen(data["check"])]
    if ready.wish.goal.word not in ("D", "A", "condition"):
        lines.append(f"where parts are made: {data['region']} (--volume)")
    if ready.wish.terms != tuple(ready.problem.choice.cell.terms) and "check" not in data:
        said = option(ready.wish.terms)
        lines.append(
            f"this is of the terms {said}: give them to 'tango check' and 'tango estimate' with --terms {shlex.quote(said)}"
        )
    lines.append(f"time runs with the position of a rotary axis by a correlation of {data['correlation_with_time']:.2f} at most")
    lines += [f"cannot be seen: {text}" for text in data["not_identifiable"]]
    lines += doubts.lines(data)
    return "\n".join(lines)


def no_shorter(unknowns: int, touches: int) -> str:
    """unknowns of the estimate, touches of the shortest plan → why it is no shorter although its limits would allow that."""
    return (
        f"it is no shorter because of its touches, not of its limits: 'tango estimate' has {unknowns} unknowns of them (those of "
        f"machine, stylus and every facet) and needs {SPARE} touches more, {unknowns + SPARE} in all; this plan has {touches}"
    )


def _not_usual(ready: Setting, data: dict[str, Any]) -> list[str]:
    """setting, result of `as_json` → that the usual time did not do, where nobody stated a time."""
    usual = USUAL_MINUTES.get(ready.wish.goal.word)
    if ready.wish.minutes is not None or usual is None or data["time_s"] <= 60 * usual or "check" in data:
        return []
    return [f"the usual {usual:g} minutes do not do for this goal here, so it takes as long as it needs (--minutes states a time)"]


def _beside(part: Mapping[str, Any]) -> str:
    """a part of the time → how it compares with a plan of that time, if there is one."""
    if part.get("designed") is None:
        return ""
    times = "" if part["times"] is None else f"{part['times']:.2f} times the "
    return f" ({times}{part['designed']:.3g} of a plan of that time)"


def _known(value: float | None) -> str:
    return "not determined" if value is None else f"{value:.3g}"


def _clock(seconds: float) -> str:
    """s → '45 s', '2 min 12 s': a quarter of a minute is much of a short plan."""
    return spoken(seconds) if seconds < 90 else f"{round(seconds) // 60} min {round(seconds) % 60} s"


def _means(goal: str, value: float, unit: str, worst: str | None) -> str:
    """goal, what the plan reaches, its unit, the parameter that is farthest from its limit → a line of the terminal."""
    said = {
        "volume": f"uncertainty of the tool tip where parts are made: {value:.3g} {unit} (rms, one standard deviation)",
        "check": f"most uncertain change of the tool tip where parts are made: {value:.3g} {unit} (one standard deviation)",
        "locations": _of_locations(value, worst),
        "D": f"volume of the confidence ellipsoid: {value:.4g} {unit}",
        "A": f"uncertainty of all parameters, scaled by what they do to a touch: {value:.3g} {unit}",
        "condition": f"most uncertain combination of parameters: {value:.3g} {unit}",
    }
    named = f", {worst}," if worst else ""
    return said.get(goal, f"the most uncertain of these parameters{named} reaches {100 * value:.0f} % of its limit")


def _of_locations(value: float, worst: str | None) -> str:
    """largest ratio to the usual limits, of which parameter → what it does to a part."""
    if worst is None or inter_axis.PATTERN.fullmatch(worst):
        named = "" if worst is None else f", {worst},"
        return f"the most uncertain axis location{named} moves a part by {value:.3g} µm (one standard deviation)"
    return (
        f"the most uncertain parameter, {worst}, moves a part by {COARSE * value:.3g} µm (one standard deviation); axis locations "
        f"are known to {value:.3g} µm or better, {COARSE:g} times as well as what is no location has to be"
    )


def longer(seconds: float, full: float | None) -> list[str]:
    """s of a check, of the full run that it rests on → what to do where the check saves no time."""
    if full is None or seconds < full:
        return []
    return [
        f"this check takes longer than the full run that it rests on ({_clock(full)}): make that run again instead, "
        "which says more, or state a shorter time with --minutes"
    ]


def _seen(check: dict[str, Any]) -> list[str]:
    small = f"{check['size_um']:.1f} µm"
    lines = [
        f"a change of axis locations, gains and backlashes that moves the tool tip by {small} anywhere there is seen with "
        f"{100 * check['power']:.0f} % power at 1/{1 / check['false_alarms']:.0f} false alarms",
        _stylus(check["stylus_um"]),
        "it rests on the full run: 'tango check' says what these touches alone do not determine",
    ]
    lines += (check["floor"] or {}).get("text", [])
    missed = sorted(((s, n) for n, s in check["missed_below_um"].items() if s > check["size_um"]), reverse=True)
    if missed:
        said = ", ".join(f"{n} below {s:.0f} µm" for s, n in missed[:6])
        more = f" and {len(missed) - 6} more (--json lists all)" if len(missed) > 6 else ""
        lines.append(f"changes of single error motions that it could miss: {said}{more}")
    if check["unseen"]:
        lines.append(f"it sees nothing of {', '.join(check['unseen'])}")
    return lines


def _stylus(size: float) -> str:
    if not size:
        return "this takes it that the stylus has stayed in the spindle since the full run (--stylus-within)"
    return f"this takes it that the stylus comes back to the spindle within {size:g} µm (one standard deviation; --stylus-within)"


def change_json(found: Change, known: Judgement) -> dict[str, Any]:
    """what a check says, where its readings come from → plain data of the format tango-change/1."""
    return {
        "format": "tango-change/1",
        "changed": found.changed,
        "moved_um": 1e3 * found.moved,
        "limit_um": 1e3 * found.limit,
        "p_other": found.p_other,
        "p_left": found.p_left,
        "false_alarms": found.alarms,
        "parameters": {
            name: {"change": change, "std": std, "unit": found.units[name]} for name, (change, std) in found.parameters.items()
        },
        "reasons": list(known.reasons),
        "remarks": list(known.remarks),
    }


def change_text(found: Change) -> str:
    """what a check says → what a person reads: one verdict, then what it rests on."""
    moved, limit = 1e3 * found.moved, 1e3 * found.limit
    rate = f"one false alarm in {1 / found.alarms:.0f} checks"
    far = f"where parts are made the tool tip has moved by up to {moved:.1f} µm since the full run"
    if not found.changed:
        return (
            f"not changed: where parts are made the tool tip seems to have moved by {moved:.1f} µm at most since the full run; "
            f"more than {limit:.1f} µm would be an alarm ({rate})"
        )
    lines = []
    (name, (change, std)), *_ = found.parameters.items()
    factor, unit = shown(found.units[name])
    surest = f"the surest parameter is {name}: {change * factor:+.1f} ± {std * factor:.1f} {unit}".rstrip()
    if found.moved > found.limit:
        lines += [f"changed: {far}; more than {limit:.1f} µm is an alarm ({rate})", surest]
    if found.other:
        other = f"the touches differ from what the full run predicts (p = {found.p_other:.1g})"
        lines.append(f"besides, {other}" if lines else f"changed: {other}; {rate} is by chance")
        if len(lines) == 1 and found.explained:
            by = far.removeprefix("where parts are made ")
            lines += [
                surest,
                f"changes of axis locations, gains and backlashes explain it: by these {by}; {limit:.1f} µm are no alarm",
            ]
        elif len(lines) == 1:
            lines.append(
                f"axis locations, gains and backlashes do not explain it: by these {far.removeprefix('where parts are made ')}, "
                f"and {limit:.1f} µm are no alarm. A facet, a ball or the stylus may have moved, or an error motion"
            )
    return "\n".join([*lines, "Make a full run."])


def drawn(ready: Setting, found: Chosen) -> Drawn:
    """setting, plan → what its pictures show."""
    parts = np.linspace(0.02, 1.0, 40)
    values = [propose.reached(ready, float(v))[0] if v < np.inf else np.nan for v in timed.broken_off(found, parts.tolist())]
    machine, at = found.cell.machine, np.array([touch.indexation for touch in found.plan.touches])
    names = machine.rotary[:2]
    angles = np.degrees([[i.position[n] for n in names] for i in found.cell.strategy.indexations]).reshape(-1, len(names))
    choice = ready.problem.choice
    p = ready.lever.steady.shape[2]
    covariance = np.linalg.inv(found.information)[:p, :p] * choice.sigma**2
    moved = ready.lever.steady * choice.scale[:p]
    spread = moved @ covariance @ np.swapaxes(moved, 1, 2)
    std = 1e3 * np.sqrt(np.clip(np.linalg.eigvalsh(spread)[:, -1], 0, None))
    place = kinematics.tip(kinematics.chain(machine), ready.lever.position)
    said = texts()(f"design.y_{_figure(ready)}", unit=propose.reached(ready, found.value)[1])
    return Drawn(parts * found.seconds / 60, np.array(values), said, angles, names, np.bincount(at).astype(float), place, std)


def _figure(ready: Setting) -> str:
    """setting → which text says what the goal's number is."""
    word = ready.wish.goal.word
    return {"volume": "tip", "check": "change", "locations": "location", "D": "ellipsoid", "": "limit"}.get(word, "parameters")


def strategy_text(found: Chosen, data: dict[str, Any], lines: Sequence[str]) -> str:
    """plan, result of `as_json`, lines for people → strategy.yaml, with why it is so as comments."""
    strategy, why = found.cell.strategy, reasons(found)
    approach = {key: value for key, value in vars(strategy.approach).items() if value is not None}
    if strategy.approach.find is not None:
        approach["find"] = dict(vars(strategy.approach.find))
    comments = [f"# {line}" for line in lines]
    head = dump({"name": f"design {data['goal']}, {data['touches']} touches", "approach": approach}).rstrip()
    body = []
    for number, (indexation, reason) in enumerate(zip(_plain(strategy), why, strict=True), 1):
        flow = yaml.safe_dump(indexation, default_flow_style=True, sort_keys=False, width=10**6).strip()
        minutes = found.time[[t.indexation for t in found.plan.touches].index(number - 1)] / 60
        body.append(f"  - {flow}  # {number}, from {minutes:.1f} min: {reason}")
    return "\n".join([*comments, head, "indexations:", *body]) + "\n"


def _plain(strategy: Strategy) -> list[dict[str, Any]]:
    def number(value: float) -> float | int:
        degrees = round(math.degrees(value), 6) + 0.0
        return int(degrees) if degrees == int(degrees) else degrees

    return [
        {"S": number(i.position.get("S", 0.0))}
        | {name: number(value) for name, value in i.position.items() if name != "S"}
        | {"facets": [int(f) if f.isdecimal() and str(int(f)) == f else f for f in i.facets]}
        for i in strategy.indexations
    ]


def reasons(found: Chosen) -> list[str]:
    """plan → of each indexation the parameters that would be most uncertain without it."""
    choice = found.problem.choice
    at = np.array([touch.indexation for touch in found.plan.touches])
    count = len(choice.selection.model.coefficients)
    labels = [choice.selection.label(c.name) for c in choice.selection.model.coefficients]
    std = _std(found.information)[:count]
    said = []
    last = len(found.cell.strategy.indexations) - 1
    for number in range(last + 1):
        rows = found.rows[at == number]
        without = _std(found.information - rows.T @ rows)[:count] / std
        most = [i for i in np.argsort(-without)[:REASONS] if without[i] > TELLS]
        text = ", ".join(f"{labels[i]} ×{without[i]:.2g}" for i in most)
        if number == last and found.problem.repeats:
            said.append("as the first one: drift since then, and outliers, show here")
        else:
            said.append(f"without it {text}" if text else "repeats what others measure, so that outliers show")
    return said


def _std(information: Array) -> Array:
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(information))))


def option(terms: Sequence[TermItem]) -> str:
    """terms → the same as --terms takes them: a learned shape by its name, for its numbers are in its file."""
    plain = [item if isinstance(item, str) else {k: v for k, v in item.items() if k not in FIELDS} for item in terms]
    if all(isinstance(item, str) for item in plain):
        return ",".join(map(str, plain))
    return yaml.safe_dump(plain, default_flow_style=True, sort_keys=False, width=10_000).strip()
