"""Texts of the pages: those of the program, and over them those of a shop."""

from __future__ import annotations

import string
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from ..files.checked import printable, read_text
from ..records import InputError
from ..texts import Said, english, flat, say, translated


class Texts:
    """Sentences by key, e.g. `texts("fit.counts", touches=393)`.

    They remember their key and their numbers, so that a page may ask again.
    """

    def __init__(self, found: Mapping[str, str]) -> None:
        self._flat = found

    def __call__(self, key: str, /, **values: Any) -> str:
        """key, values → sentence. Raises KeyError for a key or a value that is missing: a mistake of the program or a template."""
        given, values = values, {name: self.of(value) if isinstance(value, str) else value for name, value in values.items()}
        text = self._flat[key].format_map(values) if values else self._flat[key]
        return Said(text, key, {n: v if isinstance(v, str) else str(v) for n, v in given.items()})

    def __contains__(self, key: str) -> bool:
        return key in self._flat

    @property
    def keys(self) -> tuple[str, ...]:
        """→ every key."""
        return tuple(self._flat)

    def of(self, text: Any, more: int = 0) -> str:
        """text of a record or a result, decimals beyond those that were said → the same in this language, if it has a key."""
        return translated(text, self._flat, more)

    def all(self, found: Any) -> Any:
        """record or list with texts in it → the same with every text in this language."""
        if isinstance(found, str):
            return self.of(found)
        if isinstance(found, Mapping):
            return {name: self.all(value) for name, value in found.items()}
        return [self.all(value) for value in found] if isinstance(found, list | tuple) else found


@cache
def texts() -> Texts:
    """→ the texts that come with the program; those of a cause of the diagnosis come from its file: `diagnosed.chip.meaning`."""
    from ..terms._texts import cause_texts

    return Texts({**english(), **{f"diagnosed.{k}": v for k, v in cause_texts().items()}})


def texts_of(folder: Path | None) -> Texts:
    """folder of a shop or None → its texts.toml over those of the program. Raises InputError for a file that cannot be used."""
    file = None if folder is None else folder / "texts.toml"
    if file is None or not file.exists():
        return texts()
    try:
        own = flat(tomllib.loads(read_text(file)))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{file}: {printable(str(error))}; allowed: TOML like texts/en.toml of the program") from None
    base = texts()
    for key, text in own.items():
        if key not in base:
            raise InputError(
                f"{file}: found the unknown key {printable(key, 80)!r}; allowed: the keys of texts/en.toml of the program"
            )
        wanted, found = _fields(base(key)), _fields(text)
        if found - wanted:
            strange = printable(sorted(found - wanted)[0], 80)
            raise InputError(f"{file}: {key}: found {{{strange}}}; allowed: {', '.join(sorted(wanted)) or 'none'}")
    return Texts({key: base(key) for key in base.keys} | own)


def _fields(text: str) -> set[str]:
    try:
        return {name for _, name, _, _ in string.Formatter().parse(text) if name}
    except ValueError as error:
        raise InputError(f"texts.toml: found {printable(text, 200)!r}; {error}; write {{{{ for a brace that is no name") from None


def code(word: str) -> str:
    """a word of a record (full, kept as far as seen …) → the same as a text that can be translated; an unknown one as it is."""
    key = f"code.{word.replace(' ', '_')}"
    return say(key) if key in texts() else word
