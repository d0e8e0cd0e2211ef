"""What cannot be seen, for people: the combination and what of it is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..records import Combination


def describe(name: str, unit: str, partners: Mapping[str, tuple[float, str]]) -> Combination:
    """name left out, its unit, what moves the touches as it does by name: (factor, unit) → combination, in words for people."""
    table = [p for p in partners if p.startswith(("EZf", "EXball", "EYball", "EZball"))]
    said = [p for p in partners if p not in table]
    if name == "EXX1" and {"EYY1", "EZZ1"} <= set(said):
        text = (
            "the absolute scale cannot be seen, only scale mismatches against X: touch a scale bar or a calibrated facet, "
            "or read EYY1 and EZZ1 as EYY1-EXX1 and EZZ1-EXX1 and lengths, EZt among them, in units of X"
        )
    elif not partners:
        text = f"{name} moves no touch of this plan"
    elif not said:
        text = (
            f"{name} moves the touches just as a table of another shape would: only calibrated facets, or "
            "the same facets met in more poses, could tell"
        )
    elif len(said) <= 3 and not table:
        sums = [_sum(name, unit, p, *partners[p]) for p in said]
        if len(said) == 1:
            same = {f"{said[0]} + {name}": "their sum", f"{said[0]} - {name}": "their difference"}
            text = f"{name} and {said[0]} move every touch alike: only {same.get(sums[0], sums[0])} is known"
        else:
            text = f"{name} moves the touches just as {_list(said)} do together: only {_list(sums)} are known"
    else:
        listed = [*said[:5], *(["others"] if len(said) > 5 else []), *(["the facet offsets"] if table else [])]
        text = f"{name} moves the touches just as a combination of {_list(listed)} does: it cannot be told from them"
    return Combination((name, *partners), (1.0, *(-factor for factor, _ in partners.values())), text)


def _sum(name: str, unit: str, partner: str, factor: float, other: str) -> str:
    sign = "+" if factor > 0 else "-"
    alike = unit == other or {unit, other} == {"rad", "mm/mm"}
    if alike and abs(abs(factor) - 1) < 0.01:
        return f"{partner} {sign} {name}"
    return f"{partner} {sign} {abs(factor):.4g} · {name} (in {other}, {name} in {unit})"


def _list(words: Sequence[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def summary(texts: Sequence[str]) -> list[str]:
    """sentences of combinations → the same, one for all names of which the same is to be said."""
    groups: dict[str, list[str]] = {}
    for text in texts:
        name, moves, rest = text.partition(" moves ")
        groups.setdefault(rest if moves else text, []).append(name)
    return [
        names[0] if names == [rest] else f"{', '.join(names)} {'moves' if len(names) == 1 else 'each move'} {rest}"
        for rest, names in groups.items()
    ]
