"""A second machine, written out in homogeneous transforms, and the figures that a person would measure on it.

It reads the YAML files of an example by itself. It shares no code and no formula with the product or its simulator: bodies are
4 × 4 matrices, error motions are drawn as waves and Legendre series, contacts are found by secants, figures by moving the tool.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.polynomial import legendre

AXES = {"X": 0, "Y": 1, "Z": 2, "A": 0, "B": 1, "C": 2, "S": 2}


def translation(v: np.ndarray) -> np.ndarray:
    m = np.zeros((*np.shape(v)[:-1], 4, 4))
    m[..., range(4), range(4)] = 1.0
    m[..., :3, 3] = v
    return m


def rotation(about: int, angle: Any) -> np.ndarray:
    angle = np.asarray(angle, dtype=float)
    m = np.zeros((*angle.shape, 4, 4))
    j, k = (about + 1) % 3, (about + 2) % 3
    m[..., about, about] = m[..., 3, 3] = 1.0
    m[..., j, j] = m[..., k, k] = np.cos(angle)
    m[..., j, k], m[..., k, j] = -np.sin(angle), np.sin(angle)
    return m


def rigid(e: np.ndarray) -> np.ndarray:
    """(n, 6) small displacement → (n, 4, 4)."""
    return translation(e[..., :3]) @ rotation(0, e[..., 3]) @ rotation(1, e[..., 4]) @ rotation(2, e[..., 5])


def frame_of(letter: str, direction: list[float]) -> tuple[np.ndarray, float]:
    """→ (4, 4) from the axis frame into the machine frame, sense of the motion about or along the letter's base vector."""
    base, d = np.eye(3)[AXES[letter]], np.array(direction, dtype=float)
    d = d / np.linalg.norm(d)
    if abs(abs(base @ d) - 1) < 1e-9:
        return np.eye(4), float(np.sign(base @ d))
    half = base + d
    turn = np.eye(4)  # half a turn about the bisector, after half a turn about the base vector: the smallest rotation
    turn[:3, :3] = (2 * np.outer(half, half) / (half @ half) - np.eye(3)) @ (2 * np.outer(base, base) - np.eye(3))
    return turn, 1.0


