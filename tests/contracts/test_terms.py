"""Contract of every term and cause: walked from the folder, so that a new file is tested the moment it exists."""

from __future__ import annotations

import inspect
import re
import sys
from dataclasses import replace
from pathlib import Path
from string import Formatter
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent.parent))

from support import blind
from support.diagnosis_parts import candidate, pattern
from support.rows import added, command, writing

from sim_controller import effects
from sim_controller.simulate import simulate
from tango_cnc import terms
from tango_cnc.diagnose import sentences
from tango_cnc.estimate import estimate
from tango_cnc.records import InputError
from tango_cnc.touches import Touches

CAUSES = sorted(terms.causes())
PATTERNS = sorted(terms.patterns())
SPREADS = [name for name in CAUSES if name not in PATTERNS]
UNIT = re.compile(r"(mm|rad|s|1)(/(mm|rad)[²³⁴⁵⁶⁷⁸⁹]?)?(/K)?")


@pytest.fixture(scope="module")
def bench() -> blind.Bench:
    return blind.bench()


@pytest.fixture(scope="module")
def touches(bench: blind.Bench) -> Touches:
    return estimate(bench.cell.machine, bench.cell.artefact, bench.clean, bench.cell.terms).model.touches


@pytest.mark.parametrize("name", sorted(terms.families()))
def test_every_family_says_what_it_is_and_where_that_is_written(name: str) -> None:
    module = terms.families()[name]
    assert module.text and module.source, f"tango_cnc/terms/{name}.py: state text and source"


@pytest.mark.parametrize("name", CAUSES)
def test_every_cause_says_its_frame_what_it_is_mistaken_for_and_what_to_do(name: str) -> None:
    module = terms.causes()[name]
    assert module.frame and module.advice and module.meaning and module.says, f"tango_cnc/terms/{name}.py: one of them is empty"
    file = f"tango_cnc/terms/{name}.py"
    for field in ("mistaken", "plainer", "parted"):
        assert not isinstance(getattr(module, field), str), f'{file}: {field}: a comma is missing: ("cause",)'
    unknown = set(module.mistaken) - set(CAUSES)
    assert not unknown, f"{file}: mistaken: found {', '.join(sorted(unknown))}; allowed: names of files in tango_cnc/terms/"
    assert set(module.plainer) <= set(module.mistaken), f"{file}: plainer: names a cause that `mistaken` does not"
    assert set(module.parted) <= set(module.mistaken), f"{file}: parted: names a cause that `mistaken` does not"
    assert (name in PATTERNS) == (module.variants is not terms.Cause.variants), f"{file}: variants or a spread, never both"


@pytest.mark.parametrize("name", CAUSES)
def test_every_cause_uses_words_and_ways_of_searching_that_exist(name: str, touches: Touches) -> None:
    module, file = terms.causes()[name], f"tango_cnc/terms/{name}.py"
    own = inspect.signature(module.make).parameters
    used = {word for _, word, _, _ in Formatter().parse(module.says) if word}
    setting = next(module.variants(touches), dict(module.example))
    detail = {f"{key}_{module.units[key]}" if key in module.units else key: value for key, value in setting.items()}
    try:
        unknown = used - sentences.WORDS - set(module.words(detail))
    except KeyError as error:
        raise AssertionError(f"{file}: words: found no {error} in the detail of a finding; allowed: {detail}") from error
    assert not unknown, (
        f"{file}: says: found {{{', '.join(unknown)}}}; allowed: {', '.join(sorted(sentences.WORDS))}, and its `words`"
    )
    assert set(module.refine.values()) <= set(terms.SEARCHES), f"{file}: refine: allowed: {', '.join(terms.SEARCHES)}"
    for field in ("refine", "units", "example"):
        assert set(getattr(module, field)) <= set(own), f"{file}: {field}: `make` has no such setting"
    assert module.over in ("", "time", "probe"), f"{file}: over: allowed: time, probe"
    assert module.scatters in (("indexation", "facet", "all") if name in SPREADS else ("",)), f"{file}: scatters"


def test_what_the_program_uses_a_cause_for_is_said_by_one_cause_each() -> None:
    roles = [cause.role for cause in terms.causes().values() if cause.role]
    assert sorted(roles) == sorted(terms.ROLES), "tango_cnc/terms: one file has each of ROLES as its `role`"


@pytest.mark.parametrize("name", PATTERNS)
def test_every_variant_makes_coefficients_with_finite_regressors_and_names_of_their_own(
    name: str, bench: blind.Bench, touches: Touches
) -> None:
    machine, module = bench.cell.machine, terms.causes()[name]
    seen: dict[str, dict[str, Any]] = {}
    for setting in list(module.variants(touches))[:60]:
        coefficients = terms.cause(name, machine, setting)
        assert coefficients
        for c in coefficients:
            regressor = c.regressor(touches)
            assert regressor.shape == (len(touches),) and np.isfinite(regressor).all(), f"{name}: {c.name}: {setting}"
            assert UNIT.fullmatch(c.unit), f"tango_cnc/terms/{name}.py: found the unit {c.unit!r}; allowed: such as mm, rad, mm/mm"
            assert seen.setdefault(c.name, setting) == setting or name == "compensation_kink", "one name for two settings"


@pytest.mark.parametrize("name", SPREADS)
def test_every_spread_is_a_variance_of_unit_size(name: str, touches: Touches) -> None:
    for _, size in terms.causes()[name].spread(touches):
        assert size.shape in ((len(touches),), (len(touches), len(touches)))
        variance = size if size.ndim == 1 else np.diag(size)
        assert (variance >= 0).all() and variance.max() == pytest.approx(1.0)


