"""Blind trials of the diagnosis: effects that the simulated machine hides, drawn from seeds; only the readings are handed over."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from sim_controller.simulate import simulate
from tango_cnc.diagnose import Diagnosis, diagnose
from tango_cnc.files import read_cell, read_world
from tango_cnc.records import Cell, InputError, Readings, World

EXAMPLE = Path(__file__).parent.parent / "examples" / "hu40t"
NOISE = 0.0007  # mm
# Causes that the thesis' strategy with the terms S3 can see, and that are a pattern and not a spread.
DRAWN = (
    "thermal_drift",
    "table_drift",
    "table_growth",
    "scale_drift",
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


@dataclass(frozen=True)
class Bench:
    """A cell, its world without effects, and what it reads without effects and noise."""

    cell: Cell
    world: World
    clean: Readings


def bench() -> Bench:
    cell = read_cell(EXAMPLE)
    world = replace(read_world(EXAMPLE / "world.yaml"), effects=(), noise=0.0)
    return Bench(cell, world, simulate(cell.machine, cell.artefact, cell.strategy, world))


def draw(b: Bench, cause: str, rng: np.random.Generator) -> dict[str, Any]:
    """cause → its settings in world.yaml, amplitude 1 µm, 1 µrad or 1 µm/m."""
    run = float(np.ptp(b.clean.time))
    count = len(b.clean)
    towards = [float(x) for x in rng.normal(size=3)]
    axis, rotary = str(rng.choice(["X", "Y", "Z"])), str(rng.choice(["B", "C"]))
    phase = float(rng.uniform(0, 360))
    tau = {"tau": run * float(rng.uniform(0.15, 1.5))}
    settings: dict[str, dict[str, Any]] = {
        "thermal_drift": {"direction": towards, **tau},
        "table_drift": {"direction": towards, **tau},
        "table_growth": {"amplitude": 1e-6, **tau},
        "scale_drift": {"axis": axis, "amplitude": 1e-6, **tau},
        "ambient_cycle": {"direction": towards, "period": run / float(rng.uniform(1.5, 8)), "phase": phase},
        "step": {
            "direction": towards,
            "at": int(rng.integers(40, count - 40)),
            "frame": str(rng.choice(["machine", "table"])),
        },
        "move_length_memory": {"axis": axis, "length": float(rng.uniform(10, 150))},
        "encoder_harmonic": {"axis": rotary, "order": int(rng.integers(1, 4)), "amplitude": 1e-6, "phase": phase},
        "rotary_radial": {"axis": "C", "direction": towards, "order": int(rng.integers(2, 4)), "phase": phase},
        "rotary_axial": {"axis": "C", "order": int(rng.integers(1, 4)), "phase": phase},
        "rotary_tilt": {"axis": "C", "direction": towards, "order": int(rng.integers(1, 4)), "amplitude": 1e-6, "phase": phase},
        "gravity_sag": {"axis": "B", "direction": [[0, 1, 0], [0, 0, 1]][int(rng.integers(2))]},
        "probe_lobing": {"order": int(rng.integers(2, 4)), "phase": phase},
        "error_motion": {
            "name": f"E{rng.choice(list('ABC'))}{axis}",
            "degree": int(rng.integers(1, 4)),
            "amplitude": 1e-6,
            "span": 200.0,
        },
        "cyclic_error": {"axis": axis, "period": float(rng.choice([10, 12, 16, 20, 25, 40])), "phase": phase},
        "moving_mass": {"name": f"E{rng.choice(list('ABC'))}{axis}", "amplitude": 1e-6, "span": 200.0},
    }
    effect = {"cause": cause, "amplitude": 1e-3, **settings.get(cause, {})}
    if cause == "moving_mass":
        effect["by"] = str(rng.choice([a for a in "XYZ" if a != axis]))
    if cause == "compensation_kink":
        at = b.clean.position[:, b.cell.machine.column(axis)]
        low, high = float(at.min()), float(at.max())
        middle = low + (high - low) * float(rng.uniform(0.3, 0.7))
        del effect["amplitude"]
        effect |= {"axis": axis, "nodes": [low - 1, middle, high + 1], "values": [0.0, 1e-3, 0.0]}
    if cause == "chip":
        facet = str(rng.choice([f for f in b.cell.artefact.facets if b.clean.facet.count(f) > 8]))
        rows = [i for i, f in enumerate(b.clean.facet) if f == facet]
        effect |= {"facet": facet, "at": rows[int(rng.integers(3, len(rows) - 4))] + 1}
    return effect


def scaled(effect: dict[str, Any], factor: float) -> dict[str, Any]:
    """effect, factor → the same effect, so many times larger."""
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

    The visible part is what the fitted model cannot absorb of the change of the readings.
    """
    world = replace(b.world, effects=(scaled(effect, 1.0),))
    read = simulate(b.cell.machine, b.cell.artefact, b.cell.strategy, world)
    columns = [b.cell.machine.column(a) for a in "XYZ"]
    change = np.sum((read.position - b.clean.position)[:, columns] * normal, axis=1)
    left = outside @ change
    whole = float(np.linalg.norm(change))
    if whole == 0 or np.linalg.norm(left) < 0.05 * whole:
        return None
    factor = peak / float(np.abs(left).max())
    return Visible(scaled(effect, factor), change * factor)


@dataclass(frozen=True)
class Eyes:
    """What decides how large an effect looks: projector outside the model, direction in which X Y Z read the gap."""

    outside: np.ndarray
    normal: np.ndarray


def eyes(b: Bench) -> Eyes:
    from tango_cnc.diagnose._gain import residual_maker
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
    return Eyes(maker[:n, :n], normal)


