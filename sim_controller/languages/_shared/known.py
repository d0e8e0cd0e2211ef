"""What a language file says of all controls that speak it; those that have a name are files of `sim_controller/controls/`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Shown:
    """What a control is where its post has another default of an option than its relatives: fields of `Profile`, one of them."""

    fields: tuple[str, ...]
    look: str  # where the manual of such a control says what it is


ORIENT = Shown(("orient",), "orientation of the spindle: the letter of the angle behind M19")


@dataclass(frozen=True)
class Controls:
    """What a language file says of the controls that speak it."""

    wired: Mapping[str, str] = field(default_factory=dict)  # key of a profile that says how the probe is wired → field of `Profile`
    shown_by: Mapping[str, Shown] = field(default_factory=dict)  # option of a post → what a control states beside it
    beside: re.Pattern[str] = re.compile(r"(?!)")  # names of files that have to be on the control besides the program
