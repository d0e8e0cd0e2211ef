"""What may change on a machine from one night to the next: the names of alarms on record, and what is special about each."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ChangeKind:
    """A kind of change that an alarm names."""

    of_the_probe: bool = False  # no error of a part: the probe, its stylus or the artefact
    entered: bool = False  # its cure is a number in the control
    blurred: bool = False  # a machine on the move while it is measured looks like it
    scatters: bool = False  # single touches scatter: no direction, no way back of its own; the first sound night ends it
    family: tuple[str, ...] = ()  # of what is followed (`state.frame`): what moves there is this


CHANGES = {
    "axis_location": ChangeKind(entered=True, family=("location", "angle")),
    "scale": ChangeKind(entered=True, family=("gain",)),
    "scales": ChangeKind(entered=True, blurred=True),
    "backlash": ChangeKind(entered=True, family=("backlash",)),
    "stylus": ChangeKind(of_the_probe=True),
    "pretravel": ChangeKind(of_the_probe=True),
    "facet": ChangeKind(of_the_probe=True),
    "ball": ChangeKind(),
    "table": ChangeKind(),
    "temperature": ChangeKind(),
    "noise_level": ChangeKind(of_the_probe=True, blurred=True, scatters=True),
    "unknown": ChangeKind(blurred=True),
}
OF_FAMILY = {family: name for name, change in CHANGES.items() for family in change.family}


def change_of(parameter: str, family: str) -> str:
    """parameter of the machine, its family of what is followed → what an alarm calls it when it has changed."""
    return OF_FAMILY["backlash" if parameter.endswith("b") else family]


def change(name: object) -> ChangeKind:
    """cause of an alarm on record → what is special about it; nothing for one that this version does not know."""
    return CHANGES.get(str(name).replace(" ", "_"), ChangeKind())
