"""The probe triggers differently along its axis than across it: `n_sz²`."""

from __future__ import annotations

from ..records import Machine
from ..touches import Touches
from . import Coefficient
from ._cause import Variants, early

TEXT = "the probe's pre-travel along its axis differs from that across"
SOURCE = "ISO 230-10:2022, 6.5 (3D probing error)"
FRAME = "spindle"
MISTAKEN = ("axis_location",)
SAYS = "the probe reads {size} {early} along its axis, against across it"
MEANING = "a matter of the probe, not of parts; heights and widths measured with it disagree by this"
ADVICE = "calibrate the probe on a sphere in every direction that is used, or keep the term"
REFINE: dict[str, str] = {}


def variants(touches: Touches) -> Variants:
    """touches → the one pattern."""
    yield {}


def cause(machine: Machine) -> list[Coefficient]:
    """machine → coefficient in mm."""
    return [early("pretravel_anisotropy", lambda t: t.spindle_normal[:, 2] ** 2)]
