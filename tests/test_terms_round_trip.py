"""What `diagnose` writes is taken everywhere: for every cause, the term goes into `estimate`, `verify` and tango.yaml, and what
was estimated goes into world.yaml, where the simulated machine (which shares no mathematics with it) does the same to the touches.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import yaml
from support import blind
from support.diagnosis_parts import candidate
from support.few import every

from sim_controller.effects import names as simulated
from sim_controller.simulate import simulate
from tango_cnc import terms
from tango_cnc.diagnose import Diagnosis
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import read_terms
from tango_cnc.records import InputError, Readings
from tango_cnc.touches import Touches
from tango_cnc.verify.held_out import held_out

# The course of one facet over time, and waves of a rotary axis beside those of a linear one.
COURSE = [
    {"covariate": "facet 13", "kind": "side", "low": 0.0, "high": 1.0, "count": 1},
    {"covariate": "time", "kind": "polynomial", "low": 0.0, "high": 9000.0, "count": 2},
]
WAVES = [
    {"covariate": "X", "kind": "polynomial", "low": -300.0, "high": 300.0, "count": 1},
    {"covariate": "C", "kind": "turn", "low": -1000.0, "high": 1000.0, "count": 2},
]
# What the path of a rotary axis leaves wound up.
WOUND = [{"covariate": "path of C 120", "kind": "polynomial", "low": -1.0, "high": 1.0, "count": 2}]
PATTERNS = sorted(terms.patterns())
# Settings for causes of which this plan's touches offer none, or not the one that has to be looked at.


def of(covariate: str, low: float = -1.0, high: float = 1.0) -> dict[str, Any]:
    """covariate, its range → a straight line over it."""
    return {"covariate": covariate, "kind": "polynomial", "low": low, "high": high, "count": 1}


SETTINGS: dict[str, list[dict[str, Any]]] = {
    "compensation_kink": [{"axis": "X", "at": 20.0}, {"axis": "Y", "nodes": [-80.0, 30.0]}, {"axis": "B", "at": 15.0}],
    "gravity_sag": [{"axis": "B", "component": c} for c in ("X", "Z", "XYZ", "A", "B")],
    "rotary_radial": [{"axis": "C", "order": 3}, {"axis": "B", "order": 2, "motion": "X", "frame": "fixed"}],
    "rotary_tilt": [{"axis": "C", "order": 2}, {"axis": "B", "order": 1, "motion": "A", "frame": "fixed"}],
    "error_motion": [{"name": "EBX2"}, {"name": "EYX3"}, {"name": "ECC2"}],
    "moving_mass": [{"name": "EAZ", "by": "Y"}, {"name": "EBX", "by": "B"}],
    "step": [{"at": 150, "frame": "machine"}, {"at": 150, "frame": "table"}],
    "probe_hysteresis": [{"frame": "spindle"}],
    "pulse": [{"at": 100, "until": 140}, {"at": 100, "until": 140, "frame": "table"}, {"at": 50, "until": 58, "axis": "C"}],
    "backlash": [{"axis": "Y"}],
    "learned": [
        dict(terms.causes()["learned"].example),
        {"name": "face", "factors": COURSE, "weight": "none", "values": [1.0, -0.5, 0.2]},
        {"name": "hoses", "factors": WOUND, "weight": "axis C", "values": [1.0, 0.3]},
        {"name": "post", "factors": [of("normal z, table"), of("B")], "weight": "none", "values": [0.5, 1.0, -0.3]},
        {
            "name": "warp",
            "factors": [of("place x, table", -250, 250), of("time", 0, 1800)],
            "weight": "table z",
            "values": [0.5, 1, -0.3],
        },
        {"name": "rested", "factors": [of("pause", 1, 5), of("Y", -200, 200)], "weight": "machine z", "values": [0.5, 1.0, -0.3]},
        {
            "name": "loaded",
            "factors": [
                {"covariate": "dY", "kind": "side", "low": -1.0, "high": 1.0, "count": 1},
                {"covariate": "B", "kind": "even", "low": 0.0, "high": 1.6, "count": 2},
            ],
            "weight": "machine y",
            "values": [0.5, 1.0, -0.3],
        },
        {
            "name": "pad",
            "factors": [{"covariate": "C", "kind": "beyond", "low": 0.4, "high": 4.7, "count": 1}],
            "weight": "table",
            "values": [1.0, -0.5, 0.2],
        },
        {"name": "wound", "factors": WAVES, "weight": "machine z", "values": [0.3, 1.0, -0.5, 0.2, 0.6]},
    ],
    "ambient_cycle": [{"period": 600.0}],
}
# In the simulated machine these do something else than a shift of every touch by so much.
ELSEWHERE = {"spindle_orientation": "turns the spindle", "swapped_facets": "exchanges the names of two facets"}


@pytest.fixture(scope="module")
def bench() -> blind.Bench:
    return blind.bench()


@pytest.fixture(scope="module")
def fitted(bench: blind.Bench) -> Estimate:
    return estimate(bench.cell.machine, bench.cell.artefact, bench.clean, bench.cell.terms)


def settings(name: str, touches: Touches) -> list[dict[str, Any]]:
    cause = terms.causes()[name]
    return SETTINGS.get(name) or list(cause.variants(touches))[:1] or [dict(cause.example)]


def changed(bench: blind.Bench, effects: list[dict[str, Any]]) -> np.ndarray:
    """→ (n,) mm by which each surface is read early with these effects."""
    world = replace(bench.world, effects=tuple(effects))
    read = simulate(bench.cell.machine, bench.cell.artefact, bench.cell.strategy, world)
    columns = [bench.cell.machine.column(a) for a in "XYZ"]
    return np.asarray(np.sum((read.position - bench.clean.position)[:, columns] * blind.eyes(bench).normal, axis=1))


@pytest.mark.few(0)
@pytest.mark.parametrize("name", every((n for n in PATTERNS if n not in ("cylinder_cosine", *ELSEWHERE)), 3))
def test_what_was_estimated_does_the_same_in_the_simulated_machine(name: str, bench: blind.Bench, fitted: Estimate) -> None:
    touches, machine = fitted.model.touches, bench.cell.machine
    rng = np.random.default_rng(8)
    compared = 0
    for setting in (offered := settings(name, touches)):
        columns = candidate(touches, name, setting).columns
        values = rng.normal(size=columns.shape[1])
        if not np.abs(columns @ values).max():
            continue
        compared += 1
        values *= 1e-3 / np.abs(columns @ values).max()
        effects = terms.effects(name, machine, setting, values)
        missing = {str(effect["cause"]) for effect in effects} - set(simulated())
        assert effects and not missing, f"write sim_controller/effects/{name}.py (docs/effects.md, One more)"
        change = changed(bench, yaml.safe_load(yaml.safe_dump(effects)))
        assert np.abs(change - columns @ values).max() < 0.02 * np.abs(change).max(), (
            f"tango_cnc/terms/{name}.py: its `effects` are not done by sim_controller/effects/{name}.py: {setting}, {effects}"
        )
    assert compared, f"{offered} moves no touch of this plan: state another `example` in tango_cnc/terms/{name}.py"


@pytest.mark.few(4)
@pytest.mark.parametrize("name", sorted(terms.causes()))
def test_every_term_goes_through_the_file_into_the_estimate(name: str, bench: blind.Bench, fitted: Estimate) -> None:
    touches, module = fitted.model.touches, terms.causes()[name]
    offered = settings(name, touches) if name in PATTERNS else [module.fitted(touches)]
    for setting in offered:
        item = {"cause": name, **setting}
        text = yaml.safe_dump([*bench.cell.terms, {k: list(v) if isinstance(v, tuple) else v for k, v in item.items()}])
        again = read_terms(yaml.safe_dump(yaml.safe_load(text), default_flow_style=True, width=10_000), None)
        found = estimate(bench.cell.machine, bench.cell.artefact, bench.clean, again)
        expected = {c.name for c in terms.find(item, bench.cell.machine)}
        seen = {c.name for c in found.model.coefficients} | {n for u in found.selection.unseen for n in u.names}
        assert expected <= seen, "neither estimated nor told why not"


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["thermal_drift", "probe_lobing", "compensation_kink", "cylinder_cosine", "step", "first_touch"])
def test_held_out_touches_are_predicted_with_the_term(name: str, bench: blind.Bench, fitted: Estimate) -> None:
    item = {"cause": name, **settings(name, fitted.model.touches)[0]}
    cell = bench.cell
    read = simulate(cell.machine, cell.artefact, cell.strategy, replace(bench.world, noise=blind.NOISE), seed=4)
    found = held_out(cell.machine, cell.artefact, read, (*cell.terms, item), ((3, 9, 16),))
    assert np.isfinite(found.figures.sd)
    assert found.figures.sd < 2 * blind.NOISE


def test_a_kink_of_a_rotary_axis_is_told_from_its_error_motions(bench: blind.Bench) -> None:
    effects = [{"cause": "compensation_kink", "axis": "B", "nodes": [-95, 30, 95], "values": [0.0, 3e-5, 0.0]}]
    read = noisy(bench, effects)
    term = {"cause": "compensation_kink", "axis": "B", "at": 30.0}
    e = estimate(bench.cell.machine, bench.cell.artefact, read, ("S3", "EBB1", term))
    name = "compensation_kink[B,30]"
    slope = -3e-5 / np.radians(65) - 3e-5 / np.radians(125)
    assert abs(e.value(name) - slope) < 4 * e.std[e.model.names.index(name)]


def noisy(bench: blind.Bench, effects: list[dict[str, Any]], errors: dict[str, float] | None = None) -> Readings:
    world = replace(bench.world, effects=tuple(effects), noise=blind.NOISE, errors={**bench.world.errors, **(errors or {})})
    return simulate(bench.cell.machine, bench.cell.artefact, bench.cell.strategy, world, seed=5)


def test_a_round_table_taken_for_flat_facets_gives_its_radius(bench: blind.Bench) -> None:
    """Only where touches miss their points: here axis C is 0.7 mm away from where the machine file has it."""
    read = noisy(bench, [{"cause": "cylinder_cosine", "radius": 100.0}], {"EX0C": -0.7})
    item = {"cause": "cylinder_cosine"}
    e = estimate(bench.cell.machine, bench.cell.artefact, read, ("S3", item))
    value, std = e.value("cylinder_cosine"), e.std[e.model.names.index("cylinder_cosine")]
    assert abs(value - 1 / 103) < 4 * std and value > 5 * std
    (effect,) = terms.effects("cylinder_cosine", bench.cell.machine, {}, np.array([value]))
    assert effect["radius"] == pytest.approx(1 / value - 3.0)


def test_without_misses_the_curvature_cannot_be_told_and_nothing_breaks(bench: blind.Bench) -> None:
    perfect = replace(bench.world, errors={}, stylus={}, facets={})
    read = simulate(bench.cell.machine, bench.cell.artefact, bench.cell.strategy, perfect)
    e = estimate(bench.cell.machine, bench.cell.artefact, read, ("S3", {"cause": "cylinder_cosine"}))
    assert "cylinder_cosine" in [n for u in e.selection.unseen for n in u.names]


@pytest.mark.parametrize(
    ("cause", "setting"), [("cylinder_cosine", {"axis": [0, 0, 0]}), ("compensation_kink", {"axis": "Q", "at": 3})]
)
def test_a_setting_that_makes_no_sense_is_an_input_error(cause: str, setting: dict[str, Any], bench: blind.Bench) -> None:
    with pytest.raises(InputError, match=cause):
        terms.find({"cause": cause, **setting}, bench.cell.machine)


@pytest.mark.long
def test_diagnosed_effects_are_taken_by_the_simulated_machine(bench: blind.Bench) -> None:
    from tango_cnc.diagnose import diagnose
    from tango_cnc.diagnose.words import effects

    read = noisy(bench, [{"cause": "rotary_axial", "axis": "C", "amplitude": 0.004, "order": 2, "phase": 70.0}])
    d: Diagnosis = diagnose(bench.cell.machine, bench.cell.artefact, read, bench.cell.terms)
    told = effects(d)
    assert [e["cause"] for e in told] == ["rotary_axial"]
    truth = changed(bench, [{"cause": "rotary_axial", "axis": "C", "amplitude": 0.004, "order": 2, "phase": 70.0}])
    assert np.abs(changed(bench, told) - truth).max() < 0.001
