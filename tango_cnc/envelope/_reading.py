"""What every family does alike: it reads a program line by line, and takes from the profile what the program may have in it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol

from ..records import InputError, Plan
from ._rehearsal import at_line, numbered


class Program(Protocol):
    """A program as far as it has been read."""

    over: bool  # its end has been read

    def line(self, line: str) -> None:
        """One line. Raises InputError when it must not reach a machine."""

    def finish(self) -> None:
        """Raises InputError when the program has stopped too soon."""


def read_through(lines: Callable[[], Iterator[str]], begin: Callable[[], Program], tail: bool = False) -> None:
    """lines of a program, what begins to read it → nothing. Raises InputError naming the line that must not reach a machine.

    `tail`: behind the end stand macros or stops, which `begin` has read.
    """
    at = 0, ""
    try:
        program = begin()
        for at in numbered(lines()):
            if tail and program.over:
                break
            program.line(at[1])
        program.finish()
    except InputError as error:
        raise at_line(*at, error) from None


def stated_words(options: Mapping[str, Any]) -> set[str]:
    """options of a profile → the words that it wants in the program: the switches of the probe, clamps of rotary axes."""
    switches = {text for key in ("probe_on", "probe_off") if (text := options.get(key))}
    return switches | {word for key in ("clamp", "unclamp") for word in options.get(key, {}).values()}


def axes_by_number(plan: Plan, options: Mapping[str, Any]) -> dict[int, str]:
    """plan, options of its profile → {number in the system variables: axis letter}, in the order of the machine unless stated."""
    names = [axis.name for axis in plan.machine.axes if axis.kind != "spindle"]
    stated = options.get("axis_numbers") or {name: i for i, name in enumerate(names, 1)}
    return {int(number): name for name, number in stated.items()}
