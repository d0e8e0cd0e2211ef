"""What instruments show on a random machine that is written out in homogeneous transforms, and how often intervals hold it.

python -m tests.support.instrument_truth 20 hu40t trunnion …

Paths, balls, set-up and figures are computed here a second time: a ball bar is a distance, a circle is fitted by its centre and
radius, an R-test is fitted by the place of its ball and the length of its tool. Only the command list is shared.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import read_cell
from tango_cnc.instruments import Predicted, Wanted, path_of, predict
from tango_cnc.iso230 import ranges
from tango_cnc.records import Readings, TangoError
from tests.support.truth import Truth

EXAMPLES = Path(__file__).parents[2] / "examples"
TOPOLOGIES = ("hu40t", "huron", "trunnion", "split", "fork_head", "three_axis", "three_axis_calibrated")
Figures = dict[str, float]


def machine_and_estimate(name: str, seed: int) -> tuple[Truth, Estimate]:
    """example, seed → a random machine and what its touches give; afterwards its tool runs true."""
    truth = Truth(EXAMPLES / name, seed)
    rows = truth.readings()
    n = len(rows["facet"])
    cell = read_cell(EXAMPLES / name)
    number, ones = np.arange(1, n + 1), np.ones(n, dtype=int)
    readings = Readings(
        cell.machine.names, number, number * 3.0, tuple(rows["facet"]), rows["position"], rows["direction"], ("ok",) * n, ones, ones
    )
    result = estimate(cell.machine, cell.artefact, readings, cell.terms)
    truth.stylus = np.zeros(3)
    return truth, result


def names_for(result: Estimate) -> list[str]:
    """estimate → names of tests."""
    over = ranges(result.model.touches)
    machine = result.model.touches.machine
    found = [f"laser-{a}" for a in machine.linear if a in over] + ["circle-XY", "circle-XZ", "circle-YZ"]
    return found + [f"rotary-{a}" for a in machine.rotary if a in over]


def predicted(result: Estimate, name: str) -> Predicted:
    """estimate, name of a test → what the product says that an R-test, ball bar or laser shows."""
    machine = result.model.touches.machine
    return predict(result, path_of(machine, ranges(result.model.touches), Wanted(name, "rtest")))


def shown(truth: Truth, told: Predicted, noise: float = 0.0, seed: int = 0) -> tuple[np.ndarray, Figures]:
    """machine, test, scatter of a reading (µm) → readings (q, n) µm as the instrument gives them, figures by name."""
    kind, _, letters = told.path.name.partition("-")
    q, sense, n = told.path.command, told.path.sense, len(told.path.command)
    rng = np.random.default_rng([7, seed])
    rest = dict(told.path.reference.pose)
    pose = {a: np.full(n, rest.get(a, 0.0)) for a in truth.names}
    sign = {a: np.zeros(n) for a in truth.names}
    if kind == "laser":
        pose[letters], sign[letters] = q, sense
        real, meant = (truth.tool_in_table(pose, sign, errors=e)[:, :3, 3] for e in (True, False))
        beam = meant[np.argmax(q)] - meant[np.argmin(q)]
        beam /= np.linalg.norm(beam)
        reading = ((real - meant) @ beam * 1e3 + rng.normal(0, max(noise, 1e-12), n))[None]
        return reading - reading[0, 0], _laser(reading[0], q, sense)
    if kind == "circle":
        radius = told.path.radius
        assert radius is not None
        centre = truth.tool_in_table({a: v[:1] for a, v in pose.items()}, {a: v[:1] for a, v in sign.items()}, errors=False)
        ball = centre[0, :3, 3] + rng.normal(0, 0.005, 3) * (np.array(list("XYZ")) != (set("XYZ") - set(letters)).pop())
        for a, wave, slope in ((letters[0], np.cos(q), -np.sin(q)), (letters[1], np.sin(q), np.cos(q))):
            pose[a] = pose[a] + radius * wave
            sign[a] = np.where(np.abs(slope) < 1e-9, 0.0, np.sign(slope)) * sense
        tip = truth.tool_in_table(pose, sign)[:, :3, 3]
        reading = (np.linalg.norm(tip - ball, axis=1) - radius) * 1e3 + rng.normal(0, max(noise, 1e-12), n)
        waves = np.stack([np.cos(q), np.sin(q), np.ones(n)], axis=1)
        centred = reading - waves[:, :2] @ np.linalg.lstsq(waves, reading, rcond=None)[0][:2]
        return reading[None], {
            "circular deviation, both ways": float(np.ptp(centred)),
            "circular deviation, positive": float(np.ptp(centred[sense > 0])),
            "circular deviation, negative": float(np.ptp(centred[sense < 0])),
            "mean radial deviation": float(np.mean(centred)),
        }
    return _rtest(truth, told, letters, pose, sign, rng, noise)


def _rtest(truth, told, axis, pose, sign, rng, noise) -> tuple[np.ndarray, Figures]:  # type: ignore[no-untyped-def]
    q, sense, n = told.path.command, told.path.sense, len(told.path.command)
    first = {a: told.path.position[:1, i] for i, a in enumerate(truth.names)}
    zero = {a: np.zeros(1) for a in truth.names}
    point = truth.tool_in_table(first, zero, errors=False)[0, :3, 3]

    def follow(angle: np.ndarray) -> dict[str, np.ndarray]:
        at = pose | {axis: angle}
        tip = truth.tool_in_table(at, sign, errors=False)[:, :3, 3]
        ways = [truth.tool_in_table(at | {a: at[a] + 1.0}, sign, errors=False)[:, :3, 3] - tip for a in truth.linear]
        go = np.linalg.solve(np.stack(ways, axis=-1), (point - tip)[:, :, None])[:, :, 0]
        return at | {a: at[a] + go[:, i] for i, a in enumerate(truth.linear)}

    at, ahead, behind = follow(q), follow(q + 1e-3), follow(q - 1e-3)
    moving = {a: ahead[a] - behind[a] for a in truth.names}
    signs = {a: np.where(np.abs(v) < 1e-8, 0.0, np.sign(v)) * sense for a, v in moving.items()}
    frame = truth.tool_in_table(at, signs)
    ball = point + rng.normal(0, 0.005, 3)
    reading = (frame[:, :3, 3] - ball) * 1e3 + rng.normal(0, max(noise, 1e-12), (n, 3))
    up = np.array(truth.machine["axes"]["S"]["direction"], dtype=float)
    tool = truth.tool_in_table(at, sign, errors=False)[:, :3, :3] @ up
    columns = np.column_stack([np.tile(np.eye(3), (n, 1)), tool.reshape(-1)])
    rest = reading.reshape(-1)
    rest = (rest - columns @ np.linalg.lstsq(columns, rest, rcond=1e-9)[0]).reshape(n, 3)
    found = {}
    for way, chosen in (("both ways", sense != 0), ("positive", sense > 0), ("negative", sense < 0)):
        found |= {f"{c} deviation, {way}": float(np.ptp(rest[chosen, i])) for i, c in enumerate("xyz")}
    return reading.T, found


def _laser(e: np.ndarray, q: np.ndarray, sense: np.ndarray) -> Figures:
    order = np.argsort(q[sense > 0])
    back = np.argsort(q[sense < 0])
    up, down = e[sense > 0][order], e[sense < 0][back]
    return {
        "E, bidirectional systematic deviation": float(max(up.max(), down.max()) - min(up.min(), down.min())),
        "M, range of mean bidirectional deviation": float(np.ptp((up + down) / 2)),
        "mean reversal value": float(np.mean(up - down)),
        "E+, unidirectional systematic deviation": float(np.ptp(up)),
        "E−, unidirectional systematic deviation": float(np.ptp(down)),
    }


def main(count: int, names: tuple[str, ...]) -> None:
    """count of machines, examples → a table."""
    all_in = all_given = 0
    for name in names:
        table: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0])
        for seed in range(3000, 3000 + count):
            try:
                truth, result = machine_and_estimate(name, seed)
            except TangoError as error:
                print(name, error)
                break
            for test in names_for(result):
                told = predicted(result, test)
                real = shown(truth, told)[1]
                for f in told.figures:
                    row = table[test]
                    if f.value is None or f.interval is None:
                        row[2] += 1
                        continue
                    row[0] += f.interval[0] - 1e-6 <= real[f.name] <= f.interval[1] + 1e-6
                    row[1] += 1
        inside, given = (sum(r[i] for r in table.values()) for i in (0, 1))
        withheld = sum(r[2] for r in table.values())
        all_in, all_given = all_in + inside, all_given + given
        print(f"{name}: {inside} of {given} = {100 * inside / max(given, 1):.1f} %, withheld {withheld}", flush=True)
        print("   " + ", ".join(f"{t} {r[0]}/{r[1]} ({r[2]} withheld)" for t, r in table.items()), flush=True)
    print(f"all: {all_in} of {all_given} = {100 * all_in / max(all_given, 1):.1f} %")


if __name__ == "__main__":
    main(int(sys.argv[1]), tuple(sys.argv[2:]) or TOPOLOGIES)
