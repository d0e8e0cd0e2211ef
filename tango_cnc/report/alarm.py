"""One alarm as the pages tell it: what has changed, what it does to a part, what to do, who has it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..records import Machine
from ..texts import Said, instead, say
from .days import day, days_between, local_day
from .plain import office, plain, shop
from .reach import of_two, or_else
from .repeated import before_repair
from .texts import Texts, texts
from .tonight import only_set_up
from .units import Units
from .words import named, spoken


def alarm(
    a: Mapping[str, Any],
    decision: Any,
    u: Units,
    t: Texts,
    machine: Machine | None = None,
    record: Mapping[str, Any] | None = None,
    today: str = "",
) -> dict[str, Any]:
    """alarm of a record, its decision, units, texts, chain of axes, record, date → what a page shows of it."""
    raw = a.get("text") or ""
    size, record, asked = _amount(a, u), record or {}, str(a.get("id") or "")[:10]
    found = before_repair(a) or asked
    owner = (decision.owner if decision is not None else None) or a.get("owner") or record.get("owner")
    told = {**a, "night": found or str(a.get("night") or "")}  # what stands behind a limit has no id
    asks = str(record.get("deputy") or ""), str(record.get("owner") or "")
    waits = str(a.get("asked_again") or asked)  # since when an answer is missing
    part = _part(told, u, t)
    return {
        **a,
        "raw_text": raw,
        "id": str(a.get("id") or ""),
        "text": whole_sentence(sentence(plain(with_its_date(told, raw, t), u, t, machine), Units())),
        "recorded": sentence(_recorded(told, raw), u, t),
        "night": asked,
        "first": found,  # date of the first night on which it was seen
        "cause": _named(f"cause_name.{a.get('cause')}", a.get("cause"), t),
        "cause_key": str(a.get("cause") or ""),
        "set_up": only_set_up(a),
        "begun": str(a.get("since") or ""),
        "amount": "" if " ± " in raw else size,  # for the engineer, where the sentence does not say it already
        "on_part": sentence(plain(part, u, t, machine), Units()),
        "raw_part": part,
        "whole": "",
        "todo": shop(sentence(plain(_todo(a, u, t), u, t, machine), Units()), t),
        "office": office(_todo(a, u, t), t),
        "instead": [named(str(x), t, machine) for x in a.get("instead") or ()],
        "owner": owner,
        "nobody": not owner and not record.get("deputy") and decision is None,
        "who": _who(owner, decision, waits, today or str(record.get("night") or ""), t, *asks),
        "silent": days_between(waits, today or str(record.get("night") or "")) if waits and decision is None else 0,
        "asked": waits,
        "decision": decision,
        "symbol": "" if spoken(str(a.get("parameter") or "")) == str(a.get("parameter") or "") else str(a["parameter"]),
        "drifts": False,
        "moves_from": bool(a.get("rate_per_day")) and days_between(a.get("since") or asked, asked) > 1,  # its alarm came later
        "gone": False,
        "ids": [str(a["id"])] if a.get("id") and decision is None else [],
        "held": [],
        "typed": [str(a["id"])] if a.get("id") else [],
        "decided": "" if decision is None else decided(decision, t),
    }


def asked_since(a: Mapping[str, Any], first: str, today: str, t: Texts, deputy: str) -> dict[str, Any]:
    """fault that nobody has answered, date on which its owner was asked first about anything of the machine, date, texts, deputy →
    whom to ask about it, for how many days nobody has answered, since when.
    """
    who = _who(a["owner"], None, first, today, t, deputy, "")
    return {"who": who, "silent": days_between(first, today), "asked": first}


def decided(decision: Any, t: Texts) -> str:
    """decision, texts → accepted, ignored until Thu 10 Dec 2026: what a page has beside the alarm."""
    if decision.until:
        return t("decision.ignored_until", until=day(decision.until, t))
    return t(f"decision.{decision.action}")


def _who(owner: Any, decision: Any, asked: str, today: str, t: Texts, deputy: str, first: str) -> str:
    """owner, decision, date on which an answer was asked for or '', date, texts, deputy, owner of the machine → who has it, and
    whom else to ask.
    """
    if decision is not None:
        other = t("morning.has_owner", owner=first) if first and str(decision.owner) not in first else ""
        told = t("morning.has", owner=owner, decided=t(f"decision.{decision.action}"))
        told += t("morning.has_since", date=day(local_day(decision.utc), t)) if decision.utc else ""
        until = t("morning.has_until", date=day(decision.until, t)) if decision.until else ""
        return " ".join(x for x in (told, until, other) if x)
    if not owner:
        return t("morning.nobody_but", other=deputy) if deputy else t("morning.nobody")
    days = days_between(asked, today) if asked else 0
    if deputy and or_else(str(owner), days, deputy, t):  # the same first person as in what to do
        return of_two(str(owner), days, deputy, asked, t)
    key = "call" if not asked else "asked" if days < 1 else "asked_yesterday" if days == 1 else "asked_since"
    told = t(f"morning.{key}", owner=owner, date=day(asked, t), days=days)
    return " ".join(x for x in (told, or_else(str(owner), days, deputy, t)) if x)


def with_its_date(a: Mapping[str, Any], raw: str, t: Texts) -> str:
    """alarm with its night, its sentence, texts → the sentence with one date: of the night that found it, where the one before was
    without it.
    """
    since = str(a.get("since") or "")
    if not since:
        return raw
    told = instead(raw, "last night", since)
    return instead(told, since, since_when(a, t)) if _at_once(a) else told


def _recorded(a: Mapping[str, Any], raw: str) -> str:
    """alarm with its night, its sentence → the sentence as it was recorded; on a later day with the night that found it."""
    since = str(a.get("since") or "")
    return instead(raw, since, say("morning.found", date=a["night"])) if since and _at_once(a) else raw


def _at_once(a: Mapping[str, Any]) -> bool:
    """alarm with its night → whether the night before was without it, so that its night says since when."""
    return days_between(a.get("since") or a["night"], a["night"]) == 1


def since_date(a: Mapping[str, Any]) -> str:
    """fault with its nights → date since when: of the night that found it, or, where others lie between, of the last without it."""
    since, first = str(a.get("since") or ""), str(a.get("first") or "")
    return first if first and (not since or _at_once({**a, "night": first})) else str(a.get("begun") or since)


def since_told(a: Mapping[str, Any], t: Texts) -> str:
    """fault with `since` and `first` → since when, as a sentence: the night that found it, and where others lie between them, that
    which was last without it.
    """
    since, first = a.get("since"), a.get("first")
    if a.get("moves_from"):
        return t("morning.since_drift", good=day(since, t, False), bad=day(first, t, False))
    if not first or first == since or a.get("rate_per_day"):
        return t("morning.since_text", good=day(since, t))
    if days_between(since, first) == 1:
        return t("morning.since_next", bad=day(first, t))
    return t("morning.since_both", good=day(since, t, False), bad=day(first, t, False))


def since_when(a: Mapping[str, Any], t: Texts) -> str:
    """alarm with its night, texts → words for the date since which it has moved."""
    return t("morning.found", date=day(a["night"], t)) if _at_once(a) else day(a.get("since"), t)


def sentence(text: Any, u: Units, t: Texts | None = None) -> str:
    """text of a record, units, texts → the same as a sentence: a capital in front, lengths in these units."""
    found = u.sentence((t or texts()).of(text or "", u.more))
    return found[:1].upper() + found[1:]


def whole_sentence(text: str) -> str:
    """sentence → the same with its full stop; nothing stays nothing."""
    return text if not text or text.endswith((".", "?", "!", "…")) else f"{text}."


def _todo(a: Mapping[str, Any], u: Units, t: Texts) -> str:
    """→ what to do; no full measurement is asked for where one has found the cause again."""
    own = _told(a, "do", u, t)
    key = "confirmed.square" if own in (t("part.square_do"), texts()("part.square_do")) else f"confirmed.{a.get('cause')}"
    drifts = a.get("rate_per_day") and a.get("steady", True)  # who was at the machine that night has not made it
    return t(key) if a.get("confirmed") and key in t and not drifts else own


def _part(a: Mapping[str, Any], u: Units, t: Texts) -> str:
    """alarm with its night → what it means for a part: it speaks of the change, also where an old record states the whole error."""
    own = a.get("on_part")
    key = f"{own.key.removesuffix('_since')}_since" if isinstance(own, Said) else ""
    if not a.get("since") or key not in t or not isinstance(own, Said):
        return _told(a, "on_part", u, t)
    whole = (a.get("ignored") or {}).get("since")  # its effect is that of all since before what somebody ignores
    return t(key, **{**own.values, "since": day(whole, t) if whole else since_when(a, t)})


def _told(a: Mapping[str, Any], member: str, u: Units, t: Texts) -> str:
    """→ the shop's text where the record has the program's own; what the record says otherwise."""
    key, effect = f"cause.{a.get('cause')}.{member}", f"{float(a.get('on_part_um') or 0.0):.1f} µm"
    own = str(a.get(member) or "")
    return t(key, effect=effect) if key in t and own == texts()(key, effect=effect) else t.of(a.get(member) or "")


def _named(key: str, name: Any, t: Texts) -> str:
    """key of its text, name of a cause or of what is followed, texts → its word."""
    return t(key, name=str(name).partition(" ")[2]) if key in t else t.of(name or "").replace("_", " ")


def _amount(a: Mapping[str, Any], u: Units) -> str:
    """→ '+20.3 ± 0.5 µm'; without ± where no uncertainty is on record."""
    if not a.get("size"):
        return ""
    factor, unit = u.coefficient(str(a.get("unit") or "mm"))
    value, std = float(a["size"]) * factor, abs(float(a.get("std") or 0.0) * factor)
    decimals = 0 if std >= 10 else 1 if std >= 0.095 or not std else 2
    number = f"{value:+.{decimals}f}".replace("-", "−")
    return f"{number} ± {std:.{decimals}f} {unit}" if std else f"{number} {unit}"
