"""Reasons why readings are not believed → what a person at the machine looks at for each, and then measures again.

A reason remembers the key of its sentence (`tango_cnc/texts`); `look.<key>` says what to look at. One without such a text, or of a
record that knows no keys, sends people to what moves or sticks most often.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from ..texts import Said
from .texts import Texts

GOES_ON = "look.night.broken.broke_off"  # of a program that the control may go on with
MOST = 3  # things to look at: the first reasons say most


def looks(reasons: Sequence[Any], t: Texts) -> list[str]:
    """reasons of a record, texts → what to look at, each once, in the order of the reasons; at least one."""
    found = [next((t(key) for key in keys(r) if key in t), "") for r in reasons]
    told = list(dict.fromkeys(x for x in found if x))[:MOST]
    return told or [t("look.other")]


def may_move(reasons: Sequence[Any], t: Texts) -> list[str]:
    """reasons of a record, texts → to look at the machine first, where a program broke off that the control may go on
    with; else [].
    """
    return [t(GOES_ON)] if any(key == GOES_ON for r in reasons for key in keys(r)) else []


def orders(reasons: Sequence[Any], t: Texts) -> str:
    """reasons of a record, texts → what to look at and what then, as one text."""
    return " ".join([*looks(reasons, t), t("night.doubtful_do")])


def keys(text: Any) -> Iterator[str]:
    """reason → keys that say what to look at: its own, then those of the sentences that were filled into it."""
    if isinstance(text, Said):
        yield f"look.{text.key}"
        for value in text.values.values():
            yield from keys(value)
