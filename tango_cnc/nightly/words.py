"""A night in words: one sentence for a telephone, a message for a mailbox, and what each cause means."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..history import Decision
from ..report.texts import texts
from ..report.units import shown
from ..report.words import moved
from ..texts import joined, say

SUBJECT = {
    "good": "as it should be",
    "changed": "HAS CHANGED",
    "out_of_limits": "OUT OF LIMITS",
    "doubtful": "readings in doubt",
    "not_measured": "NOT MEASURED",
}
STILL = "STILL CHANGED"
REFUSED = "not begun, the folder is in use"
NOBODY = "none is stated in nightly.yaml"
SHOWN = 3  # alarms that wait, in full


def cause_texts(cause: str, effect_um: float) -> tuple[str, str]:
    """cause, µm that it does at most → what it means for a part, what to do (tango_cnc/texts/en.toml)."""
    t = texts()
    return t(f"cause.{cause}.on_part", effect=f"{effect_um:.1f} µm"), t(f"cause.{cause}.do")


def changed(parameter: str, size: str, since: str = "last night") -> str:
    """name of ISO 230-1 or a facet, size of its change, since when → a sentence that names the axis before the symbol."""
    return moved(parameter, size, since)


def value(number: float, unit: str, std: float | None = None) -> str:
    """number in mm, rad …, unit, standard deviation → '+19.8 ± 0.4 µm'."""
    factor, name = shown(unit)
    spread = "" if std is None else f" ± {std * factor:.1f}"
    return f"{number * factor:+.1f}{spread} {name}"


def headline(record: Mapping[str, Any]) -> str:
    """record of a night → one sentence."""
    if record["status"] == "missed":
        return say("night.words.no_measurement", why=record["why"])
    if record["status"] == "refused":
        return say("night.words.not_begun_was_not_disturbed", why=record["why"])
    if record["verdict"] == "not_measured":
        return say("night.words.not_measured", why=record["why"])
    alarms = record["alarms"]
    if record["verdict"] == "doubtful":
        reasons = (record.get("plausible") or {}).get("reasons") or [record.get("why") or say("night.words.see_report")]
        return say("night.words.readings_not_be_relied_on", reason=reasons[0])
    beyond = [limit for limit in record["limits"] if limit["passed"] is False]
    if alarms and not beyond:
        return str(alarms[0]["text"])
    part = (
        say("night.words.stopped_after_touches", touches=record["touches"], planned=record["planned"])
        if record["status"] == "partial"
        else ""
    )
    gap = _gap(record.get("unmeasured") or ())
    if beyond:
        b = max(beyond, key=lambda limit: limit["value"] / limit["limit"])
        stands = [x["text"] for x in record.get("behind") or () if x["what"] == b["what"]]
        cause = next((joined("", (": ", text)) for text in (*(str(a["text"]) for a in alarms), *stands)), "")
        return say(
            "night.words.allowed",
            what=_what(b["what"]),
            value=f"{b['value']:.1f}",
            unit=b["unit"],
            limit=f"{b['limit']:g}",
            cause=cause,
            part=part,
            gap=gap,
        )
    if standing := record.get("standing"):
        first = standing[0]
        more = say("night.words.more_wait", count=len(standing) - 1) if len(standing) > 1 else ""
        now = joined("", (" (", first["now"], ")")) if first.get("now") else ""
        who = (
            say("night.words.has", owner=first["owner"])
            if first["decision"]
            else say("night.words.nobody_has_answered_alarm", night=first["night"])
        )
        return say(
            "night.words.changed_since_night",
            night=first["night"],
            text=first["text"],
            now=now,
            who=who,
            more=more,
            part=part,
            gap=gap,
        )
    nothing = say("night.words.nothing_has_changed")
    if trend := record.get("trend"):
        nothing = say("night.words.no_alarm_but", text=trend["text"])
    open_ones = [limit for limit in record["limits"] if limit["passed"] is None]
    if open_ones:
        o = open_ones[0]
        return say(
            "night.words.whether_within_not_certain",
            nothing=nothing,
            part=part,
            what=_what(o["what"]),
            limit=f"{o['limit']:g}",
            unit=o["unit"],
            gap=gap,
        )
    volume = (record.get("volume") or {}).get("worst_um")
    told = "" if volume is None else say("night.words.largest_error_over_volume", volume=f"{volume:.1f}")
    first_time = (record.get("change") or {}).get("p_value") is None
    return joined("", (say("night.words.first_time") if first_time else nothing, part, told, gap))


def _what(name: str) -> str:
    """name of a limit → its word; a symbol stays as it is."""
    return say("followed.volume") if name == "volume" else name


def _gap(unmeasured: Sequence[str]) -> str:
    if not unmeasured:
        return ""
    return (
        say("night.words.night_before_was_not_measured")
        if len(unmeasured) == 1
        else say("night.words.nights_before_were_not_measured", count=len(unmeasured))
    )


def message(
    record: Mapping[str, Any],
    trouble: Sequence[str],
    left: Sequence[str],
    newest: tuple[int, str] | None = None,
    decisions: Sequence[Decision] = (),
) -> tuple[str, str]:
    """record, what went wrong while keeping it, what was found of earlier nights → subject and text of a message.

    `newest`: number of entries of the machine's history and hash of the last; `decisions`: what was decided about alarms.
    """
    still = record["verdict"] == "changed" and not record["alarms"]
    refused = record["status"] == "refused"
    word = REFUSED if refused else STILL if still else SUBJECT[record["verdict"]]
    subject = f"{record['machine']}: {word} ({record['night']})"
    lines = [_sentence(record["headline"]), ""]
    crossed = [limit for limit in record["limits"] if limit["passed"] is False]
    lines += [*(_limit_line(limit) for limit in crossed), *([""] if crossed else [])]
    owner = record.get("owner") or NOBODY
    for alarm in record["alarms"]:
        lines += [f"* {alarm['text']}", f"  since {alarm['since']}, {alarm['sigmas']:.0f} standard deviations"]
        lines += [*_about(alarm, alarm["owner"] or NOBODY), *_answers(alarm["id"], decisions), ""]
    standing = record.get("standing") or ()
    for alarm in standing[:SHOWN]:
        who = f"{alarm['owner']} has acknowledged it" if alarm["decision"] else "not answered"
        lines += [f"* alarm of {alarm['night']}, {who}: {alarm['text']}"]
        lines += [f"  {alarm['now']}"] if alarm.get("now") else []
        lines += [*_about(alarm, alarm["owner"] or NOBODY), *_answers(alarm["id"], decisions), ""]
    if len(standing) > SHOWN:
        lines += [f"* {len(standing) - SHOWN} more alarms wait: tango nightly --status", ""]
    for cause in record.get("behind") or ():
        lines += [f"* behind {cause['what']}: {cause['text']}", *_about(cause, owner), ""]
    if record["verdict"] == "out_of_limits" and not record.get("behind") and not record["alarms"]:
        lines += [f"* what to do: {texts()('night.beyond_do')}", f"  owner: {owner}", ""]
    failed = [p for p in record["preflight"] if not p["passed"]]
    lines += [
        f"* {p['check']}: {_sentence('; '.join(x for x in (p['found'].rstrip('.'), p['do']) if x))} Nothing was moved."
        for p in failed
    ]
    if record["verdict"] == "not_measured":
        lines += _unmeasured(record, owner, failed)
    if record["verdict"] == "doubtful":
        lines += [f"* {_sentence(r)}" for r in ((record.get("plausible") or {}).get("reasons") or ())]
        lines += [f"* what to do: {texts()('night.doubtful_do')}", f"  owner: {owner}"]
        if not record.get("carried", True):
            lines.append(
                f"* nothing of this night is carried on; what is known is that of {record.get('last_measured') or 'no night yet'}"
            )
    lines += [_limit_line(limit) for limit in record["limits"] if limit["passed"] is not False]
    if apart := record.get("outliers") or ():
        numbers = ", ".join(str(n) for n in apart)
        lines.append(f"* {texts()('night.set_apart' if len(apart) == 1 else 'night.set_apart_many', numbers=numbers)}")
    if (change := record.get("change")) is not None and change.get("p_value") is not None:
        lines.append(f"* {change['text']}; tonight's probability by chance: {change['p_value']:.2g}")
    if (asked := record.get("next")) is not None:
        lines.append(f"* next night: {asked['kind']} ({asked['why']})")
    before = list(record.get("unmeasured") or ())
    lines += [f"* {text}" for text in (*before, *(x for x in left if x not in before and x[:10] not in {b[:10] for b in before}))]
    lines += [f"* {text}" for text in trouble]
    lines.append("")
    if record["kind"] == "none":
        lines.append("nothing was measured")
    else:
        minutes = record["machine_time_s"] / 60
        lines.append(f"{record['kind']} night, {record['touches']} of {record['planned']} touches, {minutes:.0f} min")
    kept = record["artefacts"]["folder"] if "artefacts" in record else ""
    lines.append(f"cell {record['cell']}" + (f", files in {kept}" if kept and record["touches"] else ""))
    if newest is not None:
        lines.append(f"history: {newest[0]} entries, the newest is {newest[1]}")
    return subject, "\n".join(lines) + "\n"


def _limit_line(limit: Mapping[str, Any]) -> str:
    word = {True: "within", False: "BEYOND", None: "not certain to be within"}[limit["passed"]]
    return f"* {limit['what']}: {limit['value']:.1f} {limit['unit']}, {word} {limit['limit']:g}"


def _about(cause: Mapping[str, Any], owner: str) -> list[str]:
    lines = [f"  at {value(cause['rate_per_day'], cause['unit'])} a day"] if cause.get("rate_per_day") else []
    lines += [f"  on a part: {cause['on_part']}", f"  what to do: {cause['do']}"]
    if cause.get("instead"):
        lines.append(f"  fits nearly as well: {', '.join(cause['instead'])}")
    return [*lines, f"  owner: {owner}"]


def _answers(alarm: str, decisions: Sequence[Decision]) -> list[str]:
    own = [d for d in decisions if d.alarm == alarm]
    if not own:
        return [f"  to answer: tango history decide {alarm} --action … --owner …"]
    until = {d: f" until {d.until}" if d.until else "" for d in own}
    return [f"  answered: {d.action}{until[d]} by {d.owner}, {d.utc[:10]}{f': {d.note}' if d.note else ''}" for d in own]


def _unmeasured(record: Mapping[str, Any], owner: str, failed: Sequence[Mapping[str, Any]]) -> list[str]:
    t = texts()
    if record["status"] == "refused":
        return [f"* what to do: {t('night.refused_do')}", f"* on a part: {t('night.refused_part')}", f"* owner: {owner}"]
    do = "" if any(p["do"] for p in failed) else f"* what to do: {t('night.unmeasured_do', cell=record['cell'])}"
    last = record.get("last_measured")
    known = t("night.unmeasured_part", date=last) if last else t("night.unmeasured_never")
    return [*([do] if do else []), f"* on a part: {known}", f"* owner: {owner}"]


def _sentence(text: str) -> str:
    """text → a capital in front and one full stop at the end."""
    whole = text[:1].upper() + text[1:]
    return whole if whole.endswith((".", "?", "!", "…")) else f"{whole}."
