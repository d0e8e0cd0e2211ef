"""An axis location (inter-axis) error that the fitted set lacks."""

from __future__ import annotations

from ..records import InputError, Machine
from ..touches import Touches
from . import Cause, Coefficient, inter_axis
from ._cause import Variants


def variants(touches: Touches) -> Variants:
    """touches → every inter-axis error of the machine."""
    for c in inter_axis.coefficients(touches.machine, 1):
        yield {"name": c.name}


def make(machine: Machine, name: str) -> list[Coefficient]:
    """machine, name such as EX0C → that coefficient. Raises InputError for a name that the machine lacks."""
    found = inter_axis.coefficient(name, machine)
    if found is None:
        raise InputError(f"terms: axis_location: name: found {name!r}; allowed: EX0C … for axes {' '.join(machine.names)}")
    return [found]


TERM = Cause(
    text="an axis stands in the wrong place or at the wrong angle",
    source="ISO 230-1:2012, 3.9.4; thesis eq. 4-5",
    frame="axis",
    mistaken=("encoder_harmonic",),
    says="the model lacks {name}; the touch that feels it most is off by {size}",
    meaning="every five-axis part is off by this wherever that axis takes part",
    advice="put the coefficient into the terms of the model and compensate it",
    refine={},
    variants=variants,
    make=make,
)
