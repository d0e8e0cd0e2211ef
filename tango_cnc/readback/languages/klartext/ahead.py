"""A jump sends twins ahead to a label: they skip every statement up to it. TCH PROBE 4 gives its results to the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ...rehearsal import SPOILT
from ...twins import Twin

AHEAD = "ahead of"  # the label that a twin is on its way to


def apart(one: Mapping[str, float], other: Mapping[str, float]) -> float:
    """place, place → mm that they are apart, along the axis where it is most."""
    return max(abs(one[name] - other[name]) for name in "XYZ")


def told(twin: Twin, result: int) -> None:
    """twin, number of the first of four parameters → nothing; they hold what TCH PROBE 4 leaves in them."""
    for i, name in enumerate("XYZ"):
        twin.shared[f"Q{result + i}"] = twin.skip[name] if twin.hit else SPOILT
    twin.shared[f"Q{result + 3}"] = 0.0 if twin.hit else -1.0


def unless_ahead(statement: Callable[[Twin], None]) -> Callable[[Twin], None]:
    """statement → the same, which a twin on its way to a label leaves out."""

    def does(twin: Twin) -> None:
        if AHEAD not in twin.shared:
            statement(twin)

    return does


def arrival(label: str) -> Callable[[Twin], None]:
    """label → the statement that this is it: twins on their way to it are there."""

    def does(twin: Twin) -> None:
        if twin.shared.get(AHEAD) == float(label):
            del twin.shared[AHEAD]

    return does
