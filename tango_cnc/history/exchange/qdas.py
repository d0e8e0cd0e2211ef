"""Q-DAS ASCII transfer format, `.dfq`: one characteristic a parameter, one value a night; µm, µrad, µm/m.

K0100 number of characteristics, K1001 part, K1900 remark (simulated nights say so there), K2002 name and K2142 unit of a
characteristic, then one line a night: value, attribute (K0002: 0 valid, 255 none) and time, set apart by the control
characters DC4 and SI as the format has them.
"""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from ...files import write_text
from ...records import InputError
from ...texts import say
from ..store import History

ENDINGS = (".dfq",)
ATTRIBUTE, NEXT = "\x14", "\x0f"  # between the parts of a value, between characteristics
SCALE = {"mm": (1e3, "µm"), "rad": (1e6, "µrad"), "mm/mm": (1e6, "µm/m")}


def write(history: History, machine: str, file: Path, entry: int) -> None:
    """history, machine, file → written; `entry` is not used. Raises InputError where no night has parameters."""
    names = history.parameters(machine)
    if not names:
        raise InputError(f"{machine}: no night has parameters; nothing was written")
    trends = [history.trend(machine, name) for name in names]
    head = [f"K0100 {len(names)}", f"K1001/0 {machine}", "K1002/0 geometric errors of the machine"]
    if not history.simulated(machine).isdisjoint(e for trend in trends for e in trend.entries):
        head.append(f"K1900/0 {say('audit.simulated')}")
    for i, trend in enumerate(trends, 1):
        _, unit = SCALE.get(trend.unit, (1.0, trend.unit))
        head += [f"K2001/{i} {i}", f"K2002/{i} {trend.name}", f"K2004/{i} 0", f"K2022/{i} 4", f"K2142/{i} {unit}"]
    found = [dict(zip(t.entries, t.value, strict=True)) for t in trends]
    when = {e: moment for t in trends for e, moment in zip(t.entries, t.start_utc, strict=True)}
    lines = []
    for e in sorted(when, key=lambda e: (when[e], e)):
        moment = datetime.fromisoformat(when[e]).strftime("%d.%m.%Y/%H:%M:%S")
        values = []
        for trend, own in zip(trends, found, strict=True):
            factor, _ = SCALE.get(trend.unit, (1.0, ""))
            value = f"{own[e] * factor:.4f}{ATTRIBUTE}0" if e in own else f"0{ATTRIBUTE}255"
            values.append(f"{value}{ATTRIBUTE}{moment}")
        lines.append(NEXT.join(values))
    write_text(file, "\n".join([*head, *lines]) + "\n")