class Truth:
    """A random machine of the topology of an example: every error motion of every axis, harmonics and backlash included."""

    def __init__(self, folder: Path, seed: int, size: float = 1.0, longer: float | None = None) -> None:
        """`longer`: the strategy is repeated with a second stylus, longer by that (mm), with its own offsets and tip."""
        read = lambda name: yaml.safe_load((folder / f"{name}.yaml").read_text())  # noqa: E731
        self.machine, self.artefact, self.strategy = read("machine"), read("artefact"), read("strategy")
        self.rng = np.random.default_rng(seed)
        self.longer = longer
        if longer is not None:
            again = [{**i, "stylus": 2} for i in self.strategy["indexations"]]
            self.strategy["indexations"] = [*self.strategy["indexations"], *again]
        axes = self.machine["axes"]
        word = self.machine["topology"].replace("(", "").replace(")", "")
        work, tool = word[1:-1].replace("b", "f").split("f")
        self.work, self.tool = list(reversed(work)), list(tool)  # from the foundation outwards
        self.names = sorted(axes, key="XYZABCS".index)
        self.linear = [n for n in self.names if n in "XYZ"]
        self.rotary = [n for n in self.names if n in "ABC"]
        self.length = self.machine["probe"]["length"]
        self.radius = self.machine["probe"]["tip_radius"]
        self.noise = self.machine["probe"]["repeatability"]
        self.frame = {n: frame_of(n, axes[n]["direction"]) for n in self.names}
        self.point = {n: np.array(axes[n].get("point", [0, 0, 0]), dtype=float) for n in self.names}
        self.draw(size)

    def draw(self, size: float) -> None:
        rng, zero = self.rng, np.zeros(6)
        micron, second = 1e-3 * size, 1e-6 * size
        self.inter = {n: zero for n in self.names}
        self.series = {n: np.zeros((6, 4)) for n in self.linear}
        self.waves = {n: np.zeros((6, 3, 2)) for n in self.rotary}
        self.backlash = {n: 0.0 for n in self.names}
        self.gain = {n: 0.0 for n in self.linear}
        scale = np.array([micron] * 3 + [second] * 3)
        for n in self.linear:
            self.inter[n] = np.concatenate([np.zeros(3), rng.normal(0, 30 * second, 3)])
            self.series[n] = rng.normal(size=(6, 4)) * (scale * [4, 4, 4, 8, 8, 8])[:, None] * [0, 1, 1, 0.5]
            self.gain[n] = float(rng.normal(0, 20 * second))
            self.backlash[n] = float(rng.normal(0, 2 * micron))
        for n in self.rotary:
            self.inter[n] = np.concatenate([rng.normal(0, 20 * micron, 3), rng.normal(0, 30 * second, 3)])
            self.waves[n] = rng.normal(size=(6, 3, 2)) * (scale * [2, 2, 2, 6, 6, 6])[:, None, None] / [[1.0], [1.5], [2.0]]
            self.backlash[n] = float(rng.normal(0, 5 * second))
        self.stylus = rng.normal(0, 20 * micron, 3)
        self.offset = {f: float(rng.normal(0, 30 * micron)) for f in self.artefact["facets"]}
        self.ball = {b: rng.normal(0, 30 * micron, 3) for b in self.artefact.get("balls", {})}
        certain = {f: v["uncertainty"] for f, v in self.artefact["facets"].items() if "uncertainty" in v}
        self.offset |= {f: float(rng.normal(0, u)) for f, u in certain.items()}
        self.stylus2, self.radius2 = zero[:3], 0.0
        if self.longer is not None:
            self.stylus2, self.radius2 = rng.normal(0, 20 * micron, 3), float(rng.normal(0, 5 * micron))
        bar = self.artefact.get("scale_bar")
        if bar:  # the bar is as long as its certificate says, within its uncertainty
            one, two = bar["balls"]
            a, b = (np.array(self.artefact["balls"][k]["centre"], dtype=float) for k in (one, two))
            now = (b + self.ball[two]) - (a + self.ball[one])
            want = bar["length"] + rng.normal(0, bar["uncertainty"])
            self.ball[two] = self.ball[two] + now * (want / np.linalg.norm(now) - 1)

    def motion(self, name: str, q: np.ndarray) -> np.ndarray:
        """axis, command → (n, 6) error of its body in its frame, and in its own component its positioning error."""
        if name in self.linear:
            low, high = self.machine["axes"][name]["travel"]
            e = legendre.legval((2 * q - low - high) / (high - low), self.series[name].T).T
            e[:, AXES[name]] += self.gain[name] * q
            return e
        if name in self.rotary:
            e = np.zeros((len(q), 6))
            for order in range(self.waves[name].shape[1]):
                w = self.waves[name][:, order, :]
                e += np.cos((order + 1) * q)[:, None] * w[:, 0] + np.sin((order + 1) * q)[:, None] * w[:, 1]
            return e
        return np.zeros((len(q), 6))

    def body(self, name: str, q: np.ndarray, sign: np.ndarray, errors: bool) -> np.ndarray:
        """axis, commands (n,), last directions (n,) → (n, 4, 4) of its body in the body that carries it."""
        into, sense = self.frame[name]
        base, linear = AXES[name], name in self.linear
        e = self.motion(name, q) if errors else np.zeros((len(q), 6))
        own = base if linear else base + 3
        moved = sense * (q + e[:, own] + (sign * self.backlash[name] if errors else 0.0))
        e[:, own] = 0.0
        go = translation(moved[:, None] * np.eye(3)[base]) if linear else rotation(base, moved)
        place = rigid((self.inter[name] if errors else np.zeros(6))[None])
        at = translation(self.point[name])
        return at @ into @ place @ go @ rigid(e) @ np.linalg.inv(into) @ np.linalg.inv(at)

    def tool_in_table(
        self, pose: dict[str, np.ndarray], sign: dict[str, np.ndarray], errors: bool = True, second: np.ndarray | None = None
    ) -> np.ndarray:
        """commands → (n, 4, 4): a frame at the stylus tip (or at a tool of `self.length`) as the table sees it.

        `second`: (n,) whether the second stylus is in the spindle.
        """
        out = []
        for chain in (self.work, self.tool):
            m = np.eye(4)[None]
            for name in chain:
                m = m @ self.body(name, pose[name], sign[name], errors)
            out.append(m)
        up = np.array(self.machine["axes"]["S"]["direction"], dtype=float)
        own, length = self.stylus, np.full(1, self.length)
        if second is not None:
            own, length = np.where(second[:, None], self.stylus2, own), self.length + second * (self.longer or 0.0)
        tip = self.point["S"] - length[:, None] * up + (own if errors else 0.0)
        return np.linalg.inv(out[0]) @ out[1] @ translation(tip)

    # the touches

    def readings(self) -> dict[str, Any]:
        """→ columns: facet, position (n, k) mm rad, direction (n, k)."""
        rows = [(i, f) for i in self.strategy["indexations"] for f in i["facets"]]
        n = len(rows)
        facets = [f for _, f in rows]
        second = np.array([i.get("stylus", 1) == 2 for i, _ in rows])
        pose = {a: np.zeros(n) for a in self.names}
        for a in (*self.rotary, "S"):
            pose[a] = np.radians([float(i.get(a, 0.0)) for i, _ in rows])
        sign = {a: np.zeros(n) for a in self.names}
        table = self.artefact["facets"]
        normal = np.array([table[f]["normal"] for f in facets], dtype=float)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        point = np.array([table[f]["point"] for f in facets], dtype=float)
        target = point + self.radius * normal
        origin = self.tool_in_table(pose, sign, errors=False, second=second)[:, :3, 3]
        ways = []
        for a in self.linear:
            moved = pose | {a: pose[a] + 1.0}
            ways.append(self.tool_in_table(moved, sign, errors=False, second=second)[:, :3, 3] - origin)
        matrix = np.stack(ways, axis=-1)
        start = np.linalg.solve(matrix, (target - origin)[:, :, None])[:, :, 0]
        inward = np.linalg.solve(matrix, -normal[:, :, None])[:, :, 0]
        came = np.zeros_like(start)
        for j in range(n):  # the last motion of an axis: the approach, else the way from the touch before
            before = start[j - 1] if j else start[j] - 1.0
            came[j] = np.where(np.abs(inward[j]) > 1e-6, np.sign(inward[j]), np.sign(np.round(start[j] - before, 6)))
            for i in range(3):
                if came[j, i] == 0:
                    came[j, i] = came[j - 1, i] if j else 1.0
        for i, a in enumerate(self.linear):
            sign[a] = came[:, i]
        for a in self.rotary:
            last = 1.0
            for j in range(n):
                step = pose[a][j] - (pose[a][j - 1] if j else pose[a][j] - 1)
                last = float(np.sign(step)) if abs(step) > 1e-9 else last
                sign[a][j] = last

        def gap(t: np.ndarray) -> np.ndarray:
            at = pose | {a: start[:, i] + t * inward[:, i] for i, a in enumerate(self.linear)}
            tip = self.tool_in_table(at, sign, second=second)[:, :3, 3]
            return np.array([self._gap(f, tip[j], point[j], normal[j]) for j, f in enumerate(facets)]) - second * self.radius2

        one, two = np.zeros(n), np.full(n, 0.05)
        left, right = gap(one), gap(two)
        for _ in range(4):
            slope = (right - left) / np.where(two == one, 1.0, two - one)
            new = two - right / np.where(slope == 0, -1.0, slope)
            one, left, two = two, right, new
            right = gap(two)
        t = two + self.rng.normal(0, self.noise, n)
        position = np.zeros((n, len(self.names)))
        for i, a in enumerate(self.names):
            j = self.linear.index(a) if a in self.linear else -1
            position[:, i] = pose[a] if j < 0 else start[:, j] + t * inward[:, j]
        return {
            "facet": [str(f) for f in facets],
            "position": position,
            "direction": np.stack([sign[a] for a in self.names], axis=1),
            "stylus": 1 + second.astype(int),
        }

    def _gap(self, facet: Any, tip: np.ndarray, point: np.ndarray, normal: np.ndarray) -> float:
        f = self.artefact["facets"][facet]
        if "ball" in f:
            ball = self.artefact["balls"][f["ball"]]
            return float(np.linalg.norm(tip - np.array(ball["centre"]) - self.ball[f["ball"]]) - ball["radius"] - self.radius)
        surface = f.get("surface")
        if surface:
            axis = np.array(surface.get("axis", [0, 0, 0]), dtype=float)
            spoke = tip - (point + self.offset[facet] * normal - surface["radius"] * normal)
            spoke = spoke - (spoke @ axis) * axis
            return float(np.linalg.norm(spoke) - surface["radius"] - self.radius)
        return float((tip - point) @ normal - self.offset[facet] - self.radius)

    # the figures

    def figures(self, over: dict[str, tuple[float, float]], rest: dict[str, float]) -> dict[tuple[str, str], float]:
        """ranges (mm, rad), reference pose → (kind, name): value in µm, µrad, µm/m, by moving the tool."""
        found: dict[tuple[str, str], float] = {}
        lines = {}
        for a in self.linear:
            q = np.linspace(*over[a], 241)
            pose = {n: np.full(241, rest.get(n, 0.0)) for n in self.names} | {a: q}
            still = {n: np.zeros(241) for n in self.names}
            real, nominal = self.tool_in_table(pose, still), self.tool_in_table(pose, still, errors=False)
            d = (real - nominal)[:, :3, 3]
            way = nominal[-1, :3, 3] - nominal[0, :3, 3]
            way /= np.linalg.norm(way)
            own = int(np.argmax(np.abs(way)))
            lines[a] = np.polyfit(q, real[:, :3, 3], 1)[0]
            ahead = d @ way
            found["positioning", f"E{a}{a} M"] = 1e3 * np.ptp(ahead)
            gain = np.polyfit(q, ahead, 1)
            found["positioning gain", f"E{a}{a}"] = 1e6 * gain[0]
            found["linearity", f"E{a}{a}"] = 1e3 * np.ptp(ahead - np.polyval(gain, q))
            there = self.tool_in_table(pose, still | {a: np.ones(241)})[:, :3, 3]
            back = self.tool_in_table(pose, still | {a: -np.ones(241)})[:, :3, 3]
            found["reversal", f"E{a}{a} B"] = 1e3 * float(np.mean((there - back) @ way))
            turn = real[:, :3, :3] @ np.swapaxes(nominal[:, :3, :3], 1, 2)
            for i in range(3):
                angle = (turn[:, (i + 2) % 3, (i + 1) % 3] - turn[:, (i + 1) % 3, (i + 2) % 3]) / 2
                found["angular", f"E{'ABC'[i]}{a}"] = 1e6 * np.ptp(angle)
                if i == own:
                    continue
                y = d[:, i]
                found["straightness", f"E{'XYZ'[i]}{a}"] = 1e3 * np.ptp(y - np.polyval(np.polyfit(q, y, 1), q))
                ends = y[0] + (y[-1] - y[0]) * (q - q[0]) / (q[-1] - q[0])
                found["straightness", f"E{'XYZ'[i]}{a} ends"] = 1e3 * np.ptp(y - ends)
                found["straightness", f"E{'XYZ'[i]}{a} zone"] = 1e3 * min_zone(q, y)
        for i, b in enumerate(self.linear):
            for a in self.linear[:i]:
                u, v = (lines[n] / np.linalg.norm(lines[n]) for n in (a, b))
                found["squareness", f"{b} to {a}"] = 1e6 * (np.arccos(u @ v) - np.pi / 2)
                about = 3 - AXES[a] - AXES[b]
                p, w = u * np.sign(u[AXES[a]]), v * np.sign(v[AXES[b]])
                first = np.arctan2(p[(about + 2) % 3], p[(about + 1) % 3]) + (np.pi / 2)
                second = np.arctan2(w[(about + 2) % 3], w[(about + 1) % 3])
                error = (second - first + np.pi / 2) % np.pi - np.pi / 2
                found["squareness", f"E{'ABC'[about]}(0{a}){b}"] = 1e6 * error
        for a in self.rotary:
            found |= self._rotary(a, np.linspace(*over[a], 721))
        return found | self._volume(over, rest)

    def _volume(self, over: dict[str, tuple[float, float]], rest: dict[str, float]) -> dict[tuple[str, str], float]:
        mesh = np.meshgrid(*(np.linspace(*over[a], 5) for a in self.linear), indexing="ij")
        pose = {n: np.full(125, rest.get(n, 0.0)) for n in self.names} | {
            a: m.ravel() for a, m in zip(self.linear, mesh, strict=True)
        }
        still = {n: np.zeros(125) for n in self.names}
        real, nominal = self.tool_in_table(pose, still), self.tool_in_table(pose, still, errors=False)
        p, q = real[:, :3, 3], nominal[:, :3, 3]
        u, _, v = np.linalg.svd((q - q.mean(0)).T @ (p - p.mean(0)))  # Kabsch: the turn that fits the points best
        turn = v.T @ np.diag([1, 1, np.linalg.det(v.T @ u.T)]) @ u.T
        d = (p - p.mean(0)) @ turn - (q - q.mean(0))
        small = real[:, :3, :3] @ np.swapaxes(nominal[:, :3, :3], 1, 2)
        found = {("volumetric", f"V{'XYZ'[i]}"): 1e3 * float(np.ptp(d[:, i])) for i in range(3)}
        found["volumetric", "V"] = 1e3 * float(np.linalg.norm(d, axis=1).max())
        for i in range(3):
            angle = (small[:, (i + 2) % 3, (i + 1) % 3] - small[:, (i + 1) % 3, (i + 2) % 3]) / 2
            found["volumetric", f"V{'ABC'[i]}"] = 1e6 * float(np.ptp(angle))
        return found

    def _rotary(self, a: str, q: np.ndarray) -> dict[tuple[str, str], float]:
        _, sense = self.frame[a]
        base, found = AXES[a], {}
        e = self.motion(a, q)
        found["positioning", f"E{a}{a}"] = 1e6 * float(np.ptp(e[:, base + 3]))
        found["axial", f"E{'XYZ'[base]}{a}"] = 1e3 * float(np.ptp(e[:, base]))
        j, k = (base + 1) % 3, (base + 2) % 3
        spin = np.exp(1j * sense * q)
        for first, kind, letters, factor in ((0, "radial", "XYZ", 1e3), (3, "tilt", "ABC", 1e6)):
            fixed = spin * (e[:, first + j] + 1j * e[:, first + k])
            matrix = np.stack([np.ones_like(spin), spin], axis=1)
            rest = fixed - matrix @ np.linalg.lstsq(matrix, fixed, rcond=None)[0]
            found[kind, f"E{letters[j]}{a}"] = factor * float(np.ptp(rest.real))
            found[kind, f"E{letters[k]}{a}"] = factor * float(np.ptp(rest.imag))
            plot = e[:, first + j] if kind == "radial" else e[:, first + k]  # of an indicator that turns with the axis
            circle = np.stack([np.ones(len(q)), np.cos(q), np.sin(q)], axis=1)
            found[kind, f"{a} rotating"] = factor * float(np.ptp(plot - circle @ np.linalg.pinv(circle) @ plot))
        return found


def min_zone(q: np.ndarray, y: np.ndarray) -> float:
    """→ least range of y less a line, by searching slopes ever finer."""
    middle, width = 0.0, 4 * np.ptp(y) / np.ptp(q) + 1e-30
    for _ in range(12):
        slopes = np.linspace(middle - width, middle + width, 41)
        sizes = np.ptp(y - slopes[:, None] * q, axis=1)
        middle, width = float(slopes[np.argmin(sizes)]), width / 8
    return float(sizes.min())
