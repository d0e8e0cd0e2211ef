"""The last motion before a touch leads towards its facet: what the readings say of it is compared with the normals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..texts import say
from ..touches import Touches
from .data import FEW, Remark

ALONG = 0.7  # mm of gap that a mm of an axis makes where it carries the approach


def approaches(touches: Touches) -> Iterator[Remark]:
    """touches → remarks on directions that lead away from the facets: every backlash has the wrong sign then."""
    against, towards = {}, {}
    for name in touches.machine.linear:
        lever, sign = touches.lever(name), touches.sign(name)
        seen = (np.abs(lever) > ALONG) & (sign != 0)
        against[name], towards[name] = int((sign * lever > 0)[seen].sum()), int((sign * lever < 0)[seen].sum())
    wrong = [n for n in against if against[n] >= FEW and against[n] > 9 * towards[n]]
    unsure = [n for n in against if n not in wrong and against[n] >= FEW and 3 * against[n] > towards[n]]
    if wrong:
        columns = ", ".join(f"d{name}" for name in wrong)
        change = say("plausible.directions.give_sign_axis_motion_before", columns=columns)
        yield Remark(
            "doubtful",
            say(
                "plausible.directions.axis_moved_away_from_facet",
                columns=columns,
                total=sum(against[n] for n in wrong),
                total2=sum(against[n] + towards[n] for n in wrong),
                wrong=", ".join(wrong),
            ),
            (),
            "directions",
            columns,
            change,
        )
    if unsure:
        yield Remark(
            "trustworthy",
            say(
                "plausible.directions.last_motion_leads_away_from",
                unsure=", ".join(unsure),
                total=sum(against[n] for n in unsure),
                total2=sum(against[n] + towards[n] for n in unsure),
            ),
            (),
            "directions",
            ", ".join(f"d{name}" for name in unsure),
        )
