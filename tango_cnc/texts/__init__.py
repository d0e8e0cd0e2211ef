"""Every text for people in one file a language: key → sentence with its numbers filled in.

A sentence remembers how it was made (`Said`): the command line prints it, a page looks its key up in the language of the shop, and
the record of a night carries keys and numbers beside the English text, so that yesterday's night can be read in any language.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib import resources
from typing import Any

from .number import EXACT, Number, again, kept, rounded_from, sizes

LANGUAGE = "en"
LIST = "list"  # key of several texts with something between them
MEMBER = "said"  # of a record: {text: [key, {name: value}]}
AT = "@"  # before the place of a text whose words another one has, too: {"@standing.1.text": [key, {name: value}]}
SAYING = ("alarms", "standing", "ignored", "unheard", "gone", "repaired", "behind", "trend")  # members with sizes and sentences
SIZED = (*SAYING, "limits", "volume")
PLAIN = frozenset({float, int, bool, type(None)})  # most of what a record holds: asked first, no abstract class is as quick


class Said(str):
    """A text of the catalogue in English, with its key and what was filled in; a `str` like any other for who does not ask."""

    key: str
    values: Mapping[str, Any]

    def __new__(cls, text: str, key: str, values: Mapping[str, Any]) -> Said:
        """text, its key, what was filled in → the text that remembers them."""
        made = super().__new__(cls, text)
        made.key, made.values = key, dict(values)
        return made

    def __str__(self) -> str:
        """→ itself: what it is made of is not lost by str()."""
        return self

    def __reduce__(self) -> tuple[type, tuple[str, str, Mapping[str, Any]]]:
        """→ how to make it again in another process."""
        return Said, (self[:], self.key, self.values)

    def but(self, **values: Any) -> Said:
        """other values → the same text with these."""
        found = {**self.values, **values}
        return joined(found.pop("between"), found.values()) if self.key == LIST else say(self.key, **found)


def flat(tree: Mapping[str, Any], before: str = "") -> dict[str, str]:
    """tables of TOML → {"table.key": text}."""
    found: dict[str, str] = {}
    for name, value in tree.items():
        if isinstance(value, Mapping):
            found |= flat(value, f"{before}{name}.")
        else:
            found[f"{before}{name}"] = str(value)
    return found


@cache
def english() -> Mapping[str, str]:
    """→ the texts of the program."""
    file = resources.files(__package__) / f"{LANGUAGE}.toml"
    return flat(tomllib.loads(file.read_text(encoding="utf-8")))


def say(key: str, /, **values: Any) -> Said:
    """key, values → the sentence in English. Raises KeyError for a key or a value that is missing: a mistake of the program."""
    text = english()[key]
    values = {name: value if isinstance(value, str) else str(value) for name, value in values.items()}
    return Said(text.format_map(values) if values else text, key, values)


def joined(between: str, texts: Iterable[Any]) -> Said:
    """what stands between, texts → all of them in one; a page translates each. Empty ones are left out."""
    parts = [x for x in texts if x]
    return Said(between.join(parts), LIST, {"between": between, **{f"{i}": x for i, x in enumerate(parts)}})


def unstopped(text: str) -> str:
    """text → the same without a full stop at its end."""
    if isinstance(text, Said) and text.key == LIST:
        values = dict(text.values)
        between, parts = values.pop("between"), list(values.values())
        return joined(between, parts[:-1] if parts[-1] == "." else parts)
    return text.rstrip(".") if text.endswith(".") else text


def instead(text: str, old: str, new: str) -> str:
    """text, a value that was filled in, another → the text with that; of a text without a key, what follows the word since.

    A `night` stays: tonight is compared with it, and the change may have another date. So does the `date` of what an `owner` did,
    and of a compensation for a `target`.
    """
    if not isinstance(text, Said):
        return text.replace(f"since {old}", f"since {new}")
    own = ("night", "date") if "owner" in text.values or "target" in text.values else ("night",)
    told = {name: v for name, v in text.values.items() if isinstance(v, str) and not isinstance(v, Number) and name not in own}
    return text.but(**{name: new if v == old else instead(v, old, new) for name, v in told.items()})


def translated(text: Any, texts: Mapping[str, str], more: int = 0) -> str:
    """text, texts of a language by key, decimals beyond those that were said → the same in that language; what has no key stays as
    it is.
    """
    if not isinstance(text, Said):
        return text.more(more) if isinstance(text, Number) else f"{text}"
    values = {name: translated(x, texts, more) if isinstance(x, Said | Number) else x for name, x in text.values.items()}
    if text.key == LIST:
        return str(values.pop("between")).join(str(x) for x in values.values())
    if text.key not in texts:
        return text[:]
    return texts[text.key].format_map(values) if values else texts[text.key]


def _texts(found: Any, place: str = "") -> Iterator[tuple[str, Said]]:
    if isinstance(found, Said):
        if (same := next((v for v in found.values.values() if isinstance(v, Said) and v[:] == found[:]), None)) is not None:
            yield from _texts(same, place)  # what adds no word to a text is that text
            return
        yield place, found
        inside: Iterable[tuple[Any, Any]] = found.values.items()
    elif isinstance(found, dict | Mapping):
        inside = found.items()
    elif isinstance(found, list | tuple):
        inside = enumerate(found)
    else:
        return
    for name, value in inside:
        if type(value) not in PLAIN and type(value) is not str:
            yield from _texts(value, f"{place}.{name}" if place else str(name))


def carried(record: Mapping[str, Any]) -> dict[str, Any]:
    """record with texts in it → the same with the keys and values of its texts as one more member, plain enough for JSON.

    Two numbers may be rounded to the same words: a text whose words stand for another number before it has its place beside it.
    """
    said: dict[str, Any] = {}
    for place, text in _texts(record):
        own = [text.key, kept(text.values)]
        if said.setdefault(text[:], own) != own:
            said[f"{AT}{place}"] = own
    return {**record, MEMBER: said} if said else dict(record)


def revived(record: Mapping[str, Any]) -> Mapping[str, Any]:
    """record that was read → its texts know their keys and values again; a record without them is left as it is."""
    said = record.get(MEMBER)
    if not isinstance(said, Mapping) or not said:
        return record
    alike = any(key.startswith(AT) for key in said)  # some texts are known by their places: those of one wording are made anew
    made: dict[str, Any] = {}

    def told(found: Any, place: str) -> Any:
        if isinstance(found, str):
            if found not in said:
                return found
            if found not in made:
                made[found] = found  # what contains itself is no text of this program
                key, values = said.get(f"{AT}{place}", said[found])
                inside = {n: v if isinstance(v, Number) else told(v, f"{place}.{n}") for n, v in again(values).items()}
                made[found] = Said(found, str(key), inside)
            return made.pop(found) if alike else made[found]
        if isinstance(found, dict | Mapping):
            return {name: value if type(value) in PLAIN else told(value, f"{place}.{name}") for name, value in found.items()}
        return [told(value, f"{place}.{i}") for i, value in enumerate(found)] if isinstance(found, list) else found

    whole = {name: value if name == MEMBER else told(value, str(name)) for name, value in record.items()}
    return whole if any(EXACT in name for _, values in said.values() for name in values) else _with_numbers(whole)


def _with_numbers(record: Mapping[str, Any]) -> dict[str, Any]:
    """record that has its sentences with rounded numbers alone, as they were recorded up to November 2026 → the same; a number that
    the record has beside its sentence is what that was rounded from.
    """
    found, every = dict(record), dict[str, list[float]]()
    for name in SIZED:
        own = record.get(name)
        inside = [x for x in (own if isinstance(own, list) else [own]) if isinstance(x, Mapping)]
        for a in inside:
            for size, unit in sizes(a):
                every.setdefault(unit, []).append(size)
        if inside and name in SAYING:
            told = [_filled_in(a) for a in inside]
            found[name] = told if isinstance(own, list) else told[0]
    return found | {"headline": _exactly(record.get("headline"), every)}


def _filled_in(a: Mapping[str, Any]) -> dict[str, Any]:
    """alarm or trend of a record → the same, whose sentences know what its sizes were rounded from."""
    known = dict[str, list[float]]()
    for size, unit in sizes(a):
        known.setdefault(unit, []).append(size)
    return {name: _exactly(x, known) if isinstance(x, Said) else x for name, x in a.items()}


def _exactly(text: Any, known: Mapping[str, list[float]], unit: str = "") -> Any:
    """text, {unit: sizes}, unit of a number that has none → the text whose numbers know what they were rounded from."""
    if isinstance(text, Number) or not isinstance(text, str):
        return text
    if not isinstance(text, Said):
        return rounded_from(text, known, unit)
    own = str(text.values.get("unit") or "µm")  # the largest error is in µm
    values = {n: _exactly(v, known, own if n in ("value", "volume") else "") for n, v in text.values.items()}
    return Said(text[:], text.key, values)