@pytest.mark.parametrize("name", CAUSES)
def test_a_setting_that_a_cause_does_not_have_is_an_input_error(name: str, bench: blind.Bench) -> None:
    with pytest.raises(InputError, match=name):
        terms.find({"cause": name, "colour": "red"}, bench.cell.machine)


ALIKE = sorted((set(PATTERNS) & set(effects.names())) - set(effects.stated("OTHERWISE")))


def shared(name: str, effect: dict[str, Any]) -> dict[str, Any]:
    """cause, effect → the setting of its term: the keys that both have."""
    return {key: value for key, value in effect.items() if key in inspect.signature(terms.causes()[name].make).parameters}


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ALIKE)
def test_the_simulated_machine_does_what_the_term_says(name: str, bench: blind.Bench, touches: Touches) -> None:
    """Two independent ways: the change of the simulated readings lies in the span of the term's columns, sign and size included."""
    eye = blind.eyes(bench)
    columns = [bench.cell.machine.column(a) for a in "XYZ"]
    change = np.zeros(len(touches))
    # Some tilts turn the tip about itself and move no touch: another one is drawn.
    for seed in range(5, 10):
        drawn = {"axis": "Y" if name == "backlash" else "C", "amplitude": 1e-3 if name == "backlash" else 1e-6}
        effect = {"cause": name, **drawn} if name.endswith("backlash") else blind.draw(bench, name, np.random.default_rng(seed))
        read = simulate(bench.cell.machine, bench.cell.artefact, bench.cell.strategy, replace(bench.world, effects=(effect,)))
        change = np.sum((read.position - bench.clean.position)[:, columns] * eye.normal, axis=1)
        if np.abs(change).max() > 1e-5:
            break
    assert np.abs(change).max() > 1e-5
    mine = pattern(touches, candidate(touches, name, shared(name, effect)).coefficients)
    values, *_ = np.linalg.lstsq(mine, change, rcond=None)
    assert np.abs(change - mine @ values).max() < 0.01 * np.abs(change).max(), (
        f"tango_cnc/terms/{name}.py is not what sim_controller/effects/{name}.py does. Where their settings have other names, "
        f'state there which, and the test that compares them: OTHERWISE = "…"'
    )
    # A cause with `effects` of its own says how amplitude and coefficient belong together: tests/test_terms_round_trip.py.
    if mine.shape[1] == 1 and "amplitude" in effect and terms.causes()[name].effects is None:
        assert values[0] == pytest.approx(effect["amplitude"], rel=0.01), (
            f"tango_cnc/terms/{name}.py: the coefficient of this effect is {values[0]:.6g}, "
            f"its amplitude {effect['amplitude']:.6g}. Make them equal, or let `effects` of the cause say how they belong together"
        )


def test_the_campaign_of_hidden_effects_draws_every_cause_or_says_why_not(bench: blind.Bench) -> None:
    """A new one is drawn as its EXAMPLE says unless its file states UNDRAWN; `draw` of tests/support/blind.py has more settings."""
    known = {*blind.DRAWN, *blind.RARE, *blind.UNDRAWN}
    assert known <= {*CAUSES}, f"tests/support/blind.py: causes that do not exist: {', '.join(sorted(known - {*CAUSES}))}"
    assert not {*blind.FIRST, *blind.RARE} & {*blind.UNDRAWN}, "an effect states UNDRAWN, and it is drawn all the same"
    for name in blind.DRAWN:
        assert blind.expected(name)
        effects.checked([blind.draw(bench, name, np.random.default_rng(5))], bench.cell.machine, bench.cell.artefact)


def row(name: str) -> str:
    """→ the line of a cause in docs/causes.md, from its file."""
    module = terms.causes()[name]
    keys = [
        key if p.default is inspect.Parameter.empty else f"[{key}]"
        for key, p in inspect.signature(module.make).parameters.items()
        if key != "machine"
    ]
    mistaken = ", ".join(f"`{other}`" for other in module.mistaken)
    cells = [f"`{name}`", module.text, module.meaning, module.frame, mistaken, ", ".join(keys) or "–", module.advice]
    return "| " + " | ".join(cells) + " |"


WRITE = command("tests/contracts/test_terms.py -k catalogue")
HEAD = "| name | what it is | what it means | frame | mistaken for | settings | what to do |"


def test_the_catalogue_in_the_documentation_is_complete() -> None:
    page = Path(__file__).parent.parent.parent / "docs" / "causes.md"
    text = page.read_text(encoding="utf-8")
    missing = [row(name) for name in CAUSES if row(name) not in text]
    if missing and writing():
        for line in missing:
            old = re.search(rf"(?m)^{re.escape(line[: line.index('|', 1) + 1])}.*\n", text)  # the row of this cause as it was
            text = added(text.replace(old[0], "") if old else text, HEAD, line)
        page.write_text(text, encoding="utf-8")
        return
    assert not missing, f"docs/causes.md lacks these rows; {WRITE} writes them:\n" + "\n".join(missing)
    assert re.findall(r"^\| `(\w+)` \|", text, re.M) == CAUSES, "docs/causes.md: rows in alphabetical order, one a cause"


def test_every_cause_of_the_catalogue_can_be_hidden_in_the_simulated_machine() -> None:
    effects = {f.stem for f in (Path(__file__).parent.parent.parent / "sim_controller" / "effects").glob("[a-z]*.py")}
    unhidden = sorted(set(CAUSES) - effects)
    assert not unhidden, "write " + ", ".join(f"sim_controller/effects/{name}.py" for name in unhidden)
    assert effects - set(CAUSES) == {"outliers", "random_walk"}, "kinds of noise, not causes"
