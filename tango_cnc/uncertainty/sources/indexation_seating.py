"""After every indexation the clamped rotary axes sit a little elsewhere."""

from __future__ import annotations

from ...records import Array
from ..inputs import Law, Scene

TEXT = "seating after an indexation"
REPEATS = True
SHARED = False


def factor(scene: Scene, *, std: float) -> tuple[Array, Law]:
    """n touches → one displacement an indexation, `std` mm in each of x y z of the machine frame."""
    index = scene.touches.indexation
    return scene.along(std**2 * (index[:, None] == index[None, :])), "normal"
