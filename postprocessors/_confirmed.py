"""`confirmed:` of the profile: the doubts of a post that its user has checked on the control, said with their own words.

A doubt is stated whole or by its beginning. Capitals, blanks and punctuation do not count, because the header of a program,
which is where most people read it, has lost them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from tango_cnc.nearest import nearest, printable
from tango_cnc.records import InputError

FEWEST = 12  # letters and digits of a beginning: fewer tell nobody what was checked, and may fit another doubt one day


def confirmed(stated: Any, doubts: Iterable[str], fields: Sequence[str]) -> tuple[str, ...]:
    """`controller.confirmed`, doubts of the post, its unverified options as they are listed → the doubts that are confirmed.

    Raises InputError for what is no list of texts, and for a text that begins no doubt, several, or one that is stated already.
    """
    if not isinstance(stated, list | tuple):
        found = "nothing" if stated is None else _shown(stated)
        raise InputError(
            f"controller.confirmed: found {found}; allowed: a list, one fact a line after '- ', as 'tango plan' says it; "
            "leave the key out where there is none"
        )
    known = tuple(dict.fromkeys(doubts))
    said: dict[str, str] = {}
    for place, entry in enumerate(stated, 1):
        text = _text(entry, place)
        doubt = _doubt(text, known, fields)
        if doubt in said:
            raise InputError(
                f"controller.confirmed: found {_shown(text)}, which is {_shown(said[doubt])} once more; allowed: each fact once; "
                "leave one of them out"
            )
        said[doubt] = text
    return tuple(said)


def _shown(value: Any) -> str:
    return printable(repr(value), 300)


def _text(entry: Any, place: int) -> str:
    """entry, which it is → its text; YAML makes a mapping of a fact with a colon in it, and nothing of what is behind a #."""
    if isinstance(entry, dict) and len(entry) == 1:
        (begin, rest), *_ = entry.items()
        if isinstance(rest, str | None):
            entry = f"{begin}: {rest or ''}".rstrip()
    if not isinstance(entry, str):
        found = "nothing" if entry is None else _shown(entry)
        raise InputError(
            f"controller.confirmed: found {found} in place {place}; allowed: texts; put it in quotes where there is a # in it"
        )
    return entry


def _doubt(text: str, doubts: Sequence[str], fields: Sequence[str]) -> str:
    """text of an entry → the one doubt that is meant."""
    sought, shown = _plain(text), _shown(text)
    whole = [doubt for doubt in doubts if doubt == text] or [doubt for doubt in doubts if sought and _plain(doubt) == sought]
    begun = whole or [doubt for doubt in doubts if sought and _plain(doubt).startswith(sought)]
    if len(begun) > 1:
        raise InputError(
            f"controller.confirmed: found {shown}, with which {len(begun)} facts begin; allowed: one; write more of it, "
            f"and a line for each of the others that you have checked:{_listed(begun)}"
        )
    if whole or (begun and len(sought) >= FEWEST):
        return begun[0]
    for field in fields:
        key = field.partition(" = ")[0]
        if sought.startswith(_plain(key)) and _plain(field).startswith(sought):
            raise InputError(
                f"controller.confirmed: found {shown}, which is a key of its own; allowed: facts that no key states; "
                f"write {key} with its value under controller:, which confirms it"
            )
    if not doubts:
        raise InputError(f"controller.confirmed: found {shown}; allowed: nothing, as this post has no doubts; leave the key out")
    raise InputError(
        f"controller.confirmed: found {shown}, which {'says too little' if begun else 'is no fact that this post leaves open'}; "
        f"allowed: a fact that 'tango plan' lists without a key, or its beginning of {FEWEST} letters and digits or more, in "
        f"quotes where there is a # in it{_meant(sought, doubts)}"
    )


def _meant(sought: str, doubts: Sequence[str]) -> str:
    """what was looked for → '. Did you mean …?', or all that there is."""
    if not sought:
        return f":{_listed(doubts)}"
    within = [doubt for doubt in doubts if sought in _plain(doubt)]
    heads = {_plain(doubt)[: len(sought)]: doubt for doubt in doubts}
    near = within[0] if len(within) == 1 else heads.get(nearest(sought, heads) or "")
    return f". Did you mean {near!r}?" if near else f":{_listed(doubts)}"


def _listed(doubts: Iterable[str]) -> str:
    return "".join(f"\n  {doubt}" for doubt in doubts)


def _plain(text: str) -> str:
    """text of a doubt, from wherever it was copied → what the header of a program keeps of it, without blanks and points."""
    return "".join(c for c in text.upper() if c.isascii() and c.isalnum()).removeprefix("UNVERIFIED")
