"""Facets that are round and are taken for flat: a touch beside the nominal point meets a surface that has fallen away."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import InputError, Vector

from . import Disturbance, History, unit
from ._kinds import FacetIds, Positive

EXAMPLE = {"radius": 200}
OTHERWISE = "its values follow from the radius; test_sim_effects_probe.py"
UNDRAWN = "it needs a cylinder, and the table of the thesis has none"

ALONG = 1e-3  # cosine: a normal as square to the axis as a file can say it


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    radius: Positive,
    axis: Vector = (0.0, 0.0, 1.0),
    facets: FacetIds = (),
) -> Disturbance:
    """n touches → gap −(√((R+r)² + s²) − R − r) mm on flat facets that are really cylinders of `radius` R along `axis`.

    r is the radius of the stylus ball, s the miss of the nominal point, sideways to normal and `axis` (table frame). `facets`
    are all flat ones along `axis` when none is named. A facet whose `surface` the artefact gives is curved in the simulated
    machine anyway. Raises InputError for facets that are not flat or not along the axis.
    """
    along = unit(axis)
    allowed = {
        f.id: f for f in history.artefact.facets.values() if f.ball is None and f.surface is None and abs(along @ f.normal) < ALONG
    }
    if wrong := [name for name in facets if name not in allowed]:
        raise InputError(
            f"facets: found {', '.join(wrong)}; allowed: flat facets whose normal is square to {list(axis)}: {', '.join(allowed)}"
        )
    gap = np.zeros(len(history))
    reach = radius + history.machine.probe.tip_radius
    for name in set(facets or allowed) & set(history.facet):
        mine = np.array(history.facet) == name
        sideways = np.cross(along, allowed[name].normal)
        miss = (history.point[mine] - np.array(allowed[name].point)) @ sideways
        gap[mine] = reach - np.hypot(reach, miss)
    return Disturbance(gap=gap)
