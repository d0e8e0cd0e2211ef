"""The probe triggers differently along its axis than across it: `n_sz²`."""

from __future__ import annotations

from ..records import Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, early


def variants(touches: Touches) -> Variants:
    """touches → the one pattern."""
    yield {}


def make(machine: Machine) -> list[Coefficient]:
    """machine → coefficient in mm."""
    return [early("pretravel_anisotropy", lambda t: t.spindle_normal[:, 2] ** 2)]


TERM = Cause(
    text="the probe's pre-travel along its axis differs from that across",
    source="ISO 230-10:2022, 6.5 (3D probing error)",
    frame="spindle",
    mistaken=("axis_location",),
    says="the probe reads {size} {early} along its axis, against across it",
    meaning="a matter of the probe, not of parts; heights and widths measured with it disagree by this",
    advice="calibrate the probe on a sphere in every direction that is used, or keep the term",
    refine={},
    variants=variants,
    over="probe",
    make=make,
)
