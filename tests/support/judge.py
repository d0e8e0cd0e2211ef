"""Seventeen further kinds of causes that no catalogue holds, on three machines: a judge beside `support.outside`.

python -m support.judge 700000 judge.jsonl [seeds] [kinds] [machines]     appended to the file; then its table

Each kind is a function (history, rng, axes) → (n,) by which a touch reads early, in any unit. They are the physics of what
machines do: play, friction, pumps, bearings, sun. A pattern that a cause of the catalogue imitates to 99 % is drawn again.
"""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from sim_controller.effects import History, lever
from support.effect_parts import unit
from tango_cnc.diagnose import diagnose

from . import blind, trials
from .outside import DIRECTION, HISTORY, PROBE, TIME, Array, _axis, _part, _scaled, _since, _towards

MACHINES = ("trunnion", "hu40t", "fork_head")
PEAKS = trials.PEAKS


@dataclass(frozen=True)
class Axes:
    """Letters: the rotary axis that goes less far, the one that goes farther, the vertical linear axis."""

    tilt: str
    turn: str
    up: str


def axes_of(s: trials.Stage) -> Axes:
    """stage → its axes."""
    h = s.history
    reach = {a: float(np.ptp(_axis(h, a))) for a in h.machine.rotary}
    return Axes(
        min(reach, key=lambda a: reach[a]),
        max(reach, key=lambda a: reach[a]),
        "Y" if s.bench.cell.machine.name.startswith("HU40T") else "Z",
    )


Kind = Callable[[History, np.random.Generator, Axes], Array]


def _play(q: Array, width: float) -> Array:
    """path of an axis, width of the play → (n,) what follows it: it stays until it is pushed."""
    follower, state = np.zeros(len(q)), float(q[0])
    for i, place in enumerate(q):
        state = min(max(state, place - width / 2), place + width / 2)
        follower[i] = state
    return follower


