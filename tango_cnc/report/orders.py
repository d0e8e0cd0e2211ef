"""What to do about a machine this morning: the same sentences on every page of it, the first of them to be done first.

One order: a machine that may still move, then parts, then whom to ask, then what is to be repaired or measured.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ..records import Machine
from ..texts import unstopped
from .alarm import whole_sentence
from .answer import NEWER, PARTS, Answer, is_cut_off, is_moving, is_unsent, is_waiting
from .days import day
from .faults import asking, begun, for_setting_up, of_probe, settled, untried
from .look import looks, may_move
from .plain import plain, shop
from .reach import to_ask
from .texts import Texts
from .together import SAME, closed
from .units import Units
from .words import subject

BY_NIGHT = {  # what to do that asks for a full measurement, and what it is after one that says a plain Yes
    "morning.run_full": "todo.by_night",
    "may.repaired_todo": "todo.by_night_repaired",
    "night.doubtful_do": "todo.by_night_doubtful",
}
DIRECTIONS = re.compile(r" \((?:[XYZ] [+−]?[\d.]+ \w+(?:, )?)+\)")


def orders(
    told: Answer,
    record: Mapping[str, Any],
    found: Sequence[Mapping[str, Any]],
    coming: str,
    u: Units,
    t: Texts,
    machine: Machine | None = None,
    former: Sequence[str] = (),
) -> list[str]:
    """answer, record of the newest night, what is wrong, kind of the next night, units, texts, chain of axes, what is said of the
    cell beside its nights → sentences.
    """

    def told_here(text: str) -> str:
        whole = shop(plain(text, u, t, machine), t)
        return whole_sentence(whole[:1].upper() + whole[1:])

    status, verdict = record.get("status"), record.get("verdict")
    failed = [p for p in record.get("preflight") or () if not p.get("passed")]
    first = [*orders_of_cut_off(former, t), *([told_here(t("night.moved_do"))] if record.get("moved") else [])]
    reasons = (record.get("plausible") or {}).get("reasons") or () if verdict == "doubtful" else ()
    first += may_move(reasons, t)
    first += [parts_first(told, found, t), t("morning.old_todo") if told.old else ""]
    first = [x for x in first if x]
    lines = [told_here(p["do"] or _see_to(p, t)) for p in failed]
    lines += [t("morning.unsent_todo")] if is_unsent(former) else []
    lines += [t("morning.waiting_todo")] if is_waiting(former) else []
    if status == "refused":
        lines.append(told_here(t("night.refused_do")))
    elif status == "missed" and not failed and not told.old:
        lines.append(told_here(t("morning.missed_todo")))
    if verdict == "doubtful":
        lines += [*looks(reasons, t), told_here(t("night.doubtful_do"))]
    elif (done := settled(found)) == "accept" and verdict == "out_of_limits":  # accepted, and beyond the limit all the same
        lines += of_faults([a for a in found if not a["id"]] or [{"todo": t("todo.limit"), "text": ""}], t)
    elif done:
        lines.append(t("morning.todo_nothing" if done == "accept" else "may.repaired_todo"))
    elif listed := asking(found):
        own = listed[0] is found[0] and not (lines or told.moved)  # "this axis" would be that of the order before it
        lines += of_faults(listed, t, own)
    elif found:  # all of it is to be ignored
        lines += [t("todo.limit")] if verdict == "out_of_limits" else _of_good(told, coming, t) if not failed else []
    elif told.may in ("yes", "but", "wait") and verdict == "good" and not is_moving(record, former):
        lines += _of_good(told, coming, t)
    elif verdict == "out_of_limits":
        lines.append(t("todo.limit"))
    if first:
        lines = [x for x in lines if x != t("morning.todo_nothing")]
    asked = to_ask(record, found, t) if told.may in ("no", "but", "unknown") else ""
    if is_stopped(told, t):  # the night may have let parts be made, of which newer readings say otherwise
        lines = under_a_no(lines, t)
    if told.again:
        lines = by_night(lines, t)
    if told.newer:
        look = [_look(told, found, t)] if told.moved else []
        lines = [x for x in lines if x != t("morning.todo_nothing")]
        lines = [*look, *lines]
        if told.state == NEWER and told.may == "no":
            lines = [*parts_since(told.after, found, record, t), *lines, t("todo.limit")]
    return list(dict.fromkeys(x for x in (*first, asked, *lines) if x))


def by_night(do: Sequence[str], t: Texts) -> list[str]:
    """what to do, texts → the same after newer readings that say a plain Yes: a night is to measure, and nobody once more by
    hand.
    """
    lines = list(do)
    for usual, asked in ((shop(t(usual), t), t(asked)) for usual, asked in BY_NIGHT.items()):
        lines = [x.replace(usual, asked) for x in lines]
    return lines


def _look(told: Answer, found: Sequence[Mapping[str, Any]], t: Texts) -> str:
    """answer of newer readings, what is wrong, texts → to look for what has moved since the night, or to ask who says to have
    repaired it since then.
    """
    mended = (a["decision"].owner for a in found if untried(a) and a["decision"] is not None and a.get("parameter") == told.mover)
    if owner := next(mended, ""):
        return t("todo.moved_repaired", owner=owner, moved=told.moved)
    return t("todo.moved_since", moved=told.moved)


def parts_since(measured: str, found: Sequence[Mapping[str, Any]], record: Mapping[str, Any], t: Texts) -> list[str]:
    """date of the last night that measured before readings that say No, what is wrong by the nights, record of the newest one,
    texts → to check the parts made since that night, or since what is open began, as one order; [] where no date is known.
    """
    open_since = begun([a for a in found if not for_setting_up(a)], record.get("behind") or ())
    if measured and open_since and open_since < measured:  # the nights until then were within the limit
        return [t("todo.parts_since_open", date=day(measured, t), open=day(open_since, t))]
    first = measured or open_since
    return [t("todo.parts_since", date=day(first, t))] if first else []


def is_stopped(told: Answer, t: Texts) -> bool:
    """answer, texts → whether no part is made before something was put right."""
    return told.may == "no" and told.word != t("may.not_yet")


def under_a_no(do: Sequence[str], t: Texts) -> list[str]:
    """what to do, texts → the same, of which nothing lets parts be made meanwhile."""
    usual, beyond = (shop(t(f"cause.temperature.{key}"), t) for key in ("do", "do_beyond"))
    return [x.replace(usual, beyond) for x in do]


def _see_to(point: Mapping[str, Any], t: Texts) -> str:
    """check before a night that failed without an advice of its own, texts → to see to it, with what was found."""
    key, found = f"check_name.{point.get('check')}", unstopped(point.get("found") or "")
    return t("morning.see_to", check=t(key) if key in t else str(point.get("check")), found=found)


def parts_first(told: Answer, found: Sequence[Mapping[str, Any]], t: Texts) -> str:
    """answer, what is wrong, texts → what to do about parts before anything else; '' where nothing keeps them, or nobody knows."""
    if is_stopped(told, t):
        return t("may.brief_no")
    if told.may == "unknown" and told.state == "not_measured" and not told.old:  # no night has ever measured it
        return t("may.brief_never")
    if told.may not in ("no", "but"):
        return ""
    return t(PARTS["" if told.newer and of_probe(found) == "_probe" else of_probe(found)])


def brief_of(first: Mapping[str, Any]) -> str:
    """fault → its sentence with the size that counts: not what it was in each direction, nor by how little it differs by now."""
    own, total, text = float(first.get("size") or 0.0), first.get("total"), str(first["text"])
    text = text.replace(str(first.get("then") or ""), "").rstrip()
    if total is not None and abs(float(total) - own) <= SAME * abs(own):
        text = text.replace(str(first.get("still") or ""), "").rstrip()
    return DIRECTIONS.sub("", text)


def of_faults(found: Sequence[Mapping[str, Any]], t: Texts, named: bool = True) -> list[str]:
    """what is wrong and asks for something, texts, whether the page names the first of it first → what to do about that, with its
    name where the page begins with another one; a drift that stands in its way comes before it.
    """
    first = found[0]
    drift = next((x for x in found if x.get("drifts") and not closed(x)), None)
    if not first.get("alone") or drift is None:
        return [f"{'' if named else brief_of(first)} {first['todo']}".strip()] if first["todo"] else []
    steps = (("morning.of_drift", drift, drift["todo"]), ("morning.of_other", first, first["alone"]))
    return [t(key, what=_of(a, t), do=low(do)) for key, a, do in steps if do]


def _of(a: Mapping[str, Any], t: Texts) -> str:
    """what is wrong, texts → which part of the machine it is about, as a step begins."""
    what = subject(str(a.get("parameter") or a["cause"]), None, t)
    return f"{what[:1].upper()}{what[1:]}"


def low(text: str) -> str:
    """sentence → the same after a colon."""
    return f"{text[:1].lower()}{text[1:]}"


def orders_of_cut_off(former: Sequence[str], t: Texts) -> list[str]:
    """what is said of a cell beside its nights, texts → what to do about a night that was cut off; [] where none was."""
    return [t("morning.cut_off_todo")] if is_cut_off(former) else []


def _of_good(told: Answer, coming: str, t: Texts) -> list[str]:
    """answer of a night that found nothing, kind of the next night, texts → what to do all the same."""
    lines = [t("morning.rises_todo")] if told.soon else []
    if told.state == "partial":
        lines.append(t("morning.partial_todo_now" if coming == "check" else "morning.partial_todo"))
    elif told.state == "late":
        lines.append(t("morning.late_todo"))
    return lines or [t("morning.todo_nothing")]
