"""Facets are not flat: every indexation meets another spot of them, each time the same (thesis Tables 4-3, 7-4)."""

from __future__ import annotations

import numpy as np

from ...records import Array, Id, InputError
from ..inputs import Law, Scene

TEXT = "form and roughness of the facets"
REPEATS = False
SHARED = False


def factor(scene: Scene, *, std: float, facets: tuple[Id, ...] = ()) -> tuple[Array, Law]:
    """n touches → independent deviations of `std` mm on the named facets (all of them when none is named).

    Raises InputError for a facet that the artefact lacks.
    """
    for facet in facets:
        if facet not in scene.touches.artefact.facets:
            raise InputError(f"budget: form: found facet {facet!r}; allowed: {', '.join(scene.touches.artefact.facets)}")
    rough = np.array([not facets or facet in facets for facet in scene.touches.facet])
    return scene.on_touches(std * np.eye(len(rough))[:, rough]), "normal"
