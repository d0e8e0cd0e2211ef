"""The stylus was bent or pushed in its holder, and stays there: `n_s·a` from one touch on, with the normal in the spindle frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..records import Machine
from ..touches import Touches
from . import Cause, Coefficient, Shape
from ._cause import Variants, displaced, label, moments, onsets, since, times


def variants(touches: Touches) -> Variants:
    """touches → every moment."""
    yield from ({"at": at} for at in moments(touches))


def make(machine: Machine, at: float, direction: Sequence[float] | None = None) -> list[Coefficient]:
    """machine, first touch after it (its number in the readings) → displacement of surfaces in x y z of the spindle frame, mm."""
    return displaced(label("stylus_knock", int(at)), "spindle", since(at), direction)


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → steps of the stylus, without its name."""
    for after in onsets(touches, rows):
        yield "time", "spindle", "step", times(after, touches.spindle_normal)


TERM = Cause(
    text="the stylus was bent, or moved in its holder",
    source="change-point model; ISO 230-10:2022 clause 6: a tip that moves turns with the spindle, as its offset EXt EYt does",
    frame="spindle",
    mistaken=("step", "stylus_creep"),
    in_place_of="step",  # while the spindle stands as it mostly does, both read alike
    says="the stylus reads as if everything had moved {size} {towards} {moment}, {clock} after the start",
    meaning="a matter of the probe, not of parts; the touches before and after that moment are of two styli",
    advice="look at the stylus and its holder, qualify the probe, touch one facet at several angles of the spindle, measure again",
    refine={"at": "touch"},
    variants=variants,
    make=make,
    unnamed=unnamed,
)
