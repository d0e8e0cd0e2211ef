"""A written program: what the post made of a plan, and what of it was read back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from ..records import Plan


@dataclass(frozen=True)
class Program:
    """One program of a plan; `lines` begins anew at each call."""

    name: str  # of its file, without folder
    mark: str  # hash of its text, in its header and start record
    lines: Callable[[], Iterator[str]]
    plan: Plan  # of its touches: the whole plan, or a part of it
    letters: tuple[str, ...]  # axis letters of its records
    summed: bool = True  # whether its records end with K, the sum of the coordinates
    part: tuple[int, int] = (1, 1)  # which, of how many programs of the whole plan
    unread: tuple[str, ...] = ()  # what of it nobody has read back, in sentences
    file: str = ""  # that it was written to, or came from
    beside: tuple[str, ...] = ()  # files in the same folder that have to be on the control, too

    @property
    def text(self) -> str:
        """→ the whole program as it is sent."""
        return "".join(line + "\n" for line in self.lines())


def beside_of(program: Program) -> str:
    """program with files beside it → a sentence on them, as no link puts them at the control."""
    them = "them" if len(program.beside) > 1 else "it"
    where = Path(program.file).parent
    return f"{', '.join(program.beside)} in {where}: the control needs {them} too, once; docs/dialects.md says where"
