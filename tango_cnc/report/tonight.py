"""An alarm of another night as it is tonight: gone again, or how far it has come, and what that does to parts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..texts import Said
from ..texts.number import number

LENGTHS = ("stylus", "table", "ball")  # causes whose size is a length in space
WARMED = ("scale", "scales", "temperature")  # causes that no clamp and no bearing explains
AS_FOUND = 0.25  # share of its size by which an alarm may have grown and still be what its night found
LEAST = 0.05  # share that is nothing in any case
SURE = 4.0  # standard deviations of its size above which it has grown although that is less than AS_FOUND


def is_gone(now: str) -> bool:
    """what a night says of an older alarm by now → whether what moved is back where it was."""
    return isinstance(now, Said) and now.key == "night.alarms.gone_again_left"


def has_grown(total: float, size: float, std: float | None) -> bool:
    """how far it is by now, size that its night found, standard deviation of that (None: not on record) → whether that is another
    number: by far, or surely.
    """
    other = abs(total - size)
    return other > AS_FOUND * abs(size) or bool(std and other > max(LEAST * abs(size), SURE * abs(std)))


def by_tonight(cause: Mapping[str, Any]) -> dict[str, Any]:
    """alarm → `on_part` and `on_part_um`; what goes on from an earlier night as it is tonight."""
    part, small, total, size = cause["on_part"], cause.get("on_part_um"), cause.get("total"), float(cause.get("size") or 0.0)
    same = {"on_part": part, "on_part_um": small}
    if not small or not total or not size or is_gone(cause["now"]):
        return same
    if not (cause.get("rate_per_day") or cause.get("ignored") or has_grown(float(total), size, cause.get("std"))):
        return same
    counted = float((cause.get("ignored") or {}).get("total") or size)
    large = abs(float(small) * (counted + float(total) - size) / counted)
    return {"on_part": with_effect(part, float(small), large), "on_part_um": large}


def with_effect(part: str, small: float, large: float) -> str:
    """what an alarm means for a part, µm that this says, µm in their place → the same with these."""
    own, by_now = number(small, "µm", signed=False), number(large, "µm", signed=False)
    if not isinstance(part, Said):
        return str(part).replace(own, by_now)
    return part.but(**{name: by_now if v == own else v for name, v in part.values.items() if isinstance(v, str)})
