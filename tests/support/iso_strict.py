"""Random machines that no rule of the intervals was made for: what each way of drawing does to every printed figure.

python -m tests.support.iso_strict 24 flat hu40t, with +60 for a second stylus and a tool that are 60 mm longer

`flat`: all degrees to 5 and all harmonics to 4 are as large as each other. `powers`: polynomials in powers of the command from the
middle of the travel, degree 1 to 4. `waves`: sines of half a wave to two and a half over the touched range. `high`: harmonics to
6, degree 6. `few`: degree 1 and 2, two harmonics, sizes of motions that differ by factors. A topology stands for an example with
another chain: hu40t:wCBYfXZ(S)t.
"""

from __future__ import annotations

import sys
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np
from numpy.polynomial import legendre

from tango_cnc.iso230.signed import signed
from tests.support.iso_coverage import EXAMPLES, Row, against, estimated
from tests.support.truth import AXES, Truth

FIRST = 90000  # seed
WAYS = ("flat", "powers", "waves", "high", "few")
HARMONICS = {"flat": 4, "powers": 3, "waves": 4, "high": 6, "few": 2}


class Strict(Truth):
    """A machine as `Truth`, its errors drawn anew in one of `WAYS`."""

    way = "flat"

    def draw(self, size: float) -> None:
        super().draw(0.0)
        at = dict(zip(self.names, self.readings()["position"].T, strict=True))  # of a machine without errors: what is touched
        super().draw(size)
        rng, micron, second = self.rng, 1e-3 * size, 1e-6 * size
        self.curves = {}
        self.over = {n: (float(at[n].min()), float(at[n].max()) + 1e-3) for n in self.linear}
        for n in self.linear:
            self.curves[n] = [self._curve((3 * micron, 10 * second)[c > 2]) for c in range(6)]
            self.inter[n] = np.concatenate([np.zeros(3), rng.normal(0, 30 * second, 3)])
            self.gain[n] = float(rng.normal(0, 20 * second))
            self.backlash[n] = float(rng.normal(0, 1.5 * micron))
        for n in self.rotary:
            most = HARMONICS[self.way]
            self.waves[n] = (
                rng.normal(size=(6, most, 2)) * (np.array([2 * micron] * 3 + [6 * second] * 3) / most**0.5)[:, None, None]
            )
            if self.way == "few":
                self.waves[n] *= np.exp(rng.normal(0, 0.8, 6))[:, None, None]
            self.backlash[n] = float(rng.normal(0, 4 * second))

    def _curve(self, large: float) -> tuple[str, np.ndarray]:
        rng = self.rng
        if self.way == "waves":
            k = rng.uniform(0.5, 2.5, 2)
            return "waves", np.column_stack([large * rng.normal(size=2), k, rng.uniform(0, 2 * np.pi, 2)])
        if self.way == "powers":
            return "powers", large * rng.normal(size=5) * [0, 1, 1, 1, 1]
        most = {"flat": 5, "high": 6, "few": 2}[self.way]
        spread = np.exp(rng.normal(0, 0.8)) if self.way == "few" else 1.0
        return "legendre", np.concatenate([[0.0], spread * large * rng.normal(size=most) * (2 / most) ** 0.5])

    def motion(self, name: str, q: np.ndarray) -> np.ndarray:
        if name not in self.linear or not hasattr(self, "curves"):
            return super().motion(name, q)
        low, high = self.over[name]
        u, e = (2 * q - low - high) / (high - low), np.zeros((len(q), 6))
        for c, (kind, of) in enumerate(self.curves[name]):
            if kind == "waves":
                e[:, c] = sum(a * np.sin(np.pi * k * u + phase) for a, k, phase in of)
            else:
                e[:, c] = legendre.legval(u, of) if kind == "legendre" else np.polynomial.polynomial.polyval(u, of)
        e[:, AXES[name]] += self.gain[name] * q
        return e


def folder_of(name: str, into: Path) -> Path:
    """example, or example:topology → folder with that cell."""
    example, _, topology = name.partition(":")
    if not topology:
        return EXAMPLES / example
    cell = into / "cell"
    if not cell.exists():
        cell.mkdir()
        for file in (EXAMPLES / example).glob("*.yaml"):
            (cell / file.name).write_text(file.read_text())
        text = (cell / "machine.yaml").read_text().splitlines()
        (cell / "machine.yaml").write_text("\n".join(f"topology: {topology}" if t.startswith("topology") else t for t in text))
    return cell


def one(folder: Path, seed: int, drawn: type[Truth], longer: float | None = None) -> list[Row]:
    """cell, seed, how machines are drawn, how much longer a second stylus and the tool are → kind, name, value, interval, truth."""
    truth = drawn(folder, seed, longer=longer)
    result = estimated(truth, folder)
    sheet = signed(result, None if longer is None else truth.length + longer)
    truth.length = sheet.reference.length
    return against(truth, result, sheet)


def main(count: int, way: str, names: list[str], longer: float | None, first: int) -> None:
    drawn = type("Drawn", (Strict,), {"way": way})
    for name in names:
        kinds, figures = defaultdict(lambda: [0, 0, 0, 0]), defaultdict(lambda: [0, 0, 0, 0])
        with tempfile.TemporaryDirectory() as into:
            folder = folder_of(name, Path(into))
            for seed in range(first, first + count):
                for kind, figure, value, interval, real in one(folder, seed, drawn, longer):
                    if value is None or interval is None:
                        kinds[kind][3] += 1
                        continue
                    for of in (kinds[kind], figures[f"{kind} {figure}"], kinds["all"]):
                        of[0] += interval[0] - 1e-9 <= real <= interval[1] + 1e-9
                        of[1] += 1
                        of[2] += real > interval[1] + 1e-9
        inside, of = kinds["all"][:2]
        print(f"{name} {way} +{longer or 0:g}: {inside} of {of} {100 * inside / max(of, 1):.1f} %", flush=True)
        print(
            "   inside of (above; withheld): " + ", ".join(f"{k} {a}/{n} ({u}; {w})" for k, (a, n, u, w) in sorted(kinds.items()))
        )
        bad = [f"{k} {a}/{n} ({u})" for k, (a, n, u, _) in figures.items() if a < 0.87 * n]
        print("   " + ", ".join(bad), flush=True)


if __name__ == "__main__":
    words = sys.argv[1:]
    more = [float(w[1:]) for w in words if w.startswith("+")]
    seeds = [int(w[5:]) for w in words if w.startswith("from=")]
    plain = [w for w in words if not w.startswith("+") and not w.startswith("from=")]
    main(int(plain[0]), plain[1], plain[2:], more[0] if more else None, seeds[0] if seeds else FIRST)
