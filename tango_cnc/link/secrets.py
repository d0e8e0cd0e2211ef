"""Words that nobody may read over a shoulder: where they come from, and what is shown in their place.

A password in a port's URL is named, not written: `password=env:NAME` is read from the environment, `password=file:PATH` from a
file that only its owner can read. A word that is written in the URL all the same is refused: machine.yaml is copied with the
cell, and everybody reads it. No word is ever shown: not in messages, the journal, readings.json or a transcript.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import unquote_plus

from ..files.checked import printable
from ..records import InputError

SECRET = ("password", "enable", "passphrase")  # settings of a URL
ALIKE = re.compile(r"^\s*enable\s*$|pass|pw|word|secret|token|kenn", re.IGNORECASE)  # somebody may have spelt one otherwise
HIDDEN = "***"
LONGEST = 4096  # bytes of a file with one password
OTHERS = stat.S_IRWXG | stat.S_IRWXO
NAMED = "env:NAME (a variable of the environment) or file:PATH (a file that only you can read)"
SETTING = re.compile(r"(?<=[?&])([^=&#]*)=(?!env:|file:)[^&#]*")
USER = re.compile(r"(?<=://)([^/?#:]*):([^/?#]*)@")


def shown(url: str) -> str:
    """port's URL → the same for people and files: no password in it."""

    def hidden(found: re.Match[str]) -> str:
        name = unquote_plus(found[1])  # a name may be coded: %70assword
        return f"{name}={HIDDEN}" if ALIKE.search(name) else found[0]

    return USER.sub(rf"\1:{HIDDEN}@", SETTING.sub(hidden, url))


def revealed(options: Mapping[str, str]) -> dict[str, str]:
    """{setting: value} of a URL → the same with the words that are named. Raises InputError for one that cannot be had."""
    return {name: secret(name, value) if name in SECRET else value for name, value in options.items()}


def named_only(url: str) -> None:
    """URL → nothing. Raises InputError, which does not show it, where a password stands before its host."""
    found = USER.search(url)
    if found is not None:
        secret("password", found[2] and "a word")


def secret(name: str, value: str) -> str:
    """setting, its value → the word ("" for none). Raises InputError, which does not show it."""
    kind, _, where = value.partition(":")
    if kind == "env":
        if "\0" in where or where not in os.environ:
            raise InputError(
                f"{name}: found env:{printable(where, 200)}, and the environment has no variable of this name; allowed: {NAMED}"
            )
        return os.environ[where]
    if kind == "file":
        return _filed(name, Path(where).expanduser())
    if value:
        raise InputError(
            f"{name}: a word stands in the address itself, where everybody who reads the cell sees it; allowed: {NAMED}. "
            "Put the word there, and change it at the control if others may have read it"
        )
    return ""


def _filed(name: str, file: Path) -> str:
    try:
        if file.exists() and not file.is_file():  # a pipe would be waited for
            raise InputError(f"{name}: found {file}; allowed: a file with one word in it")
        with file.open("rb") as opened:
            state = os.fstat(opened.fileno())
            if not stat.S_ISREG(state.st_mode) or state.st_size > LONGEST:
                raise InputError(f"{name}: found {file}; allowed: a file with one word in it")
            if os.name == "posix" and stat.S_IMODE(state.st_mode) & OTHERS:
                rights = f"{stat.S_IMODE(state.st_mode):03o}"
                raise InputError(f"{name}: {file} has the rights {rights}, so others can read it; do 'chmod 600 {file}'")
            text = opened.read(LONGEST).decode("utf-8")
    except (OSError, ValueError) as error:  # ValueError: a name that no file can have
        if isinstance(error, UnicodeDecodeError):
            raise InputError(f"{name}: {file} is not UTF-8 text") from None
        why = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{name}: {printable(str(file), 200)} cannot be read ({why}); allowed: {NAMED}") from None
    return text.strip("\r\n")


def without(data: bytes, words: tuple[str, ...]) -> bytes:
    """bytes of a conversation, secret words → the same without them."""
    for word in words:
        data = data.replace(word.encode(), HIDDEN.encode())
    return data
