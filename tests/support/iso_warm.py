"""Random machines that are measured warm: how often the figures at 20 °C hold what the machine is at 20 °C.

python -m tests.support.iso_warm 50 hu40t trunnion, or with fixed: bar at +3 K, machine and table at +5 K

The workshop, its bar and its machine are drawn by rules of their own: 17 to 26 °C, the bar up to 1.5 K beside the air, the machine
from 1 K colder to 4 K warmer than the air, expansions from 9 to 13 and from 8 to 13 µm/m/K. temperature.yaml then has what a person
measured of them, who is as uncertain as it says.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from typing import Any
from unittest.mock import patch

import numpy as np

from tango_cnc.estimate import Estimate
from tango_cnc.iso230 import ranges
from tango_cnc.iso230 import signed as product
from tango_cnc.iso230.signed import Sheet
from tango_cnc.iso230.temperature import ASSUMED, Known, Thermal
from tests.support.iso_coverage import EXAMPLES, estimated
from tests.support.truth import AXES, Truth

FIRST = 40000  # seed
FIXED = False
WAYS = ("20 °C, nothing stated", "as read", "20 °C, stated", "as found, stated")


class Warm(Truth):
    """A machine as `Truth` at 20 °C; while `hot` its axes go farther, and its bar and table are larger."""

    def draw(self, size: float) -> None:
        super().draw(size)
        rng = self.rng
        air = rng.uniform(17, 26)
        self.bar, self.bed = air + rng.uniform(-1.5, 1.5), air + rng.uniform(-1, 4)  # °C
        self.of_bar, self.of_bed = rng.uniform(9e-6, 13e-6), rng.uniform(8e-6, 13e-6)  # 1/K
        if FIXED:
            self.bar, self.bed, self.of_bar, self.of_bed = 23.0, 25.0, 11.5e-6, 11.5e-6
        self.hot = False
        table = rng.uniform(9e-6, 24e-6) * (self.bed - 20)
        for name, f in self.artefact["facets"].items():
            if "ball" not in f:
                self.offset[name] += table * float(np.dot(f["point"], f["normal"]) / np.linalg.norm(f["normal"]))
        if "scale_bar" in self.artefact:
            one, two = self.artefact["scale_bar"]["balls"]
            a, b = (np.array(self.artefact["balls"][k]["centre"], dtype=float) + self.ball[k] for k in (one, two))
            self.ball[two] = self.ball[two] + (b - a) * self.of_bar * (self.bar - 20)

    def motion(self, name: str, q: np.ndarray) -> np.ndarray:
        e = super().motion(name, q)
        if self.hot and name in self.linear:
            e[:, AXES[name]] += self.of_bed * (self.bed - 20) * q
        return e

    def readings(self) -> dict[str, Any]:
        self.hot = True
        try:
            return super().readings()
        finally:
            self.hot = False

    def told(self) -> Thermal:
        """What a person writes down: off by the uncertainties that are stated."""
        off = self.rng.normal
        return Thermal(
            Known(self.bar + off(0, 0.1), 0.1),
            Known(self.bed + off(0, 0.3), 0.3),
            Known(self.of_bar + off(0, 0.6e-6), 0.6e-6),
            Known(self.of_bed + off(0, 1e-6), 1e-6),
        )


def compared(sheet: Sheet, known: dict[tuple[str, str], float]) -> list[tuple[str, float, bool]]:
    """figures, truth → kind (scales by themselves), width, whether the truth is inside, of every figure that is printed."""
    found = []
    for f in sheet.figures:
        if f.value is None or f.interval is None:
            continue
        if " − " in f.name or " + " in f.name:
            sign = -1 if " − " in f.name else 1
            a, b = f.name.split(" − " if sign < 0 else " + ")
            real, kind = known[f.kind, a] + sign * known[f.kind, b], "difference of gains"
        else:
            real = known[f.kind, f.name]
            kind = f.kind if f.unit in ("µm", "µm/m") and f.kind.startswith("positioning") else "others"
        found.append((kind, f.interval[1] - f.interval[0], f.interval[0] - 1e-9 <= real <= f.interval[1] + 1e-9))
    return found


def _sheets(result: Estimate, stated: Thermal) -> dict[str, Sheet]:
    asked = ((ASSUMED, True), (None, True), (stated, True), (stated, False))
    return {way: product.signed(result, None, thermal, cold) for way, (thermal, cold) in zip(WAYS, asked, strict=True)}


def one(name: str, seed: int) -> dict[str, list[tuple[str, float, bool]]]:
    """example, seed → by what was stated: every printed figure, compared."""
    truth = Warm(EXAMPLES / name, seed)
    result = estimated(truth, EXAMPLES / name)
    stated, over = truth.told(), ranges(result.model.touches)
    fitted = product.seen(result)
    with patch.object(product, "seen", lambda *_: fitted):  # four sheets of one machine
        sheets = _sheets(result, stated)
    pose = dict(sheets["as read"].reference.pose)
    cold = truth.figures(over, pose)
    truth.hot = True
    warm = truth.figures(over, pose)
    truth.hot = False
    return {way: compared(sheet, warm if way.startswith("as found") else cold) for way, sheet in sheets.items()}


def main(count: int, names: tuple[str, ...]) -> None:
    """count of machines, examples → a table; 'as read' is held against 20 °C too, as a careless reader would."""
    for name in names:
        rows: dict[tuple[str, str], list[tuple[float, bool]]] = defaultdict(list)
        for seed in range(FIRST, FIRST + count):
            for way, figures in one(name, seed).items():
                for kind, width, inside in figures:
                    rows[way, kind].append((width, inside))
        for (way, kind), told in rows.items():
            inside = sum(ok for _, ok in told)
            middle = float(np.median([w for w, _ in told]))
            print(
                f"{name:10} {way:22} {kind:20} {inside:5} of {len(told):5} {100 * inside / len(told):6.1f} % width {middle:6.1f}",
                flush=True,
            )


if __name__ == "__main__":
    FIXED = "fixed" in sys.argv
    main(int(sys.argv[1]), tuple(w for w in sys.argv[2:] if w != "fixed") or ("hu40t", "trunnion"))
