"""The last motion before a touch: what the readings say of it is compared with the normals, and with how far rotary axes turned."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ..texts import say
from ..touches import Touches
from .data import FEW, Remark

TURN = math.radians(0.1)  # rad: a rotary axis that went further has turned
WRONG = 0.2  # share of the turns that a column may get wrong: rows that are missing leave some
FEWEST = 3  # turns that a column gets wrong before it is called so
ALONG = 0.7  # mm of gap that a mm of an axis makes where it carries the approach


def approaches(touches: Touches, derived: Sequence[str] = ()) -> Iterator[Remark]:
    """touches, axes without a column → remarks on directions that lead away from the facets: backlashes have the wrong sign then.

    A direction that is derived from contact to contact leaves out the approach. That is no mistake of the readings.
    """
    against, towards = {}, {}
    for name in touches.machine.linear:
        lever, sign = touches.lever(name), touches.sign(name)
        seen = (np.abs(lever) > ALONG) & (sign != 0)
        against[name], towards[name] = int((sign * lever > 0)[seen].sum()), int((sign * lever < 0)[seen].sum())
    wrong = [n for n in against if n not in derived and against[n] >= FEW and against[n] > 9 * towards[n]]
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


def turns(touches: Touches) -> Iterator[Remark]:
    """touches → remarks on rotary columns that say another sense than the positions, which decide it: an axis turns from one to the
    next and then stands still. A column that always says the same is that of an axis that always comes from one side.
    """
    wrong: dict[str, tuple[int, int]] = {}
    order = np.lexsort((touches.time, touches.cycle, touches.day))
    same = (np.diff(touches.day[order]) == 0) & (np.diff(touches.cycle[order]) == 0)
    for axis in touches.machine.rotary:
        at, said = touches.axis(axis)[order], touches.sign(axis)[order]
        way = np.diff(at)
        if touches.machine.axis(axis).travel is None:  # the shorter way
            way = (way + np.pi) % math.tau - np.pi
        turned = same & (np.abs(way) > TURN) & (said[1:] != 0)
        still = same & (np.abs(way) <= TURN) & (said[1:] * said[:-1] != 0)
        if not turned.any() or np.ptp(said) == 0:
            continue
        off = (turned & (said[1:] * way < 0)) | (still & (said[1:] != said[:-1]))
        if off[turned].sum() >= FEWEST and off.sum() > WRONG * (turned | off).sum():
            wrong[axis] = int(off.sum()), int((turned | off).sum())
    if wrong:
        columns = ", ".join(f"d{axis}" for axis in wrong)
        yield Remark(
            "doubtful",
            say(
                "plausible.directions.turned_other_way",
                columns=columns,
                axes=", ".join(wrong),
                off=sum(off for off, _ in wrong.values()),
                total=sum(total for _, total in wrong.values()),
            ),
            (),
            "directions",
            columns,
            say("plausible.directions.give_sign_axis_motion_before", columns=columns),
            sure=True,
        )
