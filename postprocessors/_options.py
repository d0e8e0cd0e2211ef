"""Options of a post: what a profile may state, with what it means, and what it may not be."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from tango_cnc.nearest import printable
from tango_cnc.records import InputError

CODES = re.compile(r"[A-Z0-9 .\-]*")  # what an option may put into a program: words, no brackets, comments or line ends
MOST = 1000  # characters of a value: no word of a control, name of a file or list of G codes has a tenth of it
SHOWN = 200  # characters of a wrong value


@dataclass(frozen=True)
class Option:
    """A field of the control's profile: `controller:` keys of tango.yaml other than post, port and confirmed.

    An unverified default is printed into the program and by `tango plan` until the profile states the field itself.
    """

    name: str
    default: Any
    meaning: str
    verified: bool = False
    choices: tuple[Any, ...] = ()
    instead: str = ""  # a word that may stand in place of a value
    none: Any = None  # the value that the word none stands for
    must: bool = False  # nobody but the profile can say it: no program is written without
    codes: bool = False  # the text goes into the program as it stands
    also: str = ""  # a pattern of words that such a text may have besides, where a control writes one with other characters


PROVES = ("finger", "facet", "none")
GATE = Option("gate", "finger", "what proves the probe alive; a facet where nobody is there", True, PROVES)
PROBE_STATE = "probe_state"
UNSEEN = (
    "the program does not look at the input of the probe (probe_state): a move that begins with the stylus deflected ends only "
    "where the control itself ends it"
)
UNPROVEN = "nothing proves the probe alive before the first descent: a flat battery drives the stylus into the table"


OBEYS = Option(
    "feed_override",
    "ignored",
    "whether the feed override acts on measuring moves; acts: the program and tango run ask for 100 %",
    True,
    ("ignored", "acts"),
)
KEPT = Option(
    "records_file",
    "kept",
    "whether a program adds to the file of its records (kept) or begins it anew; anew: it has to be copied before the next one",
    True,
    ("kept", "anew"),
)


def answered(options: tuple[Option, ...], given: Mapping[str, Any]) -> None:
    """options of a post, `controller` keys → nothing. Raises InputError for a key that has to be stated, and is not."""
    for option in options:
        if option.must and option.name not in given:
            raise InputError(
                f"controller.{option.name}: found nothing; allowed: {option.meaning.partition(';')[0]}. State none where this "
                "control has no such variable: then the program does not see a stylus that is deflected before a move. "
                "docs/dialects.md says how to find the variable"
            )


def memory(most: int) -> Option:
    """kB → the option of posts whose control keeps programs in a small memory."""
    return Option("memory", most, "kB that a program may have; a longer one is split", True, instead="none")


def stated(option: Option, value: Any) -> Any:
    """option, value of its key → the value as posts take it. Raises InputError for one that it cannot have."""
    if option.instead and value == option.instead:
        return value
    if option.none is not None and value == "none":
        return option.none
    kind = type(option.default)
    if kind is str and isinstance(value, int) and str(value) in option.choices:
        value = str(value)  # 44 without quotes
    fits = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value, fits = float(value), True
    if not fits or (option.choices and value not in option.choices):
        words = {int: "a whole number", float: "a number", str: "a text", bool: "true or false", dict: "a mapping (key: value)"}
        allowed = ", ".join(str(c) for c in option.choices) or words.get(kind, kind.__name__)
        allowed += f", or {option.instead or 'none'}" * bool(option.instead or option.none is not None)
        raise InputError(f"controller.{option.name}: found {printable(repr(value), SHOWN)}; allowed: {allowed} ({option.meaning})")
    if len(repr(value)) > MOST:
        raise InputError(f"controller.{option.name}: found {printable(repr(value), SHOWN)}; allowed: at most {MOST} characters")
    if kind is float and not math.isfinite(value):
        raise InputError(f"controller.{option.name}: found {value!r}; allowed: a finite number")
    if option.codes and not CODES.fullmatch(re.sub(option.also, "", value) if option.also else value):
        raise InputError(f"controller.{option.name}: found {value!r}; allowed: capital letters, digits, blanks, points and signs")
    return value


def settled(options: tuple[Option, ...], *names: str) -> tuple[Option, ...]:
    """options of a family, names → the same; their defaults are known of this control. Raises TypeError for an unknown name."""
    _known(options, names)
    return tuple(replace(option, verified=True) if option.name in names else option for option in options)


def with_defaults(options: tuple[Option, ...], **defaults: Any) -> tuple[Option, ...]:
    """options of a family, name=value → the same with other defaults. Raises TypeError for an unknown name."""
    _known(options, defaults)
    return tuple(replace(option, default=defaults.get(option.name, option.default)) for option in options)


def _known(options: tuple[Option, ...], names: Iterable[str]) -> None:
    allowed = sorted(option.name for option in options)
    if unknown := [name for name in names if name not in allowed]:
        raise TypeError(
            f"options of this family: found {', '.join(unknown)}; allowed: {', '.join(allowed)}. What no profile may state, as "
            "the word that ends a program, is a field of the words of the family, not an option"
        )