def wind_up(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """A rotary drive winds up: its angle lags behind by friction, as far as the path since the last turning back allows."""
    letter = a.tilt if rng.random() < 0.5 else a.turn
    q = _axis(h, letter)
    return (_play(q, float(rng.uniform(0.2, 0.8)) * float(np.ptp(q))) - q) * lever(h, letter)


def falling_backlash(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The lost motion of an axis falls along its travel: the screw is worn at one end."""
    i = int(rng.integers(3))
    along = _scaled(h, "XYZ"[i]) * rng.choice([-1, 1])
    return np.exp(-1.2 * along) * h.direction[:, h.column("XYZ"[i])] * h.normal[:, i]


def backlash_by_height(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The lost motion of one axis grows with the place of another one, which tilts its carriage."""
    i, j = rng.choice(3, 2, replace=False)
    return (1 + _scaled(h, "XYZ"[j])) * h.direction[:, h.column("XYZ"[i])] * h.normal[:, i]


def pre_sliding(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """An axis still creeps over its friction: it lags, and less the farther it has gone since it turned back."""
    i = int(rng.integers(3))
    way = np.abs(h.move[:, h.column("XYZ"[i])])
    return np.exp(-way / rng.uniform(8, 25)) * h.direction[:, h.column("XYZ"[i])] * h.normal[:, i]


def creeping_turn(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """A rotary axis creeps to its place after it was turned, from the side that it came from."""
    letter = a.tilt if rng.random() < 0.5 else a.turn
    turned = np.diff(_axis(h, letter), prepend=_axis(h, letter)[:1])
    last = np.maximum.accumulate(np.where(np.abs(turned) > 1e-6, np.arange(len(h)), 0))
    return np.sign(turned[last]) * np.exp(-_since(h) / rng.uniform(15, 40)) * lever(h, letter)


def pumping_counterbalance(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The counterbalance loses pressure with every way up until its pump starts: a sawtooth of the way that was gone."""
    q = _axis(h, a.up)
    gone = np.cumsum(np.maximum(np.diff(q, prepend=q[:1]), 0))
    saw = (gone / gone[-1] * rng.uniform(2.5, 5) + rng.uniform()) % 1
    return saw * h.normal[:, "XYZ".index(a.up)]


def loosened_stylus(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """From a moment on the stylus gives more to some sides than to others."""
    azimuth = np.arctan2(h.normal_spindle[:, 1], h.normal_spindle[:, 0])
    lobes = np.cos(2 * (azimuth - rng.uniform(0, np.pi))) + 0.4 * np.cos(3 * azimuth + rng.uniform(0, 6))
    return (_part(h) > rng.uniform(0.25, 0.75)) * lobes * np.hypot(*h.normal_spindle[:, :2].T)


def two_way_straightness(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The carriage turns a little with its friction: going one way it is straight otherwise than going the other way."""
    i, j = rng.choice(3, 2, replace=False)
    x = _scaled(h, "XYZ"[i])
    return (x**2 + rng.uniform(-0.6, 0.6) * x) * h.direction[:, h.column("XYZ"[i])] * h.normal[:, j]


def sunny_side(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The sun comes round: what faces it grows, and what faces away does not."""
    towards = unit(tuple(rng.normal(size=3)))
    return np.sin(np.pi * _part(h) * rng.uniform(0.7, 1.4)) ** 2 * np.maximum(h.normal @ towards, 0) ** 2


def product_of_places(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """A third axis errs by the product of two places, curved along the second one."""
    i, j, k = rng.permutation(3)
    x, y = _scaled(h, "XYZ"[i]), _scaled(h, "XYZ"[j])
    return x * np.sin(2.2 * y + rng.uniform(0, 6)) * h.normal[:, k]


def leaning_bearing(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The bearing of the turning axis leans to the side from which it was turned, and more at some angles."""
    sense = h.direction[:, h.column(a.turn)]
    lean = np.cross(unit(tuple(rng.normal(size=3) * [1, 1, 0.1])), h.point)
    return sense * (1 + 0.7 * np.cos(_axis(h, a.turn) + rng.uniform(0, 6))) * np.einsum("ni,ni->n", lean, h.normal_table)


def slipping_piece(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """Beyond a tilt the piece slips against a stop, and comes back only beyond another tilt."""
    q = _axis(h, a.tilt)
    low, high = np.quantile(np.unique(np.round(q, 4)), [rng.uniform(0.2, 0.4), rng.uniform(0.6, 0.8)])
    state, there = 0.0, np.zeros(len(h))
    for i, place in enumerate(q):
        state = 1.0 if place > high else 0.0 if place < low else state
        there[i] = state
    return there * _towards(h, rng, "table")


def hot_encoder(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The encoder of the turning axis warms with every turn and cools: its angle is wrong in proportion."""
    way = np.abs(np.diff(_axis(h, a.turn), prepend=_axis(h, a.turn)[:1]))
    tau, heat, state = np.ptp(h.time) * rng.uniform(0.08, 0.2), np.zeros(len(h)), 0.0
    for i, (step, gone) in enumerate(zip(np.diff(h.time, prepend=h.time[0]), way, strict=True)):
        state = state * np.exp(-step / tau) + gone
        heat[i] = state
    return heat * lever(h, a.turn)


def patched_scale(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The scale of an axis is glued of unequal pieces: a crooked sawtooth."""
    i = int(rng.integers(3))
    x = _scaled(h, "XYZ"[i])
    ends = np.concatenate([[-1], np.sort(rng.uniform(-0.8, 0.8, 3)), [1.0001]])
    piece = np.searchsorted(ends, x, side="right") - 1
    slopes = rng.normal(size=5)
    return slopes[piece] * (x - ends[piece]) * h.normal[:, i]


def late_lean(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """A column that warms ever faster leans: with the square of the time, and in proportion to its height."""
    side = h.normal[:, int(rng.integers(3))]
    return _part(h) ** 2 * _scaled(h, a.up) * side


def drooping_ram(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """What is far out droops, and more where the rotary axis that tilts brings the load over it."""
    i = int(rng.integers(3))
    return (1 + _scaled(h, "XYZ"[i])) ** 1.5 * np.cos(_axis(h, a.tilt) + rng.uniform(-1, 1)) * h.normal[:, "XYZ".index(a.up)]


def gusts(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """A gate opens and closes at odd times, and the machine leans away from the draught."""
    edges = np.sort(rng.uniform(0, 1, 6))
    return (np.searchsorted(edges, _part(h)) % 2) * _towards(h, rng)


LINEAR, TILT, TURN = ("X", "Y", "Z"), "tilt", "turn"
Kinds = Mapping[str, tuple[Kind, tuple[str, ...]]]
KINDS: Kinds = {
    kind.__name__: (kind, covariates)
    for kind, covariates in (
        (wind_up, (HISTORY, DIRECTION, TILT, TURN)),
        (falling_backlash, (DIRECTION, *LINEAR)),
        (backlash_by_height, (DIRECTION, *LINEAR)),
        (pre_sliding, (HISTORY, DIRECTION, *LINEAR)),
        (creeping_turn, (HISTORY, TIME, DIRECTION, TILT, TURN)),
        (pumping_counterbalance, (HISTORY, TIME)),
        (loosened_stylus, (TIME, PROBE, DIRECTION)),
        (two_way_straightness, (DIRECTION, *LINEAR)),
        (sunny_side, (TIME, DIRECTION)),
        (product_of_places, LINEAR),
        (leaning_bearing, (DIRECTION, TURN)),
        (slipping_piece, (TILT, HISTORY)),
        (hot_encoder, (HISTORY, TIME, TURN)),
        (patched_scale, LINEAR),
        (late_lean, (TIME, *LINEAR)),
        (drooping_ram, (TILT, *LINEAR)),
        (gusts, (TIME,)),
    )
}


@dataclass(frozen=True)
class Judged:
    """What became of a trial; a `twin` is a cause of the catalogue that imitates what is visible to 99 %."""

    machine: str
    kind: str
    peak: float  # mm
    seed: int
    verdict: str
    found: list[str]
    remains: list[str]
    events: list[str]
    dropped: list[str]
    right: bool
    twins: list[str]
    margin: float
    seconds: float


def hidden(name: str, kind: str, peak: float, seed: int, kinds: Kinds = KINDS) -> tuple[Array, Array, set[str]]:
    """machine, kind, visible peak mm, seed → (n,) mm early, without noise and with it; what imitates it even so.

    What the model takes itself but for a twentieth is imitated by the model.
    """
    s = trials.stage(name)
    eye, a = blind.eyes(s.bench), axes_of(s)
    rng = np.random.default_rng([79, seed])
    for _ in range(20):
        pattern = kinds[kind][0](s.history, rng, a)
        left = eye.outside @ pattern
        if np.linalg.norm(left) > 0.05 * np.linalg.norm(pattern) > 0 and not eye.twins(pattern):
            break
    pattern = pattern * (peak / np.abs(left).max())
    own = {"the model"} if np.linalg.norm(left) <= 0.05 * np.linalg.norm(pattern) else eye.twins(pattern)
    return pattern, pattern + blind.NOISE * rng.normal(size=len(pattern)), own


def tried(name: str, kind: str, peak: float, seed: int, kinds: Kinds = KINDS) -> Judged:
    """machine, kind, visible peak mm, seed → what the diagnosis makes of it."""
    began = time.process_time()
    s = trials.stage(name)
    _, early, twins = hidden(name, kind, peak, seed, kinds)
    if twins:
        return Judged(name, kind, peak, seed, "", [], [], [], [], False, sorted(twins), 0.0, 0.0)
    d = diagnose(s.bench.cell.machine, s.bench.cell.artefact, s.readings(early), s.bench.cell.terms)
    a = axes_of(s)
    wanted = {{TILT: a.tilt, TURN: a.turn}.get(w, w) for w in kinds[kind][1]}
    remains, events = [r.covariate for r in d.unexplained], trials.events(d)
    right = bool(remains) and trials.words(remains[0]) <= wanted
    right = right or (wanted == {TIME} and "window" in events and not remains)
    margin = 0.0 if d.outcome is None else d.outcome.by_names - d.outcome.by_shapes
    dropped = [f"{x.finding.cause}: {x.why}" for x in d.dropped]
    return Judged(
        *(name, kind, peak, seed, d.verdict, blind.names(d), remains, events, dropped, right),
        *([], margin, time.process_time() - began),
    )


def planned(
    start: int, seeds: int, chosen: Iterable[str] = KINDS, machines: Iterable[str] = MACHINES, kinds: Kinds = KINDS
) -> list[tuple[str, str, float, int]]:
    """first seed, how many of each, names of kinds, machines, all kinds → trials in random order."""
    every = [
        (m, k, peak, start + 10_000 * i + 1000 * j + 10 * round(1e3 * peak) + seed)
        for i, m in enumerate(MACHINES)
        for j, k in enumerate(kinds)
        for peak in PEAKS
        for seed in range(seeds)
        if m in machines and k in chosen
    ]
    return [every[i] for i in np.random.default_rng(start).permutation(len(every))]


def table(results: Sequence[Judged], kinds: Kinds = KINDS) -> list[str]:
    """results, kinds → lines: the rates, and a line a kind and machine; trials with twins are counted apart."""
    alone = [r for r in results if not r.twins]
    false = [r.verdict == "explained" and (bool(r.found) or not r.right) for r in alone]
    lines = [
        f"{'false explained':40} {blind.share(false)}",
        f"{'any false name':40} {blind.share([bool(r.found) for r in alone])}",
        f"{'right covariates':40} {blind.share([r.right for r in alone])}",
        f"{'nothing at all said':40} {blind.share([r.verdict == 'adequate' for r in alone])}",
        f"{'with a twin in the catalogue, not counted':40} {len(results) - len(alone)} of {len(results)}",
        f"{'seconds: median, largest':40} {np.median([r.seconds for r in results]):.1f}, {max(r.seconds for r in results):.1f}",
    ]
    for kind in kinds:
        for m in MACHINES:
            own = [r for r in alone if (r.kind, r.machine) == (kind, m)]
            told = Counter(
                f"{r.verdict[:5]} {'+'.join(r.found)}" + "".join(f" ?{x}" for x in r.remains) + "".join(f" !{x}" for x in r.events)
                for r in own
            )
            if own:
                lines.append(f"{kind:24} {m:10} " + "; ".join(f"{n} {what}" for what, n in told.most_common()))
    return lines


def recorded(file: Path) -> list[Judged]:
    """file → results."""
    return [Judged(**json.loads(line)) for line in file.read_text(encoding="utf-8").splitlines()]


if __name__ == "__main__":
    first, target = int(sys.argv[1]), Path(sys.argv[2])
    more = [x.split(",") for x in sys.argv[4:]]
    for one in planned(first, int(sys.argv[3]) if len(sys.argv) > 3 else 1, *more):
        with target.open("a", encoding="utf-8") as out:
            out.write(json.dumps(asdict(tried(*one))) + "\n")
    print("\n".join(table(recorded(target))))
