"""Text of a program → refused, or proven to be the plan and to stop by itself when anything goes otherwise.

It reads what stands in the text and knows nothing of the posts. One file a family of dialects; each rehearses the program line
by line on a machine that does what the plan expects, and beside it on machines where something goes wrong: a move is stopped
short, a touch misses or comes early, a work offset changes, a rotary axis does not arrive. Refused is

- a line that is no line of the family's short list, so that no word gets through that nobody thought of;
- a motion that is not the next one of the plan, or beyond a travel, or faster than stated;
- a motion near the table that nothing stops, and a rotary motion there;
- a program that goes on where a machine beside it has gone wrong, or records it as a touch.

What travels with a program (macros, scripts, masks) is read too, by the families that have a pattern `COMPANIONS` of its names.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from typing import Any

from ..records import Plan
from ._reading import Companions

HEAD = 200  # lines within which a program shows what it is
NONE = re.compile(r"(?!)")


def check(
    lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any], companions: Companions | None = None
) -> tuple[str, ...]:
    """lines of a program (anew at each call), its plan, every option of its profile, what travels with it → what nobody here reads.

    Raises InputError naming the line that must not reach a machine.
    """
    head, beside = list(islice(lines(), HEAD)), companions or {}
    for found in pkgutil.iter_modules(__path__):
        if not found.name.startswith("_"):
            family = importlib.import_module(f"{__name__}.{found.name}")
            if family.reads(head):
                known = getattr(family, "COMPANIONS", NONE)
                family.rehearse(lines, plan, options, {name: text for name, text in beside.items() if known.fullmatch(name)})
                return tuple(name for name in beside if not known.fullmatch(name))
    return ("the program", *beside)
