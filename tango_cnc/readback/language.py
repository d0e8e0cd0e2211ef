"""What a language of programs gives the read-back."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..records import Plan

Companions = Mapping[str, Sequence[str]]  # file name → lines, of what travels with a program
Lines = Callable[[], Iterator[str]]  # the lines of a program, from the first at each call


@dataclass(frozen=True)
class Language:
    """How the programs of one language are recognized and rehearsed.

    `rehearse` raises InputError naming the line that must not reach a machine. `companions` is the pattern of the names of
    the files beside a program that it reads too.
    """

    reads: Callable[[list[str]], bool]  # first lines of a program → whether it is written in this language
    rehearse: Callable[[Lines, Plan, Mapping[str, Any], Companions], None]
    companions: re.Pattern[str] = re.compile(r"(?!)")
