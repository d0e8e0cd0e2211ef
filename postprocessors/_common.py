"""What most posts have in common: options that fit the machine, the words for a probe's switch, the closing table of steps."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from tango_cnc.records import InputError

from ._base import Job, Whole

SWITCH = re.compile(r"[GHM]\d{1,4}( [PQ]\d{1,4})?")  # M10, M64 P1: nothing that moves an axis
MORE_THAN_0 = ("positioning_feed", "tolerance", "misses", "orient_time")
STEPS = ("begin", "probe_on", "retract", "clear", "index", "approach", "probe", "back", "record", "probe_off", "end")


def steps(here: Mapping[str, Any]) -> dict[str, Any]:
    """globals() of a post → {step: the function named after it}; one that is missing is missed by `Post`."""
    return {name: here[name] for name in STEPS if name in here}


def switches(comment: str) -> tuple[Whole, Whole]:
    """form of a comment such as '(%s)' → the steps probe_on and probe_off: words of the profile, or a remark for want of them."""

    def step(word: str) -> Whole:
        def words(job: Job) -> Iterator[str]:
            """The words of the profile, if there are any."""
            yield job.options[f"probe_{word}"] or comment % f"NO WORDS STATED THAT SWITCH THE PROBE {word.upper()}"

        return words

    return step("on"), step("off")


def fits(job: Job, most: int = 9) -> None:
    """job, highest axis number → nothing. Raises InputError for options of many posts that do not fit the machine or the plan.

    Looks at those that the post has: feeds and counts, `axis_numbers`, `clamp` and `unclamp`, `orient`.
    """
    options = job.options
    numbers = [name for name in MORE_THAN_0 if name in options]
    if any(options[name] <= 0 for name in numbers):
        raise InputError(f"controller: found {' or '.join(numbers)} of 0 or less; allowed: more than 0")
    if "axis_numbers" in options:
        _axis_numbers(job, most)
    for key in ("unclamp", "clamp"):
        for name, word in options.get(key, {}).items():
            if name not in job.machine.rotary or not (isinstance(word, str) and SWITCH.fullmatch(word)):
                allowed = f"a word such as M10 for {', '.join(job.machine.rotary) or 'a rotary axis, of which there is none'}"
                raise InputError(f"controller.{key}: found {name!r}: {word!r}; allowed: {allowed}")
    turns = {round(touch.standoff[job.machine.column("S")], 9) for touch in job.plan.touches}
    if not options.get("orient", True) and len(turns) > 1:
        wanted = "true" if options["orient"] is False else "the word that orients the spindle"
        raise InputError(
            f"controller.orient: found {options['orient'] or 'nothing'}; allowed: {wanted}, as this strategy turns the spindle"
        )


def _axis_numbers(job: Job, most: int) -> None:
    names, stated = [name for name in job.machine.names if name != "S"], job.options["axis_numbers"]
    given = list(stated.values())
    whole = all(isinstance(n, int) and not isinstance(n, bool) and 1 <= n <= most for n in given)
    if stated and not (sorted(stated, key=str) == sorted(names) and whole and len(set(given)) == len(given)):
        raise InputError(
            f"controller.axis_numbers: found {stated!r}; allowed: a number 1 … {most} of its own for each of {', '.join(names)}"
        )
