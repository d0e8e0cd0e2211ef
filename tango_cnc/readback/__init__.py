"""Text of a program → refused, or proven to be the plan and to stop by itself when anything goes otherwise.

It reads what is in the text and knows nothing of the posts. One file or folder a language; each rehearses the program line
by line on a machine that does what the plan expects, and beside it on machines where something goes wrong: a move is stopped
short, a touch misses or comes early, a work offset changes, a rotary axis does not arrive. It refuses

- a line that is not on the language's short list, so that no word gets through that nobody thought of;
- a motion that is not the next one of the plan, or beyond a travel, or faster than stated;
- a motion near the table that nothing stops, and a rotary motion there;
- a program that goes on where a machine beside it has gone wrong, or records it as a touch.

What travels with a program (macros, scripts, masks) is read too, where the language knows these files.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from itertools import islice
from typing import Any

from ..gate import TOUCH
from ..records import InputError, Plan
from . import languages
from .language import Companions, Language, Lines

__all__ = ["Companions", "Language", "check", "language", "names", "recognized"]

HEAD = 200  # lines within which a program shows what it is


def names() -> list[str]:
    """→ the languages that are read back: the files and folders of `languages/`."""
    return list(_names())


@cache
def _names() -> tuple[str, ...]:
    return tuple(sorted(found.name for found in pkgutil.iter_modules(languages.__path__)))


def language(name: str) -> Language:
    """one of `names()` → how its programs are read back."""
    found: Language = importlib.import_module(f"{languages.__name__}.{name}").LANGUAGE
    return found


def recognized(lines: Lines) -> list[str]:
    """lines of a program → names of the languages that it may be written in, by its first lines."""
    head = list(islice(lines(), HEAD))
    return [name for name in names() if language(name).reads(head)]


def check(
    lines: Lines, plan: Plan, options: Mapping[str, Any], companions: Companions | None = None, *, written_in: str = ""
) -> tuple[str, ...]:
    """lines of a program, its plan, every option of its profile, what travels with it → what nobody here reads.

    `written_in`: the language that the post names. A post of the user's own that names none is read in the language that its
    program looks like. Raises InputError naming the line that must not reach a machine.
    """
    beside = companions or {}
    spoken = [written_in] if written_in else recognized(lines)[:1]
    if not spoken:
        return ("the program", *beside)
    if options.get("gate") == "finger" and not any(TOUCH in line for line in lines()):
        raise InputError(
            f"program: no line says {TOUCH}, and the slow move waits for somebody who does; allowed: "
            "the words before the move that proves the probe alive, or gate: facet, or gate: none under controller:"
        )
    known = language(spoken[0])
    known.rehearse(lines, plan, options, {name: text for name, text in beside.items() if known.companions.fullmatch(name)})
    return tuple(name for name in beside if not known.companions.fullmatch(name))
