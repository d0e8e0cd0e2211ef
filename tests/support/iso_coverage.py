"""How often the intervals of the printed figures hold the truth, on random machines of every example topology.

python -m tests.support.iso_coverage 20 hu40t trunnion … +60 (a second stylus, 60 mm longer)
"""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np

from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import read_cell
from tango_cnc.iso230 import ranges
from tango_cnc.iso230.signed import Sheet, signed
from tango_cnc.records import Readings, TangoError
from tests.support.truth import Truth

Row = tuple[str, str, float | None, tuple[float, float] | None, float]  # kind, name, value, interval, truth

EXAMPLES = Path(__file__).parents[2] / "examples"
FIRST = 1000  # seed; lower ones served to set the upper end of the intervals of ranges
TOPOLOGIES = ("hu40t", "huron", "trunnion", "split", "fork_head", "three_axis", "three_axis_calibrated")


def measured(name: str, seed: int, longer: float | None = None, drawn: type[Truth] = Truth) -> tuple[Truth, Estimate]:
    """example, seed, how much longer a second stylus is (mm; None: there is none) → random machine, what is estimated of it."""
    truth = drawn(EXAMPLES / name, seed, longer=longer)
    return truth, estimated(truth, EXAMPLES / name)


def estimated(truth: Truth, folder: Path) -> Estimate:
    """machine, its example → what is estimated of it."""
    cell = read_cell(folder)
    machine = cell.machine
    if truth.longer is not None:
        machine = replace(machine, styli=(machine.probe, replace(machine.probe, length=machine.probe.length + truth.longer)))
    return estimate(machine, cell.artefact, touched(truth, machine.names), cell.terms)


def touched(truth: Truth, names: tuple[str, ...]) -> Readings:
    """machine, its axes in the order of the cell → what its touches read."""
    rows = truth.readings()
    assert list(names) == truth.names
    n = len(rows["facet"])
    number, ones = np.arange(1, n + 1), np.ones(n, dtype=int)
    return Readings(
        names,
        number,
        number * 3.0,
        tuple(rows["facet"]),
        rows["position"],
        rows["direction"],
        ("ok",) * n,
        ones,
        ones,
        stylus=None if truth.longer is None else rows["stylus"],
    )


def one(name: str, seed: int, longer: float | None = None, drawn: type[Truth] = Truth) -> list[Row]:
    """example, seed, as `measured` → kind, name, value, interval and truth of every figure; None where it was withheld."""
    truth, result = measured(name, seed, longer, drawn)
    sheet = signed(result)
    return against(truth, result, sheet)


def against(truth: Truth, result: Estimate, sheet: Sheet) -> list[Row]:
    """true machine, estimate, its figures → kind, name, value, interval and truth of each; None where it was withheld."""
    known = truth.figures(ranges(result.model.touches), dict(sheet.reference.pose))
    found = []
    for f in sheet.figures:
        if " − " in f.name or " + " in f.name:
            sign = -1 if " − " in f.name else 1
            a, b = f.name.split(" − " if sign < 0 else " + ")
            real = known[f.kind, a] + sign * known[f.kind, b]
        else:
            real = known[f.kind, f.name]
        found.append((f.kind, f.name, f.value, f.interval, float(real)))
    return found


def main(count: int, names: tuple[str, ...], longer: float | None = None, drawn: type[Truth] = Truth, first: int = FIRST) -> None:
    """count of machines, examples, how much longer a second stylus is (mm), how machines are drawn, first seed → a table."""
    print(f"{'example':22} {'machines':>8} {'figures':>8} {'withheld':>8} {'inside':>8} {'%':>6}")
    total = [0, 0]
    kinds: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for name in names:
        inside = given = withheld = failed = 0
        bad: dict[str, list[int]] = defaultdict(lambda: [0, 0])
        for seed in range(first, first + count):
            try:
                rows = one(name, seed, longer, drawn)
            except TangoError as error:
                failed += 1
                if failed == 1:
                    print(f"{name}: {error}")
                continue
            for kind, figure, value, interval, real in rows:
                if value is None or interval is None:
                    withheld += 1
                    continue
                ok = interval[0] - 1e-9 <= real <= interval[1] + 1e-9
                given, inside = given + 1, inside + ok
                for table, key in ((bad, f"{kind} {figure}"), (kinds, kind)):
                    table[key][0] += ok
                    table[key][1] += 1
        total[0] += inside
        total[1] += given
        print(f"{name:22} {count - failed:8} {given:8} {withheld:8} {inside:8} {100 * inside / max(given, 1):6.1f}", flush=True)
        for key, (ok, of) in bad.items():
            if ok < 0.8 * of:
                print(f"    {key}: {ok} of {of}")
    print(f"{'all':22} {'':8} {total[1]:8} {'':8} {total[0]:8} {100 * total[0] / max(total[1], 1):6.1f}")
    for kind, (ok, of) in sorted(kinds.items()):
        print(f"  {kind:20} {ok:6} of {of:6} {100 * ok / of:6.1f}")


if __name__ == "__main__":
    second = [float(word[1:]) for word in sys.argv[2:] if word.startswith("+")]
    main(int(sys.argv[1]), tuple(w for w in sys.argv[2:] if not w.startswith("+")) or TOPOLOGIES, *second)
