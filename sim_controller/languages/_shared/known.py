"""Which controls speak a language, and what each of them is where nobody states it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class StandIn:
    """One control by its name: fields of its profile as `--set` takes them, lines of programs that it has stored."""

    settings: Mapping[str, str] = field(default_factory=dict)
    stored: tuple[str, ...] = ()


@dataclass(frozen=True)
class Controls:
    """What a language file says of the controls that speak it."""

    named: Mapping[str, StandIn]
    wired: Mapping[str, str] = field(default_factory=dict)  # key of a profile that says how the probe is wired → field of `Profile`
    # option of a post → fields of `Profile`: a control states one of them where its post has another default of that option
    shown_by: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    beside: re.Pattern[str] = re.compile(r"(?!)")  # names of files that have to be on the control besides the program
