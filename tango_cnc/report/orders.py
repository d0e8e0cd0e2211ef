"""What to do about a machine this morning: the same sentences on every page of it, the first of them to be done first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..records import Machine
from .answer import Answer, is_cut_off, is_unsent
from .faults import settled
from .look import looks
from .plain import plain, shop
from .texts import Texts
from .units import Units


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
        whole = shop(plain(t.of(text), u, t, machine), t)
        return whole[:1].upper() + whole[1:]

    status, verdict = record.get("status"), record.get("verdict")
    failed = [p for p in record.get("preflight") or () if not p.get("passed")]
    lines = orders_of_cut_off(former, t)
    lines += [t("morning.old_todo")] if told.old else []
    lines += [told_here(p["do"]) for p in failed if p.get("do")]
    if status == "refused":
        lines.append(told_here(t("night.refused_do")))
    elif status == "missed" and not failed and not told.old:
        lines.append(told_here(t("morning.missed_todo")))
    if verdict == "doubtful":
        lines += [*looks((record.get("plausible") or {}).get("reasons") or (), t), told_here(t("night.doubtful_do"))]
    elif closed := settled(found):
        lines.append(t("morning.todo_nothing" if closed == "accept" else "may.repaired_todo"))
    elif found:
        lines += [str(found[0]["todo"])] if found[0]["todo"] and not failed else []
    elif told.may in ("yes", "but", "wait") and verdict == "good" and not (is_cut_off(former) or is_unsent(former)):
        lines += _of_good(told, coming, t)
    elif verdict == "out_of_limits":
        lines.append(t("todo.limit"))
    return list(dict.fromkeys(lines))


def orders_of_cut_off(former: Sequence[str], t: Texts) -> list[str]:
    """what is said of a cell beside its nights, texts → what to do about a night that was cut off; [] where none was."""
    return [t("morning.cut_off_todo")] if is_cut_off(former) else [t("morning.unsent_todo")] if is_unsent(former) else []


def _of_good(told: Answer, coming: str, t: Texts) -> list[str]:
    """answer of a night that found nothing, kind of the next night, texts → what to do all the same."""
    lines = [t("morning.rises_todo")] if told.soon else []
    if told.state == "partial":
        lines.append(t("morning.partial_todo_now" if coming == "check" else "morning.partial_todo"))
    elif told.state == "late":
        lines.append(t("morning.late_todo"))
    return lines or [t("morning.todo_nothing")]
