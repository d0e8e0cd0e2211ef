"""Names of ISO 230-1 in words that a machinist uses."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..records import Machine
from ..texts import Said, say
from .texts import Texts, texts

PLACE = re.compile(r"E([XYZ])0([XYZABCS])")
_INTER = re.compile(r"E([XYZABC])0([XYZABCS])")
_POWER = re.compile(r"E([XYZABC])([XYZABCS])(\d)")
_BACK = re.compile(r"E([XYZABC])\1b")
_STYLUS = re.compile(r"E([XYZ])t")
WARMER = {  # sentences on tonight's temperature: the same of another night
    "changed.warmer": "changed.was_warmer",
    "changed.colder": "changed.was_colder",
    "night.sensors.warmer_do": "night.sensors.was_warmer_do",
    "night.sensors.colder_do": "night.sensors.was_colder_do",
}
ABOUT = {"A": "X", "B": "Y", "C": "Z"}


def named(name: str, t: Texts, machine: Machine | None = None) -> str:
    """cause or parameter that may be meant, texts, machine → its word, of an error of an axis with its symbol."""
    if f"cause_name.{name}" in t:
        return t(f"cause_name.{name}")
    kind, _, place = name.partition(" ")
    if f"followed.{kind}" in t:
        return t(f"followed.{kind}", name=place)
    word = spoken(name, machine, t)
    return t.of(name).replace("_", " ") if word == name else f"{word} ({name})"


def spoken(name: str, machine: Machine | None = None, t: Texts | None = None) -> str:
    """coefficient, machine (None: X Y Z are linear), texts → what it is; the name itself for one that is not geometry."""
    t = t or texts()
    linear = "XYZ" if machine is None else machine.linear
    if "-" in name:
        first, second = (part[1] for part in name.split("-"))
        return t("parameter.scale_against", a=first, b=second)
    if match := _INTER.fullmatch(name):
        letter, axis = match[1], match[2]
        what = t("parameter.spindle") if axis == "S" else t("parameter.axis", axis=axis)
        if letter in "XYZ":
            return t("parameter.off", what=what, letter=letter)
        key = "parameter.square" if axis in linear else "parameter.tilted"
        return t(key, what=what, about=ABOUT[letter])
    if match := _BACK.fullmatch(name):
        return t("parameter.backlash", axis=match[1])
    if match := _STYLUS.fullmatch(name):
        return t("parameter.stylus", letter=match[1])
    if match := _POWER.fullmatch(name):
        letter, axis, degree = match[1], match[2], int(match[3])
        part = t(f"parameter.degree_{degree}") if degree < 4 else t("parameter.degree_n", degree=degree)
        if letter == axis:
            return t("parameter.scale", axis=axis) if degree == 1 else t("parameter.positioning", axis=axis, part=part)
        if letter in "XYZ":
            key = "parameter.straightness" if axis in linear else "parameter.runout"
            return t(key, axis=axis, letter=letter, part=part)
        return t("parameter.motion_tilt", axis=axis, about=ABOUT[letter], part=part)
    return name


def subject(name: str, machine: Machine | None, t: Texts) -> str:
    """coefficient, machine, texts → what of the machine it is of, to be looked at: C axis, spindle; else what it is."""
    match = _INTER.fullmatch(name)
    if match is None:
        return spoken(name, machine, t)
    return t("parameter.spindle") if match[2] == "S" else t("parameter.axis", axis=match[2])


def moved(parameter: str, size: str, since: str, t: Texts | None = None, alike: Sequence[str] = ()) -> str:
    """name of ISO 230-1 or a facet, size of its change, since when, texts, locations that no touch tells from it → a sentence that
    names the axis before the symbol, and every other axis that may have moved in its place.
    """
    t = t or texts()
    plain = spoken(parameter, t=t)
    if plain == parameter:
        return t("changed.unnamed", name=parameter, size=size, since=since)
    what, told = who_moved(parameter, alike, t), {"size": size, "name": parameter, "since": since}
    if match := PLACE.fullmatch(parameter):
        return t("changed.off", what=what, letter=match[1], **told)
    return t("changed.other", what=what, **told)


def who_moved(parameter: str, alike: Sequence[str], t: Texts) -> str:
    """location of an axis or another error, locations that no touch tells from it, texts → the axis of a displacement, what else
    moved otherwise, and all that may have done so in its place.
    """
    if match := PLACE.fullmatch(parameter):
        return _either(_axes(match, alike, t), t)
    return _either([spoken(name, t=t) for name in (parameter, *alike)], t)


def _axes(first: re.Match[str], alike: Sequence[str], t: Texts) -> list[str]:
    """displacement of an axis, locations that no touch tells from it → the axes that may have moved the same way, the first one
    first, and tilts of those that are not among them.
    """
    same = [found[2] for name in alike if (found := PLACE.fullmatch(name)) and found[1] == first[1]]
    axes = list(dict.fromkeys((first[2], *same)))
    words = [t("parameter.spindle") if axis == "S" else t("parameter.axis", axis=axis) for axis in axes]
    return [*words, *(spoken(name, t=t) for name in alike if name[-1] not in axes)]


def _either(names: Sequence[str], t: Texts) -> str:
    """names → all of them as what may have moved; a single one as it is."""
    told = names[0]
    for name in names[1:]:
        told = t("changed.either", first=told, second=name)
    return t("changed.which", names=told) if len(names) > 1 else told


def unforeseen(text: str, night: str) -> str:
    """what an alarm said in its night, date of that night → the same to be read after later nights: without what it expected of
    them, which have come since, and a temperature with the night that measured it.
    """
    if not isinstance(text, Said):
        return text
    if text.key in ("changed.reaches", "changed.reaches_one"):
        return str(text.values["moved"])
    return of_its_night(text.but(**{k: unforeseen(v, night) for k, v in text.values.items() if isinstance(v, Said)}), night)


def of_its_night(text: str, night: str) -> str:
    """sentence, date of its night → the same to be read on another day, of what it says of the temperature."""
    if not isinstance(text, Said):
        return text
    inner = {name: of_its_night(value, night) for name, value in text.values.items() if isinstance(value, Said)}
    if text.key in WARMER:
        return say(WARMER[text.key], **{**text.values, **inner, "on": night})
    return text.but(**inner)
