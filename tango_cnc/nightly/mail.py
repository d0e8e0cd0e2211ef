"""The message of a night: what the one who is asked reads in a mailbox."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from typing import Any

from ..history import Decision
from ..report.compensated import held
from ..report.days import days_between
from ..report.decimals import decimals
from ..report.look import orders
from ..report.repeated import as_decided, as_found, first_night, stories
from ..report.right import by_its_whole, without_full
from ..report.texts import Texts, code, texts
from ..report.tonight import WARMED, as_drifting, by_tonight, by_verdict, is_gone, is_over, only_set_up, sized, with_its_size
from ..report.words import named
from ..state.changes import change
from ..texts import Said, instead, say, unstopped
from ..texts.handed import of_cell
from ..texts.number import number
from .doubt import is_small, left_over
from .first import owner_of, parts_first
from .words import beside, pace_of, what_of

SHOWN = 3  # alarms that wait, in full
OWN = (
    "night.drift_do",
    "night.drift_warm_do",
    "night.sensors.do",
    "night.sensors.warmer_do",
    "night.sensors.colder_do",
    "night.sensors.was_warmer_do",
    "night.sensors.was_colder_do",
    "night.comes_back.repaired_do",
    "night.edited.do",
)  # what to do that a full measurement does not take back


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
    t, record = t or texts(), as_drifting(record)
    limits = record["limits"] if record.get("carried", True) else ()  # what is not believed keeps and crosses no limit
    crossed = [*(_limit_line(limit, t) for limit in limits if limit["passed"] is False), *_before(record, t)]
    owner = owner_of(record.get("owner"), record, t)
    lines = [
        *_first(record, decisions, t),
        *(*crossed, *([""] if crossed else [])),
        *([t("mail.stale", nights=stale, date=record["last_measured"]), ""] if (stale := record.get("stale_nights")) else []),
        *_alarms(record, decisions, t),
        *_standing(record, decisions, t),
        *_behind(record, owner, t),
        *_not_good(record, owner, t),
        *(_limit_line(limit, t) for limit in limits if limit["passed"] is not False),
        *_besides(record, t),
        *_earlier(record, left, t),
        *(f"* {t.of(text)}" for text in trouble),
        "",
        *_measured(record, newest, t),
    ]
    return decimals(_subject(record, t), t), decimals(of_cell("\n".join(lines) + "\n", record["cell"]), t)


def _subject(record: Mapping[str, Any], t: Texts) -> str:
    """record, texts → subject: `hu40t: changed (2026-03-10)`."""
    still = record["verdict"] == "changed" and not record["alarms"]
    refused = record["status"] == "refused"
    unsure = record["verdict"] == "good" and any(x["passed"] is None for x in record["limits"])
    open_only = still and all(map(is_over, record.get("standing") or ()))  # all of it has gone back, and nobody has closed it
    word = (
        t("mail.refused")
        if refused
        else t("mail.still_open" if open_only else "mail.still")
        if still
        else t(f"mail.subject_{'unsure' if unsure else record['verdict']}")
    )
    if record["verdict"] == "out_of_limits" and record["alarms"]:  # the limit may have been crossed before: tonight something moved
        word = f"{word}, {t('mail.subject_changed')}"
    return f"{record['machine']}: {word} ({record['night']})"


def _first(record: Mapping[str, Any], decisions: Sequence[Decision], t: Texts) -> list[str]:
    """record, decisions, texts → its headline with the date that pages give an alarm, and what comes before everything else."""
    lines = [t("audit.simulated"), ""] if record.get("simulated") else []
    first = sized(as_found(as_decided(record, decisions), record), record)
    return [*lines, _sentence(t.of(first)), *parts_first(record, t), ""]


def _before(record: Mapping[str, Any], t: Texts) -> list[str]:
    """record, texts → of a night that measured nothing the limits as the last one knew them; which parts to check, where a limit is
    crossed or nothing was measured.
    """
    night = record.get("last_measured")
    lines = [t("morning.now_of", told=_limit_line(x, t), date=night) for x in record.get("last_limits") or ()]
    return lines + ([f"* {t('mail.suspect', text=parts)}"] if (parts := record.get("parts_to_check")) else [])


def _alarms(record: Mapping[str, Any], decisions: Sequence[Decision], t: Texts) -> list[str]:
    """record, decisions, texts → alarms of tonight."""
    lines: list[str] = []
    for alarm in record["alarms"]:
        since = t("mail.since", date=_since(alarm, record["night"]), sigmas=f"{alarm['sigmas']:.0f}")
        lines += [f"* {t.of(_of_its_night(alarm['text'], alarm, record['night']))}", f"  {since}"]
        lines += [f"  {t.of(more['text'])}"] if (more := beside(alarm)) else []
        taken = alarm["owner"] if alarm.get("decision") else ""
        lines += _about(alarm, owner_of(alarm["owner"], record, t), t, record, record["night"])
        lines += [*_answers(alarm["id"], decisions, record["cell"], t, taken), ""]
    return lines


def _standing(record: Mapping[str, Any], decisions: Sequence[Decision], t: Texts) -> list[str]:
    """record, decisions, texts → alarms of nights before: those that wait, and those that somebody ignores."""
    lines: list[str] = []
    standing = record.get("standing") or ()
    for alarm in standing[:SHOWN]:
        who, taken = _who(alarm, decisions, t), alarm["owner"] if alarm["decision"] else ""
        lines += [f"* {t('mail.alarm_of', night=alarm['night'], who=who, text=_of_its_night(alarm['text'], alarm))}"]
        lines += [f"  {t.of(alarm['now'])}"] if alarm.get("now") else []
        lines += [f"  {t.of(alarm['ahead']['text'])}"] if alarm.get("ahead") else []
        lines += [*_about(alarm, owner_of(alarm["owner"], record, t), t, record)]
        lines += [*_answers(alarm["id"], decisions, record["cell"], t, taken), ""]
    if more := len(stories(standing) - stories(standing[:SHOWN])):
        lines += [f"* {t('mail.more_alarms', count=more)}", ""]
    for alarm in record.get("unheard") or ():
        told = {key: alarm[key] for key in ("night", "owner", "until")} | {"text": _of_its_night(alarm["text"], alarm)}
        lines += [f"* {t('mail.ignored', **told)}", *([f"  {t.of(alarm['now'])}"] if alarm["now"] else []), ""]
    return lines


def _behind(record: Mapping[str, Any], owner: str, t: Texts) -> list[str]:
    """record, who is asked, texts → what stands behind a limit that was crossed, or what to do where nobody knows it."""
    lines: list[str] = []
    alarms = [*record["alarms"], *(record.get("standing") or ())[:SHOWN]]
    told = {alarm.get("parameter") for alarm in alarms}  # said already
    for cause in record.get("behind") or ():
        same = next(
            (
                a
                for a in alarms
                if a.get("since") and (a.get("parameter"), a["since"]) == (cause.get("parameter"), cause.get("since"))
            ),
            None,
        )
        one = _of_its_night(cause["text"], cause) if same is None else _of_its_night(same["text"], same, record["night"])
        text = one if same is None else with_its_size(one, same)
        lines += [f"* {t('mail.behind', what=what_of(cause['what']), text=text)}"]
        lines += [*([] if cause.get("parameter") in told else _about(cause, owner, t, record)), ""]
    if record["verdict"] == "out_of_limits" and not record.get("behind") and not record["alarms"]:
        lines += [f"* {t('mail.do', text=t('night.beyond_do'))}", f"  {t('mail.owner', owner=owner)}", ""]
    return lines


def _not_good(record: Mapping[str, Any], owner: str, t: Texts) -> list[str]:
    """record, who is asked, texts → why a night measured nothing, not all of it, or is in doubt, and what to do."""
    failed = [p for p in record["preflight"] if not p["passed"]]
    lines = [f"* {_checked(p, t)} {t('mail.not_moved')}" for p in failed]
    if record["verdict"] == "not_measured":
        lines += _unmeasured(record, owner, failed, t)
    if record["status"] == "partial" and record.get("why"):
        lines.append(f"* {_sentence(t.of(record['why']))}")
    if record["verdict"] == "doubtful":
        reasons = (record.get("plausible") or {}).get("reasons") or ()
        lines += [f"* {_sentence(t.of(r))}" for r in reasons]
        lines += [f"* {t('mail.do', text=orders(reasons, t))}", f"  {t('mail.owner', owner=owner)}"]
        if not record.get("carried", True):
            lines.append(f"* {t('mail.not_carried', night=record.get('last_carried') or say('mail.no_night'))}")
    return lines


def _besides(record: Mapping[str, Any], t: Texts) -> list[str]:
    """record, texts → a compensation, touches set apart, how sure the night is, what comes next, what was edited."""
    lines = [f"* {line}"] if (line := held(record, t)) else []
    lines += [f"* {t.of(warm['text'])}"] if (warm := record.get("temperature")) else []
    if apart := record.get("outliers") or ():
        numbers = ", ".join(str(n) for n in apart)
        lines.append(f"* {t('night.set_apart' if len(apart) == 1 else 'night.set_apart_many', numbers=numbers)}")
    if why := record.get("undiagnosed"):
        lines.append(f"* {t('night.undiagnosed', why=str(why).rstrip('.'))}")
    if record["verdict"] != "doubtful" and left_over(found := record.get("diagnosis") or {}) and is_small(found):
        lines.append(f"* {t('night.left_small', what=unstopped(t.of(found['unexplained'][0]['text'])))}")
    if (change := record.get("change")) is not None and change.get("p_value") is not None:
        text = change["text"]
        lines.append("* " + (t("mail.chance", text=text, p=f"{change['p_value']:.2g}") if _by_test(record) else t.of(text)))
    if (asked := record.get("next")) is not None:
        lines.append(f"* {t('mail.next', kind=code(asked['kind']), why=asked['why'])}")
    if (edited := record.get("edited")) and record["verdict"] != "doubtful":  # a doubt has it among its reasons
        lines.append(f"* {t.of(edited['text'])}")
    return lines


def _earlier(record: Mapping[str, Any], left: Sequence[str], t: Texts) -> list[str]:
    """record, what was found of earlier nights, texts → a clock that went back, other names, nights that are missing."""
    lines = []
    if newest := record.get("clock_back"):
        lines.append(f"* {t('mail.clock_back', night=record['night'], newest=newest)}")
    lines += [f"* {t.of(text)}" for text in record.get("former") or ()]
    before = list(dict.fromkeys(t.of(text) for key in ("unmeasured", "left_behind") for text in record.get(key) or ()))
    dates = {text[:10] for text in before}
    return [*lines, *(f"* {text}" for text in (*before, *(t.of(x) for x in left if x not in before and x[:10] not in dates)))]


def _measured(record: Mapping[str, Any], newest: tuple[int, str] | None, t: Texts) -> list[str]:
    """record, entries of the history and hash of the last, texts → what was measured, and where it is kept."""
    lines = []
    if record["kind"] == "none":
        lines.append(t("mail.not_judged" if _is_unjudged(record) else "mail.nothing_measured"))
    else:
        minutes, counts = f"{record['machine_time_s'] / 60:.0f}", {"touches": record["touches"], "planned": record["planned"]}
        lines.append(t("mail.measured", kind=code(record["kind"]), minutes=minutes, **counts))
    kept = record["artefacts"]["folder"] if "artefacts" in record else ""
    old = next((p["found"] for p in record["preflight"] if p["check"] == "import"), None)
    if old is not None:
        lines.append(t("mail.cell_imported", cell=record["cell"], found=old))
    elif kept and (record["touches"] or _is_unjudged(record)):
        lines.append(t("mail.cell_files", cell=record["cell"], folder=kept))
    else:
        lines.append(t("mail.cell", cell=record["cell"]))
    if newest is not None:
        lines.append(t(f"mail.history{'_one' if newest[0] == 1 else ''}", count=newest[0], digest=newest[1]))
    return lines


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
    what, value, most = what_of(limit["what"]), number(limit["value"], limit["unit"], signed=False), f"{limit['limit']:g}"
    return f"* {t(key, what=what, value=value, limit=most)}"


def _checked(point: Mapping[str, Any], t: Texts) -> str:
    """point of the preflight that failed, texts → `probe: No answer; change its battery.`"""
    found, do = t.of(point["found"]).rstrip("."), t.of(point["do"])
    name = t(f"check_name.{point['check']}") if f"check_name.{point['check']}" in t else point["check"]
    return f"{name}: {_sentence('; '.join(x for x in (found, do) if x))}"


def _since(a: Mapping[str, Any], night: str = "") -> str:
    """alarm, its night where that is tonight → since when: the night that found it, where the one before was without it."""
    found = first_night(a, night)
    next_to = days_between(a.get("since") or found, found) == 1
    return say("morning.found", date=found) if next_to else str(a.get("since") or "")


def _of_its_night(text: str, a: Mapping[str, Any], night: str = "") -> str:
    """sentence on an alarm, the alarm, its night where that is tonight → the same with the date that pages give it."""
    if not a.get("since"):
        return text
    return instead(instead(text, "last night", str(a["since"])), str(a["since"]), _since(a, night))


def _about(cause: Mapping[str, Any], owner: str, t: Texts, record: Mapping[str, Any], night: str = "") -> list[str]:
    """alarm or what stands behind a limit, who is asked, texts, record, its night if that is tonight → effect, what to do."""
    usual = cause["do"]
    cause = by_its_whole(by_verdict(cause, record["verdict"]), record)
    steady = cause.get("rate_per_day") and cause.get("steady", True)  # what came in one night goes on at no rate
    rate = pace_of(cause["rate_per_day"], cause["unit"], cause.get("alike_by") or {}) if steady else ""
    lines = [t("mail.rate", rate=rate)] if rate and rate not in cause["text"] else []
    own = isinstance(cause["do"], Said) and cause["do"].key in OWN  # says more than who was at the machine
    again = f"confirmed.{cause.get('cause')}" if cause.get("confirmed") and not steady and not own else ""
    do = t.of(t(again) if again in t and cause["do"] == usual else cause["do"])
    lines += [
        t("mail.on_part", text=_gone_part(cause, record, night, t) or _of_its_night(by_tonight(cause)["on_part"], cause, night)),
        *([t("mail.suspect", text=suspect)] if (suspect := _suspect(cause, record, night, t)) else []),
        t("mail.do", text=without_full(do, cause, record, t) if night else do),
    ]
    of_machine = cause.get("cause") not in WARMED and not change(cause.get("cause")).of_the_probe
    said = _says(cause["do"], "night.drift_do") or is_over(cause)
    if steady and of_machine and not said and not cause.get("stands"):
        lines.append(t("mail.no_location"))
    if cause.get("instead"):
        names = [named(str(name), t) for name in cause["instead"]]
        lines.append(t("mail.instead", names=", ".join(names)))
    return [f"  {line}" for line in (*lines, t("mail.owner", owner=owner))]


def _says(do: Any, key: str) -> bool:
    """what to do, key of a sentence → whether that is it, or within it."""
    return isinstance(do, Said) and (do.key == key or any(_says(x, key) for x in do.values.values()))


def _gone_part(cause: Mapping[str, Any], record: Mapping[str, Any], night: str, t: Texts) -> str:
    """alarm, record, the night of the alarm if that is tonight, texts → which parts a change that has gone back makes different, as
    its page says; '' of one that stands.
    """
    undone = cause.get("undoes") or {}
    if not cause.get("on_part") or not (undone or is_gone(cause.get("now") or "")):
        return ""
    begun = str(undone.get("alarm") or cause.get("id") or "")
    former = next((a for a in record.get("standing") or () if undone and a["id"] == begun), {} if undone else cause)
    begun = str(former.get("since") or begun[:10])
    back = any((a.get("undoes") or {}).get("alarm") == cause.get("id") for a in record["alarms"])  # tonight has found it gone
    until = (night or str(cause.get("id") or "")[:10]) if undone else str(cause.get("gone_by") or (record["night"] if back else ""))
    end = "_probe" if change(cause.get("cause")).scatters else "_by" if until else ""
    return t(f"morning.gone_part{end}", date=begun, until=until)


def _suspect(cause: Mapping[str, Any], record: Mapping[str, Any], night: str, t: Texts) -> str:
    """alarm, record, its night if that is tonight, texts → which parts may have what moved in one night, as its page says; '' where
    that is another matter: of the probe, of what has gone back, and beyond a limit (`parts_to_check`). A machine that is warmer
    asks for none, but where a knock may be all of it.
    """
    since = str(cause.get("since") or "")
    at_once = night and since and not any(cause.get(key) for key in ("undoes", "rate_per_day", "goes_on"))
    of_machine = not only_set_up(cause) and (cause.get("cause") not in WARMED or _says(cause["text"], "night.sensors.or_knock"))
    if not at_once or not of_machine or record["verdict"] != "changed":
        return ""
    return t("morning.suspect", date=since)


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
    still = "night.unread_do" if record.get("unread") else "night.unmeasured_do"
    key = "night.moved_do" if record.get("moved") else still  # it was at work: the control knows more
    usual = t("night.night.see_to_history") if _is_unjudged(record) else t(key)
    do = "" if any(p["do"] for p in failed) else t("mail.do", text=usual)
    last = record.get("last_measured")
    never = t("night.unmeasured_unknown" if record.get("unread") else "night.unmeasured_never")
    known = t("night.unmeasured_part", date=last) if last else never
    return [*([f"* {do}"] if do else []), f"* {t('mail.on_part', text=known)}", f"* {whose}"]


def _is_unjudged(record: Mapping[str, Any]) -> bool:
    """record → whether its touches were made and are kept, and the history kept the night from judging them."""
    why = record.get("why")
    return isinstance(why, Said) and why.key == "night.night.not_judged"


def _sentence(text: str) -> str:
    """text → a capital in front and one full stop at the end."""
    whole = text[:1].upper() + text[1:]
    return whole if whole.endswith((".", "?", "!", "…")) else f"{whole}."
