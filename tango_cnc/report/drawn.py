"""What the pictures of a chosen plan are drawn from."""

from __future__ import annotations

from dataclasses import dataclass

from ..records import Array


@dataclass(frozen=True)
class Drawn:
    """What is drawn: curves against time, touches by rotary axes, standard deviations in the volume."""

    minutes: Array  # (k,)
    values: Array  # (k,) what the goal asks for, when broken off there
    label: str  # of these values, with their unit
    angles: Array  # (m, 2) deg, of each indexation
    axes: tuple[str, ...]  # letters of these
    touches: Array  # (m,) at each indexation
    place: Array  # (v, 3) mm, tool tip in the table frame
    std: Array  # (v,) µm, in its most uncertain direction
