"""What a diagnosis says to a person at the machine: every cause has its sentence, and every picture its band.

And what no sentence of the program says, nor any page of docs: words that read as translated.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from string import Formatter
from typing import Any

import numpy as np
import pytest
from support import blind
from support.diagnosis_parts import Chosen, candidate
from support.imports import modules, statements, tree

from sim_controller.simulate import simulate
from tango_cnc import terms
from tango_cnc.diagnose import Finding, _seen, diagnose
from tango_cnc.diagnose._size import _one, _told
from tango_cnc.diagnose.sentences import _words, advice, chance, covariate, meaning, minutes, said
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


@pytest.mark.few(12)
@pytest.mark.parametrize("name", PATTERNS)
def test_every_cause_has_a_sentence_of_its_own_for_every_variant(name: str, fitted: Estimate) -> None:
    module = terms.causes()[name]
    for setting in list(module.variants(fitted.model.touches))[::5] or [dict(module.example)]:
        f = finding(fitted, name, setting)
        text, known = said(f), _words(f)
        lacking = [word for _, word, _, _ in Formatter().parse(module.says) if word and word not in known]
        assert not lacking, (
            f"tango_cnc/terms/{name}.py: says: {{{'}, {'.join(lacking)}}} has no value for the setting {setting}; `words` of the "
            f"file may give it: it gets the detail of the finding, {f.detail}"
        )
        assert "{" not in text and "µm" in text, f"tango_cnc/terms/{name}.py: says: name {{size}}, which is in µm: {text}"
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
    undirected = {key: value for key, value in f.detail.items() if key != "direction"}
    assert _words(replace(f, detail=undirected))["size"] == f"{seen:.1f} µm", "nor is the end of one without a direction told"
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


# What a machinist stumbles over, a phrase that had it, and what to write instead.
TRANSLATED = (
    (r"\bfore(told|tell\w*)\b", "Sphere test foretold", "predicted"),
    (r"\btold (apart|from)\b|\btells? (\S+ ){1,3}(apart|from)\b", "that tells two causes apart", "distinguishes"),
    (r"\b(is|are|was|were|be) told\b(?! to\b)", "is told so in words", "is reported"),
    (r"\bby nobody\b", "is told from none by nobody", "nobody, as the subject"),
    (r"\bof (which|whom) none\b", "touches of which none", "none of these"),
    (r"\bslips? of the pen\b", "are no slip of the pen", "a mistake"),
    (r"\bnothing to hope\b", "leaves nothing to hope", "takes no chances"),
    (r"\bjust as .{1,40} would\b", "moves the touches just as a table of another shape would", "cannot be separated from"),
    (r"\bhardly sees?\b", "This plan would hardly see", "is weak for"),
    (r"\bway of the (stylus|tip|probe)\b", "Way of the stylus tip", "path"),
    (r"\bstands? twice\b", "the label stands twice", "appears twice"),
    (r"\bstands? in (its|their) places?\b", "Words that the profile states stand in their places", "appear where they belong"),
    (r"\b(line|word|block|letter|something)( stands)? behind\b", "a line behind the end mark", "after"),
    (r"\bfound out by others\b", "Found out by others", "known pitfalls"),
)


ANY = re.compile("|".join(pattern for pattern, _, _ in TRANSLATED), re.IGNORECASE)


def sentences_of(root: Path) -> Iterator[tuple[str, str]]:
    """→ (where, text) of what a user reads: pages, texts, messages, help."""
    for page in (root / "README.md", *sorted((root / "docs").rglob("*.md"))):
        prose = re.sub(r"```.*?```|`[^`]*`", "`", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        yield from ((f"{page.relative_to(root)}: paragraph {i}", " ".join(p.split())) for i, p in enumerate(prose.split("\n\n"), 1))
    texts = tomllib.loads((root / "tango_cnc" / "texts" / "en.toml").read_text(encoding="utf-8"))
    yield from flat("en.toml", texts)
    for name, file in modules(root).items():
        if name.startswith("postprocessors."):  # their words are printed into programs, whose marks change with them
            continue
        joined = re.sub(r'"\s*f?"', "", file.read_text(encoding="utf-8"))
        if not ANY.search(joined):
            continue
        found = tree(file)
        docstrings = set(map(id, described(found)))
        for node in ast.walk(found):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value and id(node) not in docstrings:
                yield f"{name}:{node.lineno}", " ".join(node.value.split())


def described(found: ast.Module) -> Iterator[ast.expr]:
    """→ docstrings of a file but those of commands, which are their help."""
    for node in (found, *(n for n in statements(found) if isinstance(n, ast.ClassDef | ast.FunctionDef) and n.name != "command")):
        if node.body and isinstance(first := node.body[0], ast.Expr):
            yield first.value


def flat(where: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        for key, child in value.items():
            yield from flat(f"{where}: {key}", child)
    else:
        yield where, str(value)


@pytest.mark.parametrize(("pattern", "phrase", "instead"), TRANSLATED)
def test_a_phrase_that_reads_as_translated_is_noticed(pattern: str, phrase: str, instead: str) -> None:
    assert re.search(pattern, phrase, re.IGNORECASE) and not re.search(pattern, instead, re.IGNORECASE)


def test_nothing_that_a_user_reads_has_words_that_read_as_translated(root: Path) -> None:
    known = [(re.compile(pattern, re.IGNORECASE), instead) for pattern, _, instead in TRANSLATED]
    found = [
        f"{where}: found {match[0]!r}; write: {instead}"
        for where, text in sentences_of(root)
        if ANY.search(text)
        for pattern, instead in known
        if (match := pattern.search(text))
    ]
    assert not found, "\n".join(found)
