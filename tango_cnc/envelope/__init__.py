"""Text of a program → refused, or proven to be the plan and to stop by itself when anything goes otherwise.

It reads what stands in the text and knows nothing of the posts. One file a family of dialects; each rehearses the program line
by line on a machine that does what the plan expects, and beside it on machines where something goes wrong: a move is stopped
short, a touch misses or comes early, a work offset changes, a rotary axis does not arrive. Refused is

- a line that is no line of the family's short list, so that no word gets through that nobody thought of;
- a motion that is not the next one of the plan, or beyond a travel, or faster than stated;
- a motion near the table that nothing stops, and a rotary motion there;
- a program that goes on where a machine beside it has gone wrong, or records it as a touch.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from typing import Any

from ..records import Plan

HEAD = 200  # lines within which a program shows what it is


def check(lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any]) -> bool:
    """lines of a program (anew at each call), its plan, every option of its profile → whether a family here reads its dialect.

    Raises InputError naming the line that must not reach a machine.
    """
    head = list(islice(lines(), HEAD))
    for found in pkgutil.iter_modules(__path__):
        if not found.name.startswith("_"):
            family = importlib.import_module(f"{__name__}.{found.name}")
            if family.reads(head):
                family.rehearse(lines, plan, options)
                return True
    return False
