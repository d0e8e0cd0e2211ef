"""A night in words: one sentence for a telephone, a message for a mailbox, and what each cause means."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ..report.texts import texts
from ..report.units import shown
from ..report.words import spoken

SUBJECT = {
    "good": "as it should be",
    "changed": "HAS CHANGED",
    "out_of_limits": "OUT OF LIMITS",
    "doubtful": "readings in doubt",
    "not_measured": "NOT MEASURED",
}
PLACE = re.compile(r"E([XYZ])0([XYZABCS])")


def cause_texts(cause: str, effect_um: float) -> tuple[str, str]:
    """cause, µm that it does at most → what it means for a part, what to do (texts of tango_cnc/report/texts/en.toml)."""
    t = texts()
    return t(f"cause.{cause}.on_part", effect=f"{effect_um:.1f} µm"), t(f"cause.{cause}.do")


def changed(parameter: str, size: str) -> str:
    """name of ISO 230-1 or a facet, size of its change → a sentence that names the axis before the symbol."""
    t = texts()
    plain = spoken(parameter)
    if plain == parameter:
        return t("changed.unnamed", name=parameter, size=size)
    if match := PLACE.fullmatch(parameter):
        what = t("parameter.spindle") if match[2] == "S" else t("parameter.axis", axis=match[2])
        return t("changed.off", what=what, letter=match[1], size=size, name=parameter)
    return t("changed.other", what=plain, size=size, name=parameter)


def value(number: float, unit: str, std: float | None = None) -> str:
    """number in mm, rad …, unit, standard deviation → '+19.8 ± 0.4 µm'."""
    factor, name = shown(unit)
    spread = "" if std is None else f" ± {std * factor:.1f}"
    return f"{number * factor:+.1f}{spread} {name}"


def headline(record: Mapping[str, Any]) -> str:
    """record of a night → one sentence."""
    if record["status"] == "missed":
        return f"no measurement: {record['why']}"
    if record["verdict"] == "not_measured":
        return f"not measured: {record['why']}"
    alarms = record["alarms"]
    if record["verdict"] == "doubtful":
        reasons = (record.get("plausible") or {}).get("reasons") or [record.get("why") or "see the report"]
        return f"the readings are not to be relied on: {reasons[0]}"
    if alarms:
        return str(alarms[0]["text"])
    beyond = [limit for limit in record["limits"] if limit["passed"] is False]
    if beyond:
        b = beyond[0]
        return f"{b['what']} is {b['value']:.1f} {b['unit']}, {b['limit']:g} {b['unit']} are allowed"
    part = f" (stopped after {record['touches']} of {record['planned']} touches)" if record["status"] == "partial" else ""
    open_ones = [limit for limit in record["limits"] if limit["passed"] is None]
    if open_ones:
        o = open_ones[0]
        return f"nothing has changed{part}; whether {o['what']} is within {o['limit']:g} {o['unit']} is not certain"
    volume = (record.get("volume") or {}).get("worst_um")
    told = "" if volume is None else f"; the largest error over the volume is {volume:.1f} µm"
    first = (record.get("change") or {}).get("p_value") is None
    return f"{'measured for the first time' if first else 'nothing has changed'}{part}{told}"


def message(record: Mapping[str, Any], trouble: Sequence[str], left: Sequence[str]) -> tuple[str, str]:
    """record, what went wrong while keeping it, what was found of earlier nights → subject and text of a message."""
    subject = f"{record['machine']}: {SUBJECT[record['verdict']]} ({record['night']})"
    lines = [record["headline"][:1].upper() + record["headline"][1:].rstrip(".") + ".", ""]
    for alarm in record["alarms"]:
        lines += [f"* {alarm['text']}", f"  since {alarm['since']}, {alarm['sigmas']:.0f} standard deviations"]
        if alarm.get("rate_per_day"):
            lines.append(f"  at {value(alarm['rate_per_day'], alarm['unit'])} a day")
        lines += [f"  on a part: {alarm['on_part']}", f"  what to do: {alarm['do']}"]
        if alarm["instead"]:
            lines.append(f"  fits nearly as well: {', '.join(alarm['instead'])}")
        lines += [
            f"  owner: {alarm['owner'] or 'none is stated in nightly.yaml'}",
            f"  to answer: tango history decide {alarm['id']} --action … --owner …",
            "",
        ]
    failed = [p for p in record["preflight"] if not p["passed"]]
    lines += [f"* {p['check']}: {p['found'].rstrip('.')}{'; ' + p['do'] if p['do'] else ''}. Nothing was moved." for p in failed]
    for limit in record["limits"]:
        word = {True: "within", False: "BEYOND", None: "not certain to be within"}[limit["passed"]]
        lines.append(f"* {limit['what']}: {limit['value']:.1f} {limit['unit']}, {word} {limit['limit']:g}")
    if (change := record.get("change")) is not None and change.get("p_value") is not None:
        lines.append(f"* {change['text']}; tonight's probability by chance: {change['p_value']:.2g}")
    if (asked := record.get("next")) is not None:
        lines.append(f"* next night: {asked['kind']} ({asked['why']})")
    lines += [f"* {text}" for text in (*left, *trouble)]
    kept = record["artefacts"]["folder"] if "artefacts" in record else ""
    lines += [
        "",
        f"{record['kind']} night, {record['touches']} of {record['planned']} touches, {record['machine_time_s'] / 60:.0f} min",
    ]
    lines += [f"cell {record['cell']}, files in {kept}"]
    return subject, "\n".join(lines) + "\n"
