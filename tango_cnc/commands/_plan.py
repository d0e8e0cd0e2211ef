"""What `tango plan` tells of a plan and its programs: what is not in it, moves, JSON, text."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..commission import remaining
from ..files import drawn_lines
from ..gate import BEHIND, proving_touch
from ..plan import OBSTRUCTED, USUAL, plan_hash
from ..records import Plan
from ._common import Decorator, table

if TYPE_CHECKING:
    from ..files.commissioning import Proof
    from ..program import Program

NAMED = 3  # doubtful touches that a warning names
CONFIRM = (
    "'tango commission' tries what has a name, high above the table. Or confirm it yourself and state it in tango.yaml: a key "
    "under controller:, a fact without = under confirmed:"
)


obstructed_option: Decorator = click.option(
    "--obstructed",
    type=click.Choice(list(OBSTRUCTED)),
    help=f"Touches that a straight stylus cannot make [default: obstructed of strategy.yaml, else {USUAL}]. "
    "leave-out-facing-away: those on facets that face away from the spindle are "
    "named and not in the program; where anything else is in the probe's way, it is an error. leave-out: none of them is in the "
    "program. refuse: all are errors. warn: those on facets that face away ARE in the program, for a stylus that gets there; a "
    "straight one would be driven into the table.",
)


def warnings(plan: Plan) -> list[str]:
    """plan → what a person must know before it meets a machine: every touch that is left out, how many, and what may be hit."""
    lines = [f"left out: {text}" for text in plan.left_out.values()]
    if many := len(plan.left_out):
        lines.append(
            f"WARNING: a straight stylus cannot make {many} of {many + len(plan.touches)} touches of the strategy: left out of the "
            "program. 'tango check' says what is left. For a stylus that reaches facets that face away: --obstructed warn."
        )
    lines += [f"WARNING: {text}" for text in plan.start]
    if many := len(plan.doubtful):
        lines.append(
            f"WARNING: {many} of {len(plan.touches)} touches are on facets that face away from the spindle; "
            "on a machine a straight stylus would meet the table there and stop:"
        )
        lines += [f"  {text}" for text in plan.doubtful[:NAMED]]
        lines += [f"  … and {many - NAMED} more"] if many > NAMED else []
        lines.append("Take them out of the strategy, or plan without --obstructed warn, unless your stylus gets there.")
    return lines


def dry(parts: Sequence[Plan]) -> Iterator[str]:
    """parts of a plan → its moves, under the part of it that they belong to where there are several."""
    for number, part in enumerate(parts, 1):
        if len(parts) > 1:
            yield f"part {number} of {len(parts)}: touches {part.touches[0].number} … {part.touches[-1].number}"
        yield from _moves(part)


def _moves(plan: Plan) -> Iterator[str]:
    linear = plan.machine.linear
    number = max(len(str(move.touch)) for move in plan.moves)
    kind = max(len(move.kind) for move in plan.moves)
    for move in plan.moves:
        target = " ".join(f"{n}{v if n in linear else math.degrees(v):.3f}" for n, v in move.target.items())
        yield f"{move.touch:>{number}}  {move.kind:<{kind}}  {target}".rstrip()


def as_json(
    plan: Plan,
    post: str,
    folder: Path,
    written: Sequence[Program],
    doubts: tuple[str, ...],
    proven: Mapping[str, Proof],
    gate: str,
) -> dict[str, Any]:
    """plan, post, folder of its programs, what no profile states, proofs that hold, what proves the probe alive → plain data.

    That of tango-plan/1; mm and deg.
    """
    used = {}
    low, high = dict.fromkeys(plan.machine.names, math.inf), dict.fromkeys(plan.machine.names, -math.inf)
    least, most = (tuple(sign * math.inf for _ in plan.machine.names) for sign in (1, -1))  # of the contacts
    kinds: Counter[str] = Counter()
    verdicts = {belief: proof.verdict for belief, proof in proven.items()}
    left = {text for _, texts in remaining(doubts, verdicts) for text in texts}
    facets = set()
    for touch in plan.touches:
        facets.add(touch.facet)
        least, most = tuple(map(min, least, touch.contact)), tuple(map(max, most, touch.contact))
    for move in plan.moves:
        kinds[move.kind] += 1
        for letter, value in move.target.items():
            low[letter], high[letter] = min(low[letter], value), max(high[letter], value)
    for i, axis in enumerate(plan.machine.axes):
        unit = math.degrees if axis.kind != "linear" else float
        used[axis.name] = {
            "from": round(unit(low[axis.name]), 6),
            "to": round(unit(high[axis.name]), 6),
            "travel": None if axis.travel is None else [round(unit(v), 6) for v in axis.travel],
            "unit": "mm" if axis.kind == "linear" else "deg",
            "contact": [round(unit(end[i]), 6) for end in (least, most)],
        }
    return {
        "format": "tango-plan/1",
        "post": post,
        "program": str(folder / written[0].name),
        "plan": str(folder / "plan.csv"),
        "program_hash": written[0].mark,
        "plan_hash": plan_hash(plan),
        "programs": [
            {
                "program": str(folder / w.name),
                "program_hash": w.mark,
                "touches": len(w.plan.touches),
                "first": w.plan.touches[0].number,
                "last": w.plan.touches[-1].number,
            }
            for w in written
        ],
        "touches": len(plan.touches),
        "indexations": len(plan.turns) - 1,
        "facets": len(facets),
        "left_out": list(plan.left_out.values()),
        "doubtful": list(plan.doubtful),
        "start": list(plan.start),
        "gate": _gate(plan, gate),
        "moves": dict(kinds),
        "travel_used": used,
        "unverified": [text for text in doubts if text in left],
        "proven": verdicts,
    }


def _range(program: Mapping[str, Any], result: Mapping[str, Any]) -> str:
    """→ which touches one of several programs makes."""
    many = len(result["programs"]) > 1
    return f" touches {program['first']} … {program['last']}, {program['touches']} of them" if many else ""


def _name(file: str) -> str:
    return Path(file).name


def proving(plan: Plan, result: Mapping[str, Any]) -> list[str]:
    """plan, result → a sentence on the facet that proves the probe, where the program says that one does."""
    if result["gate"] is None:
        return []
    facet, off, where = (result["gate"][key] for key in ("facet", "behind_mm", "found_in"))
    if off is None:
        return [f"facet {facet} proves the probe; no run has found it: the search ends {BEHIND:g} mm behind its place in the plan"]
    return [
        f"facet {facet} proves the probe; {where} found it {off:+.2f} mm from the plan: the search ends {BEHIND:g} mm behind there"
    ]


def _gate(plan: Plan, given: str) -> dict[str, Any] | None:
    """plan, what proves the probe → the facet, mm by which it was found behind (+) its place in the plan, in which readings."""
    if given != "facet":
        return None
    one = proving_touch(plan)
    off = plan.met.get(one.number)
    found = {"behind_mm": None, "found_in": None} if off is None else {"behind_mm": round(off, 3), "found_in": plan.met_in}
    return {"facet": one.facet, **found}


def as_text(plan: Plan, result: dict[str, Any]) -> str:
    """plan, result → what a person reads on the terminal."""
    rows = [["axis", "used from", "to", "travel", ""]]
    for name, used in result["travel_used"].items():
        travel = "" if used["travel"] is None else f"{used['travel'][0]:g} … {used['travel'][1]:g}"
        rows.append([name, f"{used['from']:.3f}", f"{used['to']:.3f}", travel, used["unit"]])
    beside = bool(result["companions"])
    many = len(plan.left_out)
    missing = f", {many} {'touch' if many == 1 else 'touches'} of the strategy left out" if many else ""
    tried = result["proven"]
    passed = [belief for belief, verdict in tried.items() if verdict == "PASS"]
    unverified = ""
    for experiment, texts in remaining(result["unverified"], tried):  # what can break something first, each with how to look at it
        if experiment is None:
            unverified += "\n  no experiment tries these; look them up"
        else:
            wrong = " IT IS NOT SO on this control." if tried.get(experiment.belief) == "FAIL" else ""
            todo = experiment.advice if wrong else experiment.check
            unverified += f"\n  {experiment.belief} (danger {experiment.danger}): {experiment.says}.{wrong}\n      → {todo}"
        unverified += "".join(f"\n      {text}" for text in texts)
    return (
        f"{result['touches']} touches on {result['facets']} facets at {result['indexations']} indexations{missing}\n"
        f"{table(rows, '<>>><')}\n"
        + "".join(f"{line}\n" for line in drawn_lines(result["drawings"]))
        + "".join(f"program {p['program']} (hash {p['program_hash']}){_range(p, result)}\n" for p in result["programs"])
        + f"plan    {result['plan']} (hash {result['plan_hash']})\n"
        + (f"beside  {', '.join(map(_name, result['companions']))}: have to be on the control too, see docs/dialects.md\n" * beside)
        + "".join(f"gate    {line}\n" for line in proving(plan, result))
        + (f"proven on this control: {', '.join(passed)}\n" if passed else "")
        + (f"unverified: {CONFIRM}{unverified}" if unverified else "")
    ).rstrip()
