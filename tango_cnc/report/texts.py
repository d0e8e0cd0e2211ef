"""Texts of the pages, all in one file a language: key → sentence with its numbers filled in."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from ..files.checked import printable, read_text
from ..records import InputError

LANGUAGE = "en"


class Texts:
    """Sentences by key, e.g. `texts("fit.counts", touches=393)`."""

    def __init__(self, flat: Mapping[str, str]) -> None:
        self._flat = flat

    def __call__(self, key: str, /, **values: Any) -> str:
        """key, values → sentence. Raises KeyError for a key or a value that is missing: a mistake of the program or a template."""
        return self._flat[key].format_map(values) if values else self._flat[key]

    def __contains__(self, key: str) -> bool:
        return key in self._flat

    @property
    def keys(self) -> tuple[str, ...]:
        """→ every key."""
        return tuple(self._flat)


def _flat(tree: Mapping[str, Any], before: str = "") -> dict[str, str]:
    found: dict[str, str] = {}
    for name, value in tree.items():
        if isinstance(value, Mapping):
            found |= _flat(value, f"{before}{name}.")
        else:
            found[f"{before}{name}"] = str(value)
    return found


@cache
def texts() -> Texts:
    """→ the texts that come with the program; those of a cause of the diagnosis come from its file: `diagnosed.chip.meaning`."""
    from ..diagnose.sentences import cause_texts

    file = resources.files(__package__) / "texts" / f"{LANGUAGE}.toml"
    return Texts(_flat(tomllib.loads(file.read_text(encoding="utf-8"))) | {f"diagnosed.{k}": v for k, v in cause_texts().items()})


def texts_of(folder: Path | None) -> Texts:
    """folder of a shop or None → its texts.toml over those of the program. Raises InputError for a file that cannot be used."""
    file = None if folder is None else folder / "texts.toml"
    if file is None or not file.exists():
        return texts()
    try:
        own = _flat(tomllib.loads(read_text(file)))
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
    import string

    try:
        return {name for _, name, _, _ in string.Formatter().parse(text) if name}
    except ValueError as error:
        raise InputError(f"texts.toml: found {printable(text, 200)!r}; {error}; write {{{{ for a brace that is no name") from None
