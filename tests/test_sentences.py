"""What a diagnosis says to a person at the machine: every cause has its sentence, and every picture its band."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import blind

from sim_controller.simulate import simulate
from tango_cnc import terms
from tango_cnc.diagnose import Finding, _seen, diagnose
from tango_cnc.diagnose._candidates import candidate
from tango_cnc.diagnose._search import Chosen
from tango_cnc.diagnose._size import _one, _told
from tango_cnc.diagnose.sentences import advice, chance, covariate, meaning, minutes, said
from tango_cnc.diagnose.words import telling
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.model import known, linearise
from tango_cnc.touches import from_readings, misnamed

PATTERNS = sorted(terms.patterns())


@pytest.fixture(scope="module")
def bench() -> blind.Bench:
    return blind.bench()


@pytest.fixture(scope="module")
def fitted(bench: blind.Bench) -> Estimate:
    return estimate(bench.cell.machine, bench.cell.artefact, bench.clean, bench.cell.terms)


def finding(fitted: Estimate, cause: str, setting: dict[str, Any]) -> Finding:
    touches = fitted.model.touches
    c = candidate(touches, cause, setting)
    k = c.columns.shape[1]
    chosen, v = Chosen(c, c.columns, 0.0), np.linspace(1e-3, 2e-3, k)
    amplitude = _told(chosen, np.ones(len(touches)))(v, c.columns @ v)
    s = _one(chosen, v, np.full(k, 1e-4), amplitude, 1e-4, touches)
    return Finding(cause, setting, s.detail, s, 1e-7, None, {}, (), (), s.effect, c.columns[:, 0])


@pytest.mark.parametrize("name", PATTERNS)
def test_every_cause_has_a_sentence_of_its_own_for_every_variant(name: str, fitted: Estimate) -> None:
    module = terms.causes()[name]
    for setting in list(module.variants(fitted.model.touches))[::5] or [dict(module.example)]:
        f = finding(fitted, name, setting)
        text = said(f)
        assert "{" not in text and "µm" in text
        assert text != f"{module.text}: {f.size.amplitude * 1e3:.1f} ± {f.size.amplitude_std * 1e3:.1f} µm", "a word is missing"
        assert meaning(f) and advice(f)


def test_a_warm_up_is_told_as_one(fitted: Estimate) -> None:
    f = finding(fitted, "thermal_drift", {"shape": "exponential", "tau": 900.0, "direction": (0, 1, 0)})
    text = said(replace(f, detail=f.detail | {"frame": "machine", "direction": [0.0, 1.0, 0.0]}))
    assert text == (
        "the machine drifts 1.0 ± 0.1 µm towards +Y (machine frame) as it warms up, two thirds of it within 15 min, then it settles"
    )
    assert "a tenth of it is left after 34 min" in advice(f)


def test_a_drift_that_has_not_settled_is_told_as_far_as_it_was_seen(fitted: Estimate) -> None:
    run = float(fitted.model.touches.warm.max())
    f = finding(fitted, "table_drift", {"shape": "exponential", "tau": 2 * run})
    text = said(f)
    seen = f.size.amplitude * (1 - np.exp(-0.5)) * 1e3
    assert f"the table creeps {seen:.1f} µm" in text and "has not settled" in text
    assert "a tenth" not in advice(f)


def test_chances_and_times_are_told_in_words() -> None:
    assert chance(1e-40) == "less than once in a million times"
    assert chance(0.0009) == "once in 1,000 times"
    assert chance(0.5) == "in 50 % of all cases"
    assert [minutes(s) for s in (40, 840, 9000)] == ["40 s", "14 min", "2.5 h"]


def test_every_covariate_has_a_name_for_people(fitted: Estimate) -> None:
    names = _seen.seen_over(fitted.model.touches)
    told = [covariate(n) for n in names]
    assert len(set(told)) == len(names)
    assert {"position of X", "touch direction Z, spindle frame", "side from which B came", "length of C's last move"} <= set(told)
    assert {"time", "indexation", "facet", "order of the touches", "time, shift along Y, machine frame"} <= set(told)


@pytest.mark.long
def test_the_band_of_a_picture_is_what_simulated_noise_does(bench: blind.Bench, fitted: Estimate) -> None:
    """40 sets of white noise through the same fit: 95 % of the group means lie within the band that is drawn."""
    _, jacobian = linearise(fitted.model, fitted.values)
    _, rows, uncertainty = known(fitted.model, fitted.values)
    design = np.vstack([jacobian, rows * (blind.NOISE / uncertainty)[:, None]])
    touches, n = fitted.model.touches, len(fitted.model.touches)
    rng = np.random.default_rng(6)
    inside: dict[str, list[np.ndarray]] = {}
    for _ in range(40):
        data = rng.normal(scale=blind.NOISE, size=len(design))
        for t in _seen.tests(design, data, touches, np.ones(n, dtype=bool)):
            inside.setdefault(t.covariate, []).append(np.abs(t.mean) <= t.band + 1e-12)
    share = {name: float(np.mean(np.concatenate(found))) for name, found in inside.items()}
    assert 0.93 < np.mean(list(share.values())) < 0.98
    assert min(share.values()) > 0.85
    assert {"time", "order", "indexation", "facet", "X", "Y", "Z", "B", "C", "normal x, machine", "dX", "way of X"} <= set(share)


@pytest.mark.long
def test_a_drift_shows_as_a_shift_over_time_before_it_is_named(bench: blind.Bench) -> None:
    effect = {"cause": "thermal_drift", "amplitude": 0.009, "tau": 900, "direction": [0, 1, 0]}
    world = replace(bench.world, effects=(effect,), noise=blind.NOISE)
    read = simulate(bench.cell.machine, bench.cell.artefact, bench.cell.strategy, world, seed=3)
    read = replace(read, temperatures={"bed": 20 + 3 * (1 - np.exp(-read.time / 900))})
    d = diagnose(bench.cell.machine, bench.cell.artefact, read, bench.cell.terms)
    assert telling(d)[0].covariate == "shift y, machine"
    assert telling(d)[0].variance_share > 0.4
    assert "T_bed" in {t.covariate for t in d.tests}
    assert not any(t.covariate.startswith("shift") and t.p_value < 1e-3 for t in d.tests_after)


def test_touches_made_at_another_facet_are_told_whatever_they_are_called(bench: blind.Bench, fitted: Estimate) -> None:
    assert misnamed(fitted.model.touches) == ()
    names = list(bench.clean.facet)
    one, other = (i for i, f in enumerate(names[:20]) if f in ("16", "19"))
    names[one], names[other] = names[other], names[one]
    read = replace(bench.clean, facet=tuple(names))
    found = misnamed(from_readings(bench.cell.machine, bench.cell.artefact, read))
    assert [(m.number, m.facet, m.near) for m in found] == [
        (one + 1, names[one], names[other]),
        (other + 1, names[other], names[one]),
    ]
    assert all(m.away > 50 > 1 > m.beside for m in found)
