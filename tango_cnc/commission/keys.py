"""What a proof depends on: a belief that was proven stays proven as long as this does not change.

A word of the control's profile counts for the beliefs that say so (`Experiment.rests`); one that says how long or how large
something is counts for none; one that nobody has thought of counts for all of them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from ..records import Machine
from .verdicts import experiments

HARMLESS = ("confirmed", "gate", "memory", "misses", "positioning_feed", "program_number", "show", "tolerance")


def keys(machine: Machine, post: str, code: str, options: Mapping[str, Any], port: str) -> dict[str, str]:
    """machine, name of the post, hash of its file where it is the user's own, every option with its value, port → {belief: key}.

    A key has 12 hexadecimal digits. It changes with what its belief depends on, and with nothing else.
    """
    known = {name for experiment in experiments() for name in experiment.rests}
    others = {name: value for name, value in options.items() if name not in known and name not in HARMLESS}
    found = {}
    for experiment in experiments():
        own = {name: options[name] for name in experiment.rests if name in options}
        parts = {
            "linear": [(axis.name, axis.direction) for axis in machine.axes if axis.kind == "linear"],
            "rotary": [(axis.name, axis.direction, *["nearer"] * axis.nearer) for axis in machine.axes if axis.kind == "rotary"],
            "points": [(axis.name, axis.point) for axis in machine.axes if axis.kind == "rotary"],
            "port": port,
            "overhead": machine.overhead or None,
        }
        on = [parts[part] for part in experiment.on if parts[part] is not None]
        text = json.dumps([post, code, others, own, on], sort_keys=True, default=str)
        found[experiment.belief] = hashlib.sha256(text.encode()).hexdigest()[:12].upper()
    return found
