"""Blind trials of the diagnosis: effects that the simulated machine hides, drawn from seeds; only the readings are handed over.

python tests/support/blind.py 3 500000 trials.jsonl     three rounds with seeds from 500000 on, appended; then the table of the file

TANGO_STRATEGY=plan.yaml: the HU40T touches that strategy instead of its own, for a plan of 'tango design'.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from itertools import combinations, pairwise, permutations
from pathlib import Path
from typing import Any

import numpy as np

from sim_controller import effects as simulated
from sim_controller.simulate import simulate
from tango_cnc import terms
from tango_cnc.diagnose import Diagnosis, diagnose
from tango_cnc.files import read_cell, read_strategy, read_world
from tango_cnc.records import Cell, InputError, Readings, World

EXAMPLES = Path(__file__).parents[2] / "examples"
EXAMPLE = EXAMPLES / "hu40t"
OTHERS = ("trunnion", "fork_head", "huron")
NOISE = 0.0007  # mm
# Causes that the thesis' strategy with the terms S3 can see, and that are a pattern and not a spread. Their order decides what a
# seed draws; a cause that is new comes behind them by itself.
FIRST = (
    "thermal_drift",
    "table_drift",
    "table_growth",
    "scale_drift",
    "screw_heat",
    "ambient_cycle",
    "step",
    "move_length_memory",
    "probe_hysteresis",
    "first_touch",
    "encoder_harmonic",
    "rotary_radial",
    "rotary_axial",
    "rotary_tilt",
    "gravity_sag",
    "probe_lobing",
    "pretravel_anisotropy",
    "error_motion",
    "cyclic_error",
    "compensation_kink",
    "moving_mass",
    "chip",
)
LOCATIONS = ("EB0Z", "EC0Y", "EA0Y", "EX0S", "EY0S", "EA0B", "EC0B", "EX0C", "EA0C", "EB0C")
S3 = ("EXX1", "EYY1", "EZZ1", *LOCATIONS, "EXXb", "EYYb", "EBBb", "ECCb")  # of the HU40T
LARGEST = ((1e-4, 0.1), (0.0, 1e-3))  # mm; rad, mm/mm: what no machine has would be needed to see it, by the least drawn amplitude
PLAY = ("EXXb", "EYYb", "EZZb")
RARE = ("swapped_facets", "backlash")  # drawn alone: one has the size that it has, the other one is in S3
UNDRAWN = simulated.stated("UNDRAWN")  # a file of an effect says why it is not drawn
DRAWN = (*FIRST, *sorted({*terms.patterns()} & {*simulated.names()} - {*FIRST, *RARE, *UNDRAWN}))
TWIN = 0.99  # part of a visible pattern that another cause explains as well: nobody can tell these two


@dataclass(frozen=True, eq=False)
class Bench:
    """A cell, its world without effects, and what it reads without effects and noise."""

    cell: Cell
    world: World
    clean: Readings


@cache
def bench(name: str = "hu40t", backlash: bool = True) -> Bench:
    """name of an example, whether S3 keeps the backlash of its axes → bench."""
    cell = read_cell(EXAMPLES / name)
    if name == "hu40t" and (other := os.environ.get("TANGO_STRATEGY")):
        cell = replace(cell, strategy=read_strategy(Path(other), cell.machine, cell.artefact))
    if not backlash:
        cell = replace(cell, terms=tuple(t for t in S3 if t not in PLAY))
    world = replace(read_world(EXAMPLES / name / "world.yaml"), effects=(), noise=0.0)
    if not backlash:
        world = replace(world, errors={k: v for k, v in world.errors.items() if k not in PLAY})
    return Bench(cell, world, simulate(cell.machine, cell.artefact, cell.strategy, world))


def draw(b: Bench, cause: str, rng: np.random.Generator) -> dict[str, Any]:
    """cause → its settings in world.yaml, amplitude 1 µm, 1 µrad or 1 µm/m."""
    run = float(np.ptp(b.clean.time))
    count = len(b.clean)
    edge = min(40, count // 4)
    towards = [float(x) for x in rng.normal(size=3)]
    machine = b.cell.machine
    axis, rotary = str(rng.choice(["X", "Y", "Z"])), str(rng.choice(sorted(machine.rotary)))
    reach = {a: float(np.ptp(b.clean.position[:, machine.column(a)])) for a in machine.rotary}
    tilting, turning = min(reach, key=lambda a: reach[a]), max(reach, key=lambda a: reach[a])
    phase = float(rng.uniform(0, 360))
    tau = {"tau": run * float(rng.uniform(0.15, 1.5))}
    along = b.clean.position[:, machine.column(axis)]
    held_at = float(
        along.min() - phase / 1200 * np.ptp(along)
    )  # as far behind the end as the phase says: no draw of another changes
    settings: dict[str, dict[str, Any]] = {
        "thermal_drift": {"direction": towards, **tau},
        "table_drift": {"direction": towards, **tau},
        "table_growth": {"amplitude": 1e-6, **tau},
        "scale_drift": {"axis": axis, "amplitude": 1e-6, **tau},
        "screw_heat": {"axis": axis, "amplitude": 1e-6, "tau": tau["tau"] / 5, "zero": held_at},
        "ambient_cycle": {"direction": towards, "period": run / float(rng.uniform(1.5, 8)), "phase": phase},
        "step": {
            "direction": towards,
            "at": int(rng.integers(edge, count - edge)),
            "frame": str(rng.choice(["machine", "table"])),
        },
        "move_length_memory": {"axis": axis, "shape": "exponential", "length": float(rng.uniform(10, 150))},
        "encoder_harmonic": {"axis": rotary, "order": int(rng.integers(1, 4)), "amplitude": 1e-6, "phase": phase},
        "rotary_radial": {"axis": turning, "direction": towards, "order": int(rng.integers(2, 4)), "phase": phase},
        "rotary_axial": {"axis": turning, "order": int(rng.integers(1, 4)), "phase": phase},
        "rotary_tilt": {"axis": turning, "direction": towards, "order": int(rng.integers(1, 4)), "amplitude": 1e-6, "phase": phase},
        "gravity_sag": {"axis": tilting, "direction": [[0, 1, 0], [0, 0, 1]][int(rng.integers(2))]},
        "probe_lobing": {"order": int(rng.integers(2, 4)), "phase": phase},
        "error_motion": {
            "name": f"E{rng.choice(list('ABC'))}{axis}",
            "degree": int(rng.integers(1, 4)),
            "amplitude": 1e-6,
            "span": 200.0,
        },
        "cyclic_error": {"axis": axis, "period": float(rng.choice([10, 12, 16, 20, 25, 40])), "phase": phase},
        "backlash": {"axis": axis},
        "moving_mass": {"name": f"E{rng.choice(list('ABC'))}{axis}", "amplitude": 1e-6, "span": 200.0},
    }
    effect = {"cause": cause, "amplitude": 1e-3, **settings.get(cause, {})}
    if cause not in FIRST and cause not in settings:
        effect = {"cause": cause, **simulated.example(cause)}
    if cause == "moving_mass":
        effect["by"] = str(rng.choice([a for a in "XYZ" if a != axis]))
    if cause == "compensation_kink":
        at = b.clean.position[:, b.cell.machine.column(axis)]
        low, high = float(at.min()), float(at.max())
        middle = low + (high - low) * float(rng.uniform(0.3, 0.7))
        del effect["amplitude"]
        effect |= {"axis": axis, "nodes": [low - 1, middle, high + 1], "values": [0.0, 1e-3, 0.0]}
    if cause == "chip":
        often = min(9, max(map(b.clean.facet.count, b.cell.artefact.facets)))  # touches of a facet; fewer in a short plan
        facet = str(rng.choice([f for f in b.cell.artefact.facets if b.clean.facet.count(f) >= often]))
        rows = [i for i, f in enumerate(b.clean.facet) if f == facet]
        effect |= {"facet": facet, "at": rows[int(rng.integers(3, len(rows) - 4)) if often > 8 else often // 2] + 1}
    if cause == "swapped_facets":
        one, two, rows = alike(b)[int(rng.integers(len(alike(b))))]
        effect = {"cause": cause, "facets": [one, two], "at": min(rows) + 1, "until": max(rows) + 1}
    return effect


@cache
def alike(b: Bench) -> list[tuple[str, str, list[int]]]:
    """bench → two facets of one plane that are touched at the same indexation, and the touches of that indexation."""
    found = []
    turned = np.round(b.clean.position[:, [b.cell.machine.column(a) for a in b.cell.machine.rotary]], 6)
    begins = [0, *(np.flatnonzero(np.any(np.diff(turned, axis=0) != 0, axis=1)) + 1).tolist(), len(b.clean)]
    for first, last in pairwise(begins):
        here = [f for f in dict.fromkeys(b.clean.facet[first:last]) if f in b.world.facets]
        for one, two in combinations(here, 2):
            a, c = b.cell.artefact.facets[one], b.cell.artefact.facets[two]
            apart = np.subtract(a.point, c.point) @ np.array(a.normal)
            if np.dot(a.normal, c.normal) > 0.999 and abs(apart) < 1e-6:
                found.append((one, two, list(range(first, last))))
    return found


def scaled(effect: dict[str, Any], factor: float) -> dict[str, Any]:
    """effect, factor → the same effect, so many times larger."""
    if effect["cause"] == "swapped_facets":
        return effect
    if "values" in effect:
        return effect | {"values": [v * factor for v in effect["values"]]}
    return effect | {"amplitude": effect["amplitude"] * factor}


@dataclass(frozen=True)
class Visible:
    """An effect as large as wanted, and what it does to the gap of every touch."""

    effect: dict[str, Any]
    change: np.ndarray  # (n,) mm


def visible(b: Bench, effect: dict[str, Any], peak: float, outside: np.ndarray, normal: np.ndarray) -> Visible | None:
    """effect, wanted visible peak in mm, projector (n, n), normals (n, 3) → scaled effect, None when it cannot be seen.

    The visible part is what the fitted model cannot absorb of the change of the readings. What would have to be a hundred times
    as large as on any machine cannot be seen.
    """
    if effect["cause"] == "swapped_facets":
        return _exchanged(b, effect, peak, outside)
    world = replace(b.world, effects=(scaled(effect, 1.0),))
    read = simulate(b.cell.machine, b.cell.artefact, b.cell.strategy, world)
    columns = [b.cell.machine.column(a) for a in "XYZ"]
    change = np.sum((read.position - b.clean.position)[:, columns] * normal, axis=1)
    left = outside @ change
    whole = float(np.linalg.norm(change))
    if whole == 0 or np.linalg.norm(left) < 0.05 * whole:
        return None
    factor = peak / float(np.abs(left).max())
    drawn = abs(effect.get("amplitude", 0.0))
    if drawn and factor * drawn > next(most for least, most in LARGEST if drawn > least):
        return None
    return Visible(scaled(effect, factor), change * factor)


def _exchanged(b: Bench, effect: dict[str, Any], peak: float, outside: np.ndarray) -> Visible | None:
    """An exchange is as large as the two offsets differ: wanted is at least that peak."""
    one, two = effect["facets"]
    inside = np.arange(1, len(b.clean) + 1)
    facet = np.array(b.clean.facet)
    on = ((inside >= effect["at"]) & (inside <= effect["until"])) * ((facet == one).astype(float) - (facet == two))
    change = on * (b.world.facets[one] - b.world.facets[two])
    return Visible(effect, change) if np.abs(outside @ change).max() >= peak else None


@dataclass(frozen=True)
class Eyes:
    """What decides how large an effect looks: projector outside the model, direction in which X Y Z read the gap, and
    the patterns of the catalogue as the model leaves them (orthonormal, by cause).
    """

    outside: np.ndarray
    normal: np.ndarray
    patterns: tuple[tuple[str, np.ndarray], ...]

    def twins(self, change: np.ndarray) -> set[str]:
        """(n,) → causes that explain what is visible of it as well as its own cause."""
        left = self.outside @ change
        return {cause for cause, q in self.patterns if np.sum((q.T @ left) ** 2) > TWIN * np.sum(left**2)}


@cache
def eyes(b: Bench) -> Eyes:
    from support.diagnosis_parts import named, residual_maker
    from tango_cnc.estimate import estimate
    from tango_cnc.kinematics import Slot
    from tango_cnc.model import known, linearise

    e = estimate(b.cell.machine, b.cell.artefact, b.clean, b.cell.terms)
    _, jacobian = linearise(e.model, e.values)
    _, rows, uncertainty = known(e.model, e.values)
    maker = residual_maker(np.vstack([jacobian, rows * (NOISE / uncertainty)[:, None]]))
    touches = e.model.touches
    normal = np.column_stack([touches.seen.slots[Slot(a, "motion")] for a in "XYZ"])
    n = len(touches)
    outside = maker[:n, :n]
    patterns = []
    for c in named(touches, e.model.names, ("swapped_facets", "chip")):
        left = outside @ c.columns
        if np.linalg.norm(left) > 0.02 * np.linalg.norm(c.columns):
            u, s, _ = np.linalg.svd(left, full_matrices=False)
            patterns.append((c.cause, u[:, s > 1e-6 * s[0]]))
    return Eyes(outside, normal, tuple(patterns))


def trial(
    b: Bench,
    eye: Eyes,
    causes: Sequence[str],
    peak: tuple[float, float],
    seed: int,
    excluded: Sequence[str] = (),
    noise: str = "white",
) -> tuple[list[Visible], Diagnosis] | None:
    """causes, range of visible peaks in mm, seed → effects hidden, diagnosis; None when the draw cannot be seen.

    With an excluded cause go its twins: who takes away a name takes away the pattern.
    """
    rng = np.random.default_rng([1234, seed])
    effects = []
    for cause in causes:
        for _ in range(6):
            try:
                found = visible(b, draw(b, cause, rng), float(rng.uniform(*peak)), eye.outside, eye.normal)
            except InputError:
                continue
            if found is not None:
                effects.append(found)
                break
        else:
            return None
    disturbing: list[dict[str, Any]] = []
    if noise == "drift":
        disturbing = [{"cause": "random_walk", "amplitude": 0.002}]
    if noise == "outliers":
        disturbing = [{"cause": "outliers", "amplitude": 0.02, "rate": 0.02}]
    world = replace(b.world, effects=(*(e.effect for e in effects), *disturbing), noise=NOISE)
    read = simulate(b.cell.machine, b.cell.artefact, b.cell.strategy, world, seed=seed)
    without = set(excluded).union(*(eye.twins(e.change) for e in effects)) if excluded else set()
    return effects, diagnose(b.cell.machine, b.cell.artefact, read, b.cell.terms, sorted(without))


def names(d: Diagnosis) -> list[str]:
    """diagnosis → names found, each once."""
    return list(dict.fromkeys(f.cause for f in d.findings))


# Where structure is expected to show when a cause is not in the catalogue. Of one that is not listed: where its picture shows it.
COVARIATES = {
    "thermal_drift": ("time",),
    "table_drift": ("time",),
    "table_growth": ("time",),
    "scale_drift": ("time",),
    "screw_heat": ("way of", "time"),
    "ambient_cycle": ("time",),
    "step": ("time",),
    "move_length_memory": ("way of",),
    "probe_hysteresis": ("previous touch",),
    "first_touch": ("first touch",),
    "encoder_harmonic": ("B", "C"),
    "rotary_radial": ("C",),
    "rotary_axial": ("C",),
    "rotary_tilt": ("C",),
    "gravity_sag": ("B",),
    "probe_lobing": ("probe direction",),
    "pretravel_anisotropy": ("probe direction",),
    "error_motion": ("X", "Y", "Z"),
    "cyclic_error": ("X", "Y", "Z"),
    "compensation_kink": ("X", "Y", "Z"),
    "moving_mass": ("X", "Y", "Z"),
    "chip": ("facet",),
}
OVER = {"time": ("time",), "probe": ("probe direction",), "": ("X", "Y", "Z", "B", "C")}


def expected(cause: str) -> tuple[str, ...]:
    """cause → the covariates by one of which its shape has to go where it is taken out of the catalogue."""
    return COVARIATES.get(cause) or OVER[terms.causes()[cause].over]


@dataclass(frozen=True)
class Trial:
    """One trial of the campaign."""

    case: str
    machine: str
    causes: tuple[str, ...]
    peak: tuple[float, float]  # mm
    seed: int
    noise: str = "white"
    excluded: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """What became of a trial; `seconds` of the processor."""

    trial: Trial
    hidden: list[dict[str, Any]]
    found: list[str]
    alternatives: list[list[str]]  # of every finding
    remains: list[str]  # covariates of what has no name
    within: list[bool]
    worth: list[bool]
    seconds: float
    twins: list[list[str]] = field(default_factory=list)  # of every hidden effect, other causes that nobody can tell from it
    calls: list[list[str]] = field(default_factory=list)  # of every finding, its name and its alternatives
    verdict: str = ""


NULL, ONE, SMALL, TWO, THREE, TAKEN, OTHER, OTHER_NULL = (
    "nothing hidden",
    "one cause, visible peak 3 µm",
    "one cause, visible peak 1.5 µm",
    "two causes",
    "three causes",
    "cause taken out of the catalogue",
    "other machines, one cause, visible peak 3 µm",
    "other machines, nothing hidden",
)


TELLING = "exactly the right names, a twin with the right name beside it and nothing explained"


def one_round(start: int) -> Iterator[Trial]:
    """first seed → trials of every case in proportion, about 130."""
    rng = np.random.default_rng(start)
    seed = start
    planned: list[tuple[Any, ...]] = []
    planned += [(NULL, "hu40t", (), (0.0, 0.0), noise) for noise in ("white", "drift", "outliers") for _ in range(8)]
    for case, peak in ((ONE, 0.003), (SMALL, 0.0015)):
        planned += [(case, "hu40t", (cause,), (peak, peak), "white") for cause in (*DRAWN, *RARE)]
    for case, count in ((TWO, 2), (THREE, 3)):
        planned += [
            (case, "hu40t", tuple(str(c) for c in rng.choice(DRAWN, count, replace=False)), (0.003, 0.006), "white")
            for _ in range(12)
        ]
    planned += [(TAKEN, "hu40t", (cause,), (0.003, 0.006), "white") for cause in DRAWN]
    for name in OTHERS:
        planned += [(OTHER, name, (str(c),), (0.003, 0.003), "white") for c in rng.choice(DRAWN, 3, replace=False)]
        planned += [(OTHER_NULL, name, (), (0.0, 0.0), "white") for _ in range(2)]
    for case, machine, causes, peak, noise in planned:
        seed += 1
        yield Trial(case, machine, causes, peak, seed, noise, causes if case == TAKEN else ())


def tried(t: Trial) -> Outcome | None:
    """trial → outcome; None when its draw cannot be seen."""
    began = time.process_time()
    b = bench(t.machine, "backlash" not in t.causes)
    eye = eyes(b)
    one = trial(b, eye, t.causes, t.peak, t.seed, t.excluded, t.noise)
    if one is None:
        return None
    hidden, d = one
    within: list[bool] = []
    worth: list[bool] = []
    if t.case == ONE and t.causes[0] in names(d):
        _measured(eye, hidden[0], d, t.causes[0], within, worth)
    others = [list(dict.fromkeys(a for a, _, _ in f.alternatives)) for f in d.findings]
    remains = [r.covariate for r in d.unexplained]
    twins = [sorted(eye.twins(h.change) - {h.effect["cause"]}) for h in hidden]
    calls = [[f.cause, *alike] for f, alike in zip(d.findings, others, strict=True)]
    seconds = time.process_time() - began
    return Outcome(t, [h.effect for h in hidden], names(d), others, remains, within, worth, seconds, twins, calls, d.verdict)


def judged(outcomes: Sequence[Outcome]) -> dict[str, list[bool]]:
    """outcomes → by row of the table, whether each trial is what is wanted."""
    rows: dict[str, list[bool]] = {}

    def tell(row: str, *good: bool) -> None:
        rows.setdefault(row, []).extend(good)

    for o in outcomes:
        case, causes = o.trial.case, list(o.trial.causes)
        if case == NULL:
            tell(f"{case}, {o.trial.noise}: nothing named", not o.found)
        elif case == OTHER_NULL:
            tell(f"{case}: nothing named", not o.found)
        elif case == TAKEN:
            tell(f"{case}: no false name", not o.found)
            tell(f"{case}: right covariate", any(r.startswith(expected(causes[0])) for r in o.remains))
        else:
            tell(f"{case}: exactly the right name" + ("s" if len(causes) > 1 else ""), sorted(o.found) == sorted(causes))
        if case in (TWO, THREE):
            tell(f"{case}: the right names, or they are among the alternatives", _covered(o))
            tell(f"{case}: {TELLING}", tellable(o))
        if case in (ONE, SMALL, OTHER):
            tell(f"{case}: right name first", o.found[:1] == causes)
            tell(f"{case}: right name or among the alternatives", causes[0] in [*o.found, *(a for x in o.alternatives for a in x)])
        if case == ONE:
            tell("size within two of its standard deviations", *o.within)
            tell("held-out gain at least 80 % of that of the true pattern", *o.worth)
    return rows


def _covered(o: Outcome) -> bool:
    """outcome → whether each finding stands for another one of the causes that were hidden, by its name or an alternative."""
    told = [{name, *others} for name, others in zip(o.found, o.alternatives, strict=False)]
    return len(told) == len(o.trial.causes) and any(
        all(cause in one for cause, one in zip(causes, told, strict=True)) for causes in permutations(o.trial.causes)
    )


def tellable(o: Outcome) -> bool:
    """outcome → whether each finding has the name of another one of the causes that were hidden. Where a twin of it has its place,
    which no touch tells from it, the right name has to be an alternative, and the verdict not `explained`.
    """

    def right(call: list[str], cause: str, twins: list[str]) -> bool:
        return call[0] == cause or (call[0] in twins and cause in call and o.verdict != "explained")

    causes = list(zip(o.trial.causes, o.twins, strict=False))
    return len(o.calls) == len(causes) and any(
        all(right(call, *cause) for call, cause in zip(o.calls, order, strict=True)) for order in permutations(causes)
    )


def confusion(outcomes: Sequence[Outcome]) -> list[str]:
    """outcomes → a line for every hidden cause and case with one: what it was called, how often."""
    lines = []
    for case in (ONE, SMALL, OTHER, TAKEN):
        for cause in (*DRAWN, *RARE):
            called = Counter(
                "+".join(o.found) or ("unexplained: " + ", ".join(o.remains) if o.remains else "nothing")
                for o in outcomes
                if o.trial.case == case and o.trial.causes == (cause,)
            )
            if called:
                lines.append(f"{case:46} {cause:22} " + ", ".join(f"{n} {what}" for what, n in called.most_common()))
    for case in (NULL, OTHER_NULL, TWO, THREE):
        lines += [
            f"{case:46} {'+'.join(o.trial.causes) or o.trial.noise} → {'+'.join(o.found) or 'nothing'} {o.remains or ''}"
            for o in outcomes
            if o.trial.case == case and sorted(o.found) != sorted(o.trial.causes)
        ]
    return lines


def share(part: Sequence[bool]) -> str:
    """outcomes → how many of how many, and per cent."""
    return f"{sum(part)} of {len(part)} = {100 * sum(part) / max(len(part), 1):.0f} %"


def table(outcomes: Sequence[Outcome]) -> list[str]:
    """outcomes → lines of the table, of the confusion matrix, and what it cost."""
    others = [len(x) for o in outcomes if o.trial.case in (ONE, SMALL) for x in o.alternatives]
    seconds = np.array([o.seconds for o in outcomes])
    return [
        *(f"{row:70} {share(part)}" for row, part in judged(outcomes).items()),
        f"{'mean number of alternatives of a finding':70} {np.mean(others or [0]):.2f} of {len(others)}",
        f"{'processor time of a trial, s: median, largest':70} {np.median(seconds):.1f}, {seconds.max():.1f}",
        "",
        *confusion(outcomes),
    ]


def campaign(rounds: int, start: int, file: Path | None = None) -> list[Outcome]:
    """rounds, first seed, file to append to → outcomes. A round has a thousand seeds to itself."""
    outcomes = []
    for number in range(rounds):
        for t in one_round(start + 1000 * number):
            o = tried(t)
            if o is None:
                continue
            outcomes.append(o)
            if file is not None:
                with file.open("a", encoding="utf-8") as out:
                    out.write(json.dumps(asdict(o)) + "\n")
    return outcomes


def recorded(file: Path) -> list[Outcome]:
    """file of `campaign` → outcomes."""
    found = []
    for line in file.read_text(encoding="utf-8").splitlines():
        data = json.loads(line)
        t = data.pop("trial")
        tuples = {k: tuple(t[k]) for k in ("causes", "peak", "excluded")}
        found.append(Outcome(Trial(**{**t, **tuples}), **data))
    return found


def _measured(eye: Eyes, hidden: Visible, d: Diagnosis, cause: str, within: list[bool], worth: list[bool]) -> None:
    """Size against the truth on the touches (whatever it is called there), and gain against that of the true pattern."""
    from support.diagnosis_parts import measure, scattered
    from tango_cnc.model import known, linearise

    f = next(f for f in d.findings if f.cause == cause)
    if "direction" in hidden.effect and cause not in ("gravity_sag", "rotary_radial", "rotary_tilt"):
        truth = abs(hidden.effect["amplitude"])
        if f.setting.get("shape") != "linear":
            within.append(abs(f.size.amplitude - truth) < 2 * f.size.amplitude_std)
    elif f.size.values.size == 1:
        # What the model absorbs of a pattern has no size: the visible parts are compared.
        peak, told = (float(np.abs(eye.outside @ x).max()) for x in (hidden.change, f.pattern))
        spread = f.size.amplitude_std / max(f.size.amplitude, 1e-12)
        within.append(abs(told - peak) < 2 * spread * told + 0.02 * peak)
    e = d.before
    gaps, jacobian = linearise(e.model, e.values)
    distance, rows, uncertainty = known(e.model, e.values)
    base = np.vstack([jacobian, rows * (e.sigma / uncertainty)[:, None]])
    data = np.concatenate([gaps, distance * e.sigma / uncertainty])
    n = len(gaps)
    schemes = {"indexations": e.model.touches.indexation, "scattered": scattered(n)}
    truth_gain = measure(base, data, hidden.change[:, None], schemes, np.ones(n, dtype=bool), np.random.default_rng(1))
    assert f.gain is not None
    mine_before, mine_after = f.gain.schemes["scattered"]
    best_before, best_after = truth_gain.schemes["scattered"]
    worth.append(mine_before - mine_after > 0.8 * (best_before - best_after))


if __name__ == "__main__":
    campaign(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))
    print("\n".join(table(recorded(Path(sys.argv[3])))))
