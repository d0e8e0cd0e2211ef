"""Names of ISO 230-1 in words that a machinist uses."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

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


def moved(
    parameter: str,
    size: str,
    since: str,
    t: Texts | None = None,
    alike: Sequence[str] = (),
    sizes: Mapping[str, str] | None = None,
) -> str:
    """name of ISO 230-1 or a facet, size of its change, since when, texts, locations that no touch tells from it, the own size of
    those that would have moved by another one → a sentence that names the axis before the symbol, and every other axis that may
    have moved in its place, with the sign that it would have moved with.
    """
    t = t or texts()
    plain = spoken(parameter, t=t)
    if plain == parameter:
        return t("changed.unnamed", name=parameter, size=size, since=since)
    what, others = who_moved(parameter, alike, t, sizes)
    told = {"size": size, "name": parameter, "since": since, "what": what} | ({"others": others} if others else {})
    by = "_by" if others else ""
    if match := PLACE.fullmatch(parameter):
        return t(f"changed.off{by}", letter=match[1], **told)
    return t(f"changed.other{by}", **told)


def who_moved(parameter: str, alike: Sequence[str], t: Texts, sizes: Mapping[str, str] | None = None) -> tuple[str, str]:
    """location of an axis or another error, locations that no touch tells from it, texts, sizes of those that would have moved by
    another one → the axis of a displacement, what else moved otherwise, and all that may have done so by the same size in its
    place; those that would have moved by another size, each with its own ('': none).
    """
    every = _named(parameter, alike, t)
    sizes = sizes or {}
    own = [word for name, word in every.items() if name not in sizes]
    if len(own) == len(every):
        return (t("changed.which", names=_either(own, t)) if len(own) > 1 else own[0]), ""
    return _either(own, t), t("changed.which", names=own_sizes({n: w for n, w in every.items() if n in sizes}, sizes, t))


def elsewhere(parameter: str, alike: Sequence[str], t: Texts, sizes: Mapping[str, str]) -> str:
    """parameter, locations that no touch tells from it, texts, own sizes of some of these → these with their sizes; '' for none."""
    every = {name: word for name, word in _named(parameter, alike, t).items() if name in sizes}
    return own_sizes(every, sizes, t) if every else ""


def own_sizes(words: Mapping[str, str], sizes: Mapping[str, str], t: Texts) -> str:
    """{location: its word}, one at least, {location: its size}, texts → all of them, each with its own size: A axis or C axis by
    +39.9 µm.
    """
    groups: dict[str, list[str]] = {}
    for name, word in words.items():
        groups.setdefault(sizes[name], []).append(word)
    told = [t("changed.by", what=_either(group, t), size=size) for size, group in groups.items()]
    return _either(told, t)


def unit_of(location: str) -> str:
    """location of an axis → mm of a displacement, rad of a tilt."""
    return "mm" if PLACE.fullmatch(location) else "rad"


def _named(parameter: str, alike: Sequence[str], t: Texts) -> dict[str, str]:
    """location of an axis or another error, locations that no touch tells from it → {location: its word}, itself first: of a
    displacement the axes that may have moved along the same letter, and what of other axes is not among them.
    """
    first = PLACE.fullmatch(parameter)
    if first is None:
        return {name: spoken(name, t=t) for name in (parameter, *alike)}
    same = [name for name in alike if (found := PLACE.fullmatch(name)) and found[1] == first[1]]
    axes = {name: name[-1] for name in (parameter, *same)}
    words = {name: t("parameter.spindle") if axis == "S" else t("parameter.axis", axis=axis) for name, axis in axes.items()}
    return words | {name: spoken(name, t=t) for name in alike if name[-1] not in axes.values()}


def _either(names: Sequence[str], t: Texts) -> str:
    """names → one or the other of them; a single one as it is."""
    told = names[0]
    for name in names[1:]:
        told = t("changed.either", first=told, second=name)
    return told


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
