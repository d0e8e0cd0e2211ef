"""What cannot be seen, for people: the combination and what of it is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..records import Combination
from ..terms import SCALES
from ..texts import joined, say

SHARED = {"moves": "each move", "cannot be separated": "cannot be separated"}  # verb of one name: that of several


def describe(name: str, unit: str, partners: Mapping[str, tuple[float, str]]) -> Combination:
    """name left out, its unit, what moves the touches as it does by name: (factor, unit) → combination, in words for people."""
    table = [p for p in partners if p.startswith(("EZf", "EXball", "EYball", "EZball"))]
    said = [p for p in partners if p not in table]
    gains = [p for p in said if name in SCALES and p in SCALES and abs(partners[p][0] + 1) < 0.01]
    if gains:
        differences = _list([f"{gain}-{name}" for gain in sorted(gains)])
        text = say("unseen_said.absolute_scale_cannot_be_seen", axis=name[1], gains=_list(sorted(gains)), differences=differences)
    elif not partners:
        text = say("unseen_said.moves_no_touch_this_plan", name=name)
    elif not said:
        text = say("unseen_said.moves_touches_just_as_table", name=name)
    elif len(said) <= 3 and not table:
        sums = [_sum(name, unit, p, *partners[p]) for p in said]
        if len(said) == 1:
            same = {f"{said[0]} + {name}": say("unseen_said.their_sum"), f"{said[0]} - {name}": say("unseen_said.their_difference")}
            text = say("unseen_said.move_every_touch_alike_only", name=name, other=said[0], known=same.get(sums[0], sums[0]))
        else:
            text = say("unseen_said.moves_touches_just_as_do", name=name, said=_list(said), sums=_list(sums))
    else:
        listed = [
            *said[:5],
            *([say("unseen_said.others")] if len(said) > 5 else []),
            *([say("unseen_said.facet_offsets")] if table else []),
        ]
        text = say("unseen_said.moves_touches_just_as_combination", name=name, listed=_list(listed))
    return Combination((name, *partners), (1.0, *(-factor for factor, _ in partners.values())), text)


def _sum(name: str, unit: str, partner: str, factor: float, other: str) -> str:
    sign = "+" if factor > 0 else "-"
    alike = unit == other or {unit, other} == {"rad", "mm/mm"}
    if alike and abs(abs(factor) - 1) < 0.01:
        return f"{partner} {sign} {name}"
    term = f"{partner} {sign} {abs(factor):.4g} · {name}"
    return say("unseen_said.weighted", term=term, other=other, name=name, unit=unit)


def _list(words: Sequence[str]) -> str:
    return joined(say("unseen_said.and"), [joined(", ", words[:-1]), words[-1]]) if len(words) > 1 else words[0]


def summary(texts: Sequence[str]) -> list[str]:
    """sentences of combinations → the same, one for all names of which the same is to be said."""
    groups: dict[tuple[str, str], list[str]] = {}
    for text in texts:
        name, verb, rest = next((parts for verb in SHARED if (parts := text.partition(f" {verb} "))[1]), (text, "", ""))
        groups.setdefault((verb.strip(), rest) if verb else (text, ""), []).append(name)
    return [
        key[0] if not key[1] else f"{', '.join(names)} {key[0] if len(names) == 1 else SHARED[key[0]]} {key[1]}"
        for key, names in groups.items()
    ]