def trial(
    b: Bench,
    eye: Eyes,
    causes: Sequence[str],
    peak: tuple[float, float],
    seed: int,
    excluded: Sequence[str] = (),
    noise: str = "white",
) -> tuple[list[Visible], Diagnosis] | None:
    """causes, range of visible peaks in mm, seed → effects hidden, diagnosis; None when the draw cannot be seen."""
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
    return effects, diagnose(b.cell.machine, b.cell.artefact, read, b.cell.terms, excluded)


def names(d: Diagnosis) -> list[str]:
    """diagnosis → names found, each once."""
    return list(dict.fromkeys(f.cause for f in d.findings))


# Where structure is expected to show when a cause is not in the catalogue.
COVARIATES = {
    "thermal_drift": ("time",),
    "table_drift": ("time",),
    "table_growth": ("time",),
    "scale_drift": ("time",),
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


def share(part: list[bool]) -> str:
    """outcomes → how many of how many, and per cent."""
    return f"{sum(part)}/{len(part)} = {100 * sum(part) / max(len(part), 1):.0f} %"


def campaign(n: int, say: Any = print, start: int = 0) -> dict[str, list[bool]]:
    """trials per case and cause, where to tell → outcomes by case; the confusion matrix is told on the way."""
    b = bench()
    eye = eyes(b)
    result: dict[str, list[bool]] = {}
    seed = start

    def tell(case: str, outcomes: list[bool], more: str = "") -> None:
        result.setdefault(case, []).extend(outcomes)
        say(f"{case:44} {share(outcomes):>16}  {more}", flush=True)

    for noise in ("white", "drift", "outliers"):
        found = []
        for _ in range(7 * n):
            seed += 1
            one = trial(b, eye, [], (0.0, 0.0), seed, noise=noise)
            assert one is not None
            found.append(names(one[1]))
        tell(f"nothing hidden, {noise}: nothing named", [not f for f in found], str([f for f in found if f]))
    within: list[bool] = []
    worth: list[bool] = []
    lengths: list[int] = []
    for peak in (0.003, 0.0015):
        right: list[bool] = []
        listed: list[bool] = []
        for cause in DRAWN:
            confused: Counter[str] = Counter()
            for _ in range(n):
                seed += 1
                one = trial(b, eye, [cause], (peak, peak), seed)
                if one is None:
                    continue
                hidden, d = one
                got = names(d)
                right.append(got[:1] == [cause] and len(got) == 1)
                also = [a for f in d.findings for a, _, _ in f.alternatives]
                listed.append(cause in got + also)
                lengths += [len({a for a, _, _ in f.alternatives}) for f in d.findings]
                confused["+".join(got) or d.verdict] += 1
                if cause in got and peak == 0.003:
                    _measured(hidden[0], d, cause, within, worth)
            say(f"    {1e3 * peak:.1f} µm {cause:22} {dict(confused)}", flush=True)
        tell(f"one cause, visible peak {1e3 * peak:.1f} µm: right name alone", right)
        tell(f"one cause, visible peak {1e3 * peak:.1f} µm: name or alternative", listed)
    tell("size within two standard deviations", within)
    tell("held-out gain at least 80 % of the truth's", worth, f"mean number of alternatives {np.mean(lengths or [0]):.2f}")
    rng = np.random.default_rng(start + 9)
    for count in (2, 3):
        exact = []
        for _ in range(10 * n):
            seed += 1
            drawn = [str(c) for c in rng.choice(DRAWN, count, replace=False)]
            one = trial(b, eye, drawn, (0.003, 0.006), seed)
            if one is not None:
                exact.append(sorted(names(one[1])) == sorted(drawn))
                if not exact[-1]:
                    say(f"    {drawn} → {names(one[1])} {[r.covariate for r in one[1].unexplained]}", flush=True)
        tell(f"{count} causes: exactly the right set", exact)
    honest: list[bool] = []
    covariate: list[bool] = []
    for cause in DRAWN:
        told = []
        for _ in range(n):
            seed += 1
            one = trial(b, eye, [cause], (0.003, 0.006), seed, (cause,))
            if one is not None:
                d = one[1]
                honest.append(not d.findings)
                covariate.append(any(r.covariate.startswith(COVARIATES[cause]) for r in d.unexplained))
                told.append("+".join(names(d)) or "/".join(r.covariate for r in d.unexplained) or d.verdict)
        say(f"    without {cause:22} {told}", flush=True)
    tell("cause not in the catalogue: no false name", honest)
    tell("cause not in the catalogue: right covariate", covariate)
    return result


def _measured(hidden: Visible, d: Diagnosis, cause: str, within: list[bool], worth: list[bool]) -> None:
    """Size against the truth on the touches (whatever it is called there), and gain against that of the true pattern."""
    from tango_cnc.diagnose._gain import measure, scattered
    from tango_cnc.model import known, linearise

    f = next(f for f in d.findings if f.cause == cause)
    if "direction" in hidden.effect and cause not in ("gravity_sag", "rotary_radial", "rotary_tilt"):
        truth = abs(hidden.effect["amplitude"])
        if f.setting.get("shape") != "linear":
            within.append(abs(f.size.amplitude - truth) < 2 * f.size.amplitude_std)
    elif f.size.values.size == 1:
        peak = float(np.abs(hidden.change).max())
        mine = f.size.amplitude * peak / max(float(np.abs(f.pattern).max()), 1e-12)
        told = float(np.abs(f.pattern).max())
        within.append(abs(told - peak) < 2 * f.size.amplitude_std * told / max(mine, 1e-12) + 0.02 * peak)
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
