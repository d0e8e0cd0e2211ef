"""A night in words: one sentence for a telephone, a message for a mailbox, and what each cause means."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from ..history import Decision
from ..report.compensated import held
from ..report.days import days_between
from ..report.look import orders
from ..report.repeated import as_decided
from ..report.texts import Texts, code, texts
from ..report.tonight import by_tonight, is_gone
from ..report.units import shown
from ..report.words import moved, named
from ..texts import Said, instead, joined, say
from .first import owner_of, parts_first

SHOWN = 3  # alarms that wait, in full
LONG = 30  # nights without a measurement: a clock that has jumped ahead looks the same


def cause_texts(cause: str, effect_um: float, since: str = "") -> tuple[str, str]:
    """cause, µm that it does at most, date since when or '' → what it means for a part, what to do (tango_cnc/texts/en.toml)."""
    key, t = f"cause.{cause}.on_part", texts()
    key = f"{key}_since" if since and f"{key}_since" in t else key
    return on_part(key, since, effect=f"{effect_um:.1f} µm"), t(f"cause.{cause}.do")


OWN = ("night.drift_do", "night.comes_back.repaired_do", "night.edited.do")  # what to do that a full measurement does not take back


def on_part(key: str, since: str, **values: str) -> str:
    """key, date since when it is a change ('': it is a whole error), values → what it means for a part."""
    return texts()(key, **({"since": since} if since else {}), **values)


def changed(parameter: str, size: str, since: str = "last night", alike: Sequence[str] = ()) -> str:
    """name of ISO 230-1 or a facet, size of its change, since when, locations that no touch tells from it → a sentence that names
    the axis before the symbol, and every other one that may have moved in its place.
    """
    return moved(parameter, size, since, alike=alike)


def value(number: float, unit: str, std: float | None = None) -> str:
    """number in mm, rad …, unit, standard deviation → '+19.8 ± 0.4 µm'."""
    factor, name = shown(unit)
    spread = "" if std is None else f" ± {std * factor:.1f}"
    return f"{number * factor:+.1f}{spread} {name}"


def one_day(days: float) -> str:
    """days to come → ending of the key of the sentence: _one for one day or less, '' for more."""
    return "_one" if round(days) <= 1 else ""


def headline(record: Mapping[str, Any]) -> str:
    """record of a night → one sentence; what somebody changed in the cell comes first where anything is found."""
    told = _headline(record)
    if record.get("edited") and record["alarms"] and record["verdict"] in ("changed", "out_of_limits"):
        return say("night.words.after_edit", edited=record["edited"]["text"], told=told)
    return told


def _headline(record: Mapping[str, Any]) -> str:
    if record["status"] == "missed":
        return say("night.words.no_measurement", why=record["why"])
    if record["status"] == "refused":
        return say("night.words.not_begun_was_not_disturbed", why=record["why"])
    if record["verdict"] == "not_measured":
        return say("night.words.not_measured", why=record["why"])
    alarms, helped = record["alarms"], record.get("repaired") or ()
    put_right = joined("; ", [one["text"] for one in helped]) if helped else None
    if record["verdict"] == "doubtful":
        reasons = (record.get("plausible") or {}).get("reasons") or [record.get("why") or say("night.words.see_report")]
        return say("night.words.readings_not_be_relied_on", reason=reasons[0])
    beyond = [limit for limit in record["limits"] if limit["passed"] is False]
    if alarms and not beyond:
        return every(alarms)
    part = (
        say("night.words.stopped_after_touches", touches=record["touches"], planned=record["planned"])
        if record["status"] == "partial"
        else ""
    )
    gap = _gap(record)
    if beyond:
        b = max(beyond, key=lambda limit: limit["value"] / limit["limit"])
        behind = [x for x in record.get("behind") or () if x["what"] == b["what"]]
        by_alarm = {alarm.get("parameter") for alarm in alarms}
        why = [x["text"] for x in behind if x.get("parameter") not in by_alarm]
        own = [every(alarms)] if alarms else []
        why = [*own, *why] if behind and behind[0].get("parameter") in by_alarm else [*why, *own]  # what does most comes first
        cause = joined("", (": ", joined("; ", why))) if why else ""
        crossed = say(
            "night.words.allowed",
            what=what_of(b["what"]),
            value=f"{b['value']:.1f}",
            unit=b["unit"],
            limit=f"{b['limit']:g}",
            cause=cause,
            part=part,
            gap=gap,
        )
        crossed = crossed if put_right is None or alarms else say("night.words.besides", told=crossed, text=put_right)
        return _who_ignores(crossed, record, {x.get("parameter") for x in behind})
    if standing := record.get("standing"):
        first = standing[0]
        more = say("night.words.more_wait", count=len(standing) - 1) if len(standing) > 1 else ""
        by_now = joined("; ", (first.get("now"), (first.get("ahead") or {}).get("text")))
        now = joined("", (" (", by_now, ")")) if by_now else ""
        who = (
            say("night.words.has", owner=first["owner"])
            if first["decision"]
            else say("night.words.nobody_has_answered_alarm", night=first["night"])
        )
        waiting = say(
            "night.words.changed_since_night",
            night=first["night"],
            text=first["text"],
            now=now,
            who=who,
            more=more,
            part=part,
            gap=gap,
        )
        trend = record.get("trend") or {}
        known = {a["parameter"] for a in standing if a.get("rate_per_day")}  # that goes on is what its alarm says
        more_told = put_right or (None if trend.get("parameter") in known else trend.get("text"))
        return waiting if more_told is None else say("night.words.besides", told=waiting, text=more_told)
    nothing = say("night.words.nothing_has_changed")
    if put_right is not None:
        nothing = say("night.words.after_repair", text=put_right)
    elif unheard := record.get("ignored"):
        told = unheard[0]
        nothing = say("night.words.no_alarm_as_ignored", text=told["text"], owner=told["owner"], until=told["until"])
    elif (trend := record.get("trend")) and not _unheard(record):
        nothing = say("night.words.no_alarm_but", text=trend["text"])
    if silent := () if record.get("ignored") else _unheard(record):
        nothing = _beside_unheard(nothing if put_right else None, silent, record.get("trend"))
    open_ones = [limit for limit in record["limits"] if limit["passed"] is None]
    if open_ones:
        o = open_ones[0]
        return say(
            "night.words.whether_within_not_certain",
            nothing=nothing,
            part=part,
            what=what_of(o["what"]),
            limit=f"{o['limit']:g}",
            unit=o["unit"],
            gap=gap,
        )
    volume = (record.get("volume") or {}).get("worst_um")
    told = "" if volume is None else say("night.words.largest_error_over_volume", volume=f"{volume:.1f}")
    first_time = (record.get("change") or {}).get("p_value") is None
    first_word = say("night.words.first_time_renamed" if record.get("former") else "night.words.first_time")
    old_name = say("night.words.former_waits") if record.get("former") and not first_time else ""
    return joined("", (first_word if first_time else nothing, part, told, gap, old_name))


def _who_ignores(told: str, record: Mapping[str, Any], behind: Collection[Any]) -> str:
    """sentence of a crossed limit, record, parameters that stand behind it → the same with who ignores what until when."""
    silent = [*(record.get("ignored") or ()), *_unheard(record)]
    if not silent:
        return told
    first = next((a for a in silent if a.get("parameter") in behind), silent[0])
    more = say("night.words.more_ignored", count=len(silent) - 1) if len(silent) > 1 else ""
    name = named(str(first.get("parameter") or first["text"]), texts())
    return say("night.words.beyond_ignored", told=told, owner=first["owner"], until=first["until"], name=name, more=more)


def _unheard(record: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """record → what somebody ignores and that has not gone again."""
    return [a for a in record.get("unheard") or () if not is_gone(a["now"])]


def _beside_unheard(told: str | None, silent: Sequence[Mapping[str, Any]], trend: Mapping[str, Any] | None) -> Said:
    """what a repair has done (None: nothing), what somebody ignores, a trend → the sentence of a night without an alarm."""
    first = silent[0]
    text = joined("", (first["text"], *((" (", first["now"], ")") if first["now"] else ())))
    more = say("night.words.more_ignored", count=len(silent) - 1) if len(silent) > 1 else ""
    unheard = say("night.words.no_alarm_as_ignored", owner=first["owner"], until=first["until"], text=joined("", (text, more)))
    whole = unheard if told is None else joined("; ", (told, unheard))
    if trend is None or trend.get("parameter") in {a.get("parameter") for a in silent}:
        return whole
    return say("night.words.besides", told=whole, text=trend["text"])


def every(alarms: Sequence[Mapping[str, Any]]) -> str:
    """alarms of a night, one at least → all of them in one sentence."""
    texts_ = [joined("; ", (a["text"], more["text"])) if (more := beside(a)) else a["text"] for a in alarms]
    text = texts_[0]
    for other in texts_[1:]:
        text = say("changed.besides", text=text, other=other)
    return str(text)


def beside(a: Mapping[str, Any]) -> Mapping[str, Any]:
    """alarm of tonight → what its night says of the alarm that it goes on from or follows, with its `text`; {} for none."""
    return a.get("goes_on") or a.get("follows") or {}


def what_of(name: str) -> str:
    """name of a limit → its word; a symbol stays as it is."""
    return say("followed.volume") if name == "volume" else name


def _gap(record: Mapping[str, Any]) -> str:
    """record of a night → what a headline says of the nights before: those that are missing, or one that is dated after it."""
    if record.get("clock_back"):
        return say("night.words.clock_went_back", newest=record["clock_back"])
    count = record.get("unmeasured_count") or len(record.get("unmeasured") or ())
    if not count:
        return ""
    if count == 1:
        return say("night.words.night_before_was_not_measured")
    if count > LONG:
        return say("night.words.long_before_not_measured", count=count)
    return say("night.words.nights_before_were_not_measured", count=count)


def message(
    record: Mapping[str, Any],
    trouble: Sequence[str],
    left: Sequence[str],
    newest: tuple[int, str] | None = None,
    decisions: Sequence[Decision] = (),
    t: Texts | None = None,
) -> tuple[str, str]:
    """record, what went wrong while keeping it, what was found of earlier nights → subject and text of a message.

    `newest`: number of entries of the machine's history and hash of the last; `decisions`: what was decided about alarms; `t`:
    texts of the shop, else English.
    """
    t = t or texts()
    still = record["verdict"] == "changed" and not record["alarms"]
    refused = record["status"] == "refused"
    word = t("mail.refused") if refused else t("mail.still") if still else t(f"mail.subject_{record['verdict']}")
    subject = f"{record['machine']}: {word} ({record['night']})"
    lines = [t("audit.simulated"), ""] if record.get("simulated") else []
    first = as_decided(record, decisions)
    for one in (*record["alarms"], *(record.get("standing") or ())[:1]):
        first = _of_its_night(first, one, record["night"])
    lines += [_sentence(t.of(first)), *parts_first(record, t), ""]
    limits = record["limits"] if record.get("carried", True) else ()  # what is not believed keeps and crosses no limit
    crossed = [limit for limit in limits if limit["passed"] is False]
    lines += [*(_limit_line(limit, t) for limit in crossed), *([""] if crossed else [])]
    if stale := record.get("stale_nights"):
        lines += [t("mail.stale", nights=stale, date=record["last_measured"]), ""]
    owner = owner_of(record.get("owner"), record, t)
    for alarm in record["alarms"]:
        since = t("mail.since", date=_since(alarm, record["night"]), sigmas=f"{alarm['sigmas']:.0f}")
        lines += [f"* {t.of(_of_its_night(alarm['text'], alarm, record['night']))}", f"  {since}"]
        lines += [f"  {t.of(more['text'])}"] if (more := beside(alarm)) else []
        taken = alarm["owner"] if alarm.get("decision") else ""
        lines += _about(alarm, owner_of(alarm["owner"], record, t), t, record["night"])
        lines += [*_answers(alarm["id"], decisions, record["cell"], t, taken), ""]
    standing = record.get("standing") or ()
    for alarm in standing[:SHOWN]:
        who, taken = _who(alarm, decisions, t), alarm["owner"] if alarm["decision"] else ""
        lines += [f"* {t('mail.alarm_of', night=alarm['night'], who=who, text=_of_its_night(alarm['text'], alarm))}"]
        lines += [f"  {t.of(alarm['now'])}"] if alarm.get("now") else []
        lines += [f"  {t.of(alarm['ahead']['text'])}"] if alarm.get("ahead") else []
        lines += [*_about(alarm, owner_of(alarm["owner"], record, t), t)]
        lines += [*_answers(alarm["id"], decisions, record["cell"], t, taken), ""]
    if len(standing) > SHOWN:
        lines += [f"* {t('mail.more_alarms', count=len(standing) - SHOWN)}", ""]
    for alarm in record.get("unheard") or ():
        told = {key: alarm[key] for key in ("night", "owner", "until", "text")}
        lines += [f"* {t('mail.ignored', **told)}", *([f"  {t.of(alarm['now'])}"] if alarm["now"] else []), ""]
    named = {alarm.get("parameter") for alarm in (*record["alarms"], *standing[:SHOWN])}  # their alarm has said the rest above
    for cause in record.get("behind") or ():
        lines += [f"* {t('mail.behind', what=what_of(cause['what']), text=cause['text'])}"]
        lines += [*([] if cause.get("parameter") in named else _about(cause, owner, t)), ""]
    if record["verdict"] == "out_of_limits" and not record.get("behind") and not record["alarms"]:
        lines += [f"* {t('mail.do', text=t('night.beyond_do'))}", f"  {t('mail.owner', owner=owner)}", ""]
    failed = [p for p in record["preflight"] if not p["passed"]]
    lines += [f"* {_checked(p, t)} {t('mail.not_moved')}" for p in failed]
    if record["verdict"] == "not_measured":
        lines += _unmeasured(record, owner, failed, t)
    if record["status"] == "partial" and record.get("why"):
        lines.append(f"* {_sentence(t.of(record['why']))}")
    if record["verdict"] == "doubtful":
        lines += [f"* {_sentence(t.of(r))}" for r in ((record.get("plausible") or {}).get("reasons") or ())]
        reasons = (record.get("plausible") or {}).get("reasons") or ()
        lines += [f"* {t('mail.do', text=orders(reasons, t))}", f"  {t('mail.owner', owner=owner)}"]
        if not record.get("carried", True):
            lines.append(f"* {t('mail.not_carried', night=record.get('last_carried') or say('mail.no_night'))}")
    lines += [_limit_line(limit, t) for limit in limits if limit["passed"] is not False]
    if line := held(record, t):
        lines.append(f"* {line}")
    if apart := record.get("outliers") or ():
        numbers = ", ".join(str(n) for n in apart)
        lines.append(f"* {t('night.set_apart' if len(apart) == 1 else 'night.set_apart_many', numbers=numbers)}")
    if why := record.get("undiagnosed"):
        lines.append(f"* {t('night.undiagnosed', why=str(why).rstrip('.'))}")
    if (change := record.get("change")) is not None and change.get("p_value") is not None:
        text = change["text"]
        lines.append("* " + (t("mail.chance", text=text, p=f"{change['p_value']:.2g}") if _by_test(record) else t.of(text)))
    if (asked := record.get("next")) is not None:
        lines.append(f"* {t('mail.next', kind=code(asked['kind']), why=asked['why'])}")
    if (changed_files := record.get("edited")) and record["verdict"] != "doubtful":  # a doubt has it among its reasons
        lines.append(f"* {t.of(changed_files['text'])}")
    if newest_night := record.get("clock_back"):
        lines.append(f"* {t('mail.clock_back', night=record['night'], newest=newest_night)}")
    lines += [f"* {t.of(text)}" for text in record.get("former") or ()]
    before = [t.of(text) for text in record.get("unmeasured") or ()]
    lines += [
        f"* {text}" for text in (*before, *(t.of(x) for x in left if x not in before and x[:10] not in {b[:10] for b in before}))
    ]
    lines += [f"* {t.of(text)}" for text in trouble]
    lines.append("")
    if record["kind"] == "none":
        lines.append(t("mail.nothing_measured"))
    else:
        minutes, counts = f"{record['machine_time_s'] / 60:.0f}", {"touches": record["touches"], "planned": record["planned"]}
        lines.append(t("mail.measured", kind=code(record["kind"]), minutes=minutes, **counts))
    kept = record["artefacts"]["folder"] if "artefacts" in record else ""
    known = {"cell": record["cell"], "folder": kept}
    old = next((p["found"] for p in record["preflight"] if p["check"] == "import"), None)
    if old is not None:
        lines.append(t("mail.cell_imported", cell=record["cell"], found=old))
    else:
        lines.append(t("mail.cell_files", **known) if kept and record["touches"] else t("mail.cell", cell=record["cell"]))
    if newest is not None:
        lines.append(t(f"mail.history{'_one' if newest[0] == 1 else ''}", count=newest[0], digest=newest[1]))
    return subject, "\n".join(lines) + "\n"


def _by_test(record: Mapping[str, Any]) -> bool:
    """record → whether the one test of the night decided it: not a repair that was measured, what many nights have shown, an alarm
    of another night, or somebody who ignores it. A size that many nights know is no matter of tonight's chance.
    """
    change = record["change"]
    if any(not a.get("repair") and not a.get("rate_per_day") for a in record["alarms"]):
        return bool(change["p_value"] < change["limit"])
    others = ("alarms", "repaired", "ignored", "standing", "unheard", "trend", "behind")
    return not any(record.get(member) for member in others)


def _limit_line(limit: Mapping[str, Any], t: Texts) -> str:
    key = {True: "mail.within", False: "mail.beyond", None: "mail.uncertain"}[limit["passed"]]
    what, value, most = what_of(limit["what"]), f"{limit['value']:.1f} {limit['unit']}", f"{limit['limit']:g}"
    return f"* {t(key, what=what, value=value, limit=most)}"


def _checked(point: Mapping[str, Any], t: Texts) -> str:
    """point of the preflight that failed, texts → `probe: No answer; change its battery.`"""
    found, do = t.of(point["found"]).rstrip("."), t.of(point["do"])
    name = t(f"check_name.{point['check']}") if f"check_name.{point['check']}" in t else point["check"]
    return f"{name}: {_sentence('; '.join(x for x in (found, do) if x))}"


def _since(a: Mapping[str, Any], night: str = "") -> str:
    """alarm, its night where that is tonight → since when: the night that found it, where the one before was without it."""
    found = str(a.get("night") or night)
    at_once = not a.get("rate_per_day") and days_between(a.get("since") or found, found) == 1
    return say("morning.found", date=found) if at_once else str(a.get("since") or "")


def _of_its_night(text: str, a: Mapping[str, Any], night: str = "") -> str:
    """sentence on an alarm, the alarm, its night where that is tonight → the same with the date that pages give it."""
    if not a.get("since"):
        return text
    return instead(instead(text, "last night", str(a["since"])), str(a["since"]), _since(a, night))


def _about(cause: Mapping[str, Any], owner: str, t: Texts, night: str = "") -> list[str]:
    """alarm or what stands behind a limit, who is asked, texts, its night where that is tonight → what it does, what to do."""
    steady = cause.get("rate_per_day") and cause.get("steady", True)  # what came in one night goes on at no rate
    rate = value(cause["rate_per_day"], cause["unit"]) if steady else ""
    lines = [t("mail.rate", rate=rate)] if rate and rate not in cause["text"] else []
    own = isinstance(cause["do"], Said) and cause["do"].key in OWN  # says more than who was at the machine
    again = f"confirmed.{cause.get('cause')}" if cause.get("confirmed") and not steady and not own else ""
    lines += [
        t("mail.on_part", text=_of_its_night(by_tonight(cause)["on_part"], cause, night)),
        t("mail.do", text=t(again) if again in t else cause["do"]),
    ]
    if cause.get("instead"):
        names = [named(str(name), t) for name in cause["instead"]]
        lines.append(t("mail.instead", names=", ".join(names)))
    return [f"  {line}" for line in (*lines, t("mail.owner", owner=owner))]


def _who(alarm: Mapping[str, Any], decisions: Sequence[Decision], t: Texts) -> str:
    """alarm of another night, decisions of today → what its line says of an answer: the last one counts."""
    own = [d for d in decisions if d.alarm == alarm["id"]]
    if own and own[-1].action != "acknowledge":
        return t.of(code(own[-1].action))
    if own or alarm["decision"]:
        return t("mail.acknowledged", owner=own[-1].owner if own else alarm["owner"])
    return t("mail.not_answered")


def answer(alarm: str, cell: str, history: str | None = None, taken: str = "") -> str:
    """alarm, folder of the cell, history that was named, who has it already → the command that answers it, from any folder."""
    where = ("" if cell in ("", ".") else f" -C {shlex.quote(cell)}") + (
        "" if history is None else f" --history {shlex.quote(history)}"
    )
    action, owner = ("repaired", shlex.quote(taken)) if taken else ("acknowledge", "NAME")
    return f"tango history decide {alarm}{where} --action {action} --owner {owner}"


def _answers(alarm: str, decisions: Sequence[Decision], cell: str, t: Texts, taken: str = "") -> list[str]:
    """alarm, decisions of today, folder of the cell, texts, who has it already → how to answer it, or how it was answered."""
    own = [d for d in decisions if d.alarm == alarm]
    if not own and taken:
        return ["  " + t("mail.when_done", command=answer(alarm, cell, taken=taken)), "  " + t("mail.or_when_done")]
    if not own:
        return ["  " + t("mail.to_answer", command=answer(alarm, cell)), "  " + t("mail.or_answer")]
    return [f"  {t('mail.answered', text=decided(d))}" for d in own]


def decided(d: Decision) -> str:
    """decision → `accept until 2026-12-01 by Ann, 2026-11-20: why`, as a text that can be translated."""
    until = say("mail.until", date=d.until) if d.until else ""
    note = f": {d.note}" if d.note else ""
    return say("mail.decision", action=code(d.action), until=until, owner=d.owner, date=d.utc[:10], note=note)


def _unmeasured(record: Mapping[str, Any], owner: str, failed: Sequence[Mapping[str, Any]], t: Texts) -> list[str]:
    whose = t("mail.owner", owner=owner)
    if record["status"] == "refused":
        do, part = t("mail.do", text=t("night.refused_do")), t("mail.on_part", text=t("night.refused_part"))
        return [f"* {do}", f"* {part}", f"* {whose}"]
    key = "night.moved_do" if record.get("moved") else "night.unmeasured_do"  # it was at work: the control knows more
    do = "" if any(p["do"] for p in failed) else t("mail.do", text=t(key, cell=record["cell"]))
    last = record.get("last_measured")
    never = t("night.unmeasured_unknown" if record.get("unread") else "night.unmeasured_never")
    known = t("night.unmeasured_part", date=last) if last else never
    return [*([f"* {do}"] if do else []), f"* {t('mail.on_part', text=known)}", f"* {whose}"]


def _sentence(text: str) -> str:
    """text → a capital in front and one full stop at the end."""
    whole = text[:1].upper() + text[1:]
    return whole if whole.endswith((".", "?", "!", "…")) else f"{whole}."
