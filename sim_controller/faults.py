"""What may go wrong in a session, on purpose and at a known touch: `--fault NAME=TOUCH`."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from tango_cnc.records import InputError

KINDS: Mapping[str, str] = {
    "stop-after": "the control falls silent in the middle of the program after that many touches (power cut)",
    "probe-stuck-after": "the probe signal stays on after that many touches",
    "alarm-after": "the machine raises an alarm after that many touches (servo, door, lubrication)",
}


@dataclass(frozen=True)
class Faults:
    """Fault name → number of touches after which it happens."""

    after: Mapping[str, int] = field(default_factory=dict)

    def after_touch(self, touch: int) -> str | None:
        """touches made so far → 'stuck', 'silence', 'alarm' or None."""
        if self.after.get("stop-after") == touch:
            return "silence"
        if self.after.get("alarm-after") == touch:
            return "alarm"
        return "stuck" if self.after.get("probe-stuck-after") == touch else None


def faults(texts: Iterable[str]) -> Faults:
    """['stop-after=40', …] → faults. Raises InputError for an unknown name or no whole number."""
    after: dict[str, int] = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in KINDS:
            near = difflib.get_close_matches(name, KINDS, n=1)
            hint = f" Did you mean {near[0]!r}?" if near else ""
            raise InputError(f"--fault: found {name!r}; allowed: {', '.join(f'{k}=N' for k in KINDS)}.{hint}")
        if not value.isdecimal() or int(value) < 1:
            raise InputError(f"--fault {name}: found {value!r}; allowed: a whole number of touches from 1, e.g. {name}=40")
        after[name] = int(value)
    return Faults(after)
