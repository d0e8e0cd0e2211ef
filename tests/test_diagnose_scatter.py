"""The size of the noise: what it depends on, against noise drawn here; and what a person reads about it."""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from support import blind
from support.coverage import pushed
from support.diagnosis_parts import Scatter, left, scatter, uneven

from sim_controller.simulate import simulate
from tango_cnc.diagnose import diagnose
from tango_cnc.diagnose.sentences import noise
from tango_cnc.diagnose.words import as_text as render
from tango_cnc.files import read_cell
from tango_cnc.records import World

TOUCHES, FACETS = 400, 25
ONE = np.ones(TOUCHES)


def groups(rng: np.random.Generator) -> dict[str, np.ndarray]:
    row = np.arange(TOUCHES)
    return {"facet": rng.permutation(row % FACETS), "direction": row % 6, "indexation": row // 11, "time": row * 8 // TOUCHES}


def drawn(kind: str, rng: np.random.Generator, members: dict[str, np.ndarray]) -> np.ndarray:
    white = rng.normal(size=TOUCHES)
    if kind == "white":
        return white
    if kind == "heavy":
        return rng.standard_t(3, size=TOUCHES)
    member = members[kind]
    loud = rng.permutation(member.max() + 1) < max(2, (member.max() + 1) // 4)
    return np.where(loud[member], 3.0, 1.0) * white


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", ["white", "heavy", "facet", "direction", "indexation", "time"])
def test_what_the_scatter_depends_on_is_told_and_nothing_else(kind: str) -> None:
    told = []
    for seed in range(10):
        rng = np.random.default_rng([5, seed])
        members = groups(rng)
        found = scatter(drawn(kind, rng, members), ONE, members)
        told.append(found.by if found.clear else None)
        assert (found.tails is not None) == (kind == "heavy")
    if kind in ("white", "heavy"):
        assert set(told) == {None}
    else:
        assert told.count(kind) >= 9 and set(told) <= {kind, None}


@pytest.mark.long
def test_a_model_that_mixes_the_noise_of_its_touches_hides_no_rough_facet() -> None:
    """Quiet facets are met from one direction and rough ones from all, as those of a table: residuals alone say nothing."""
    for seed in (0, 3):
        rng = np.random.default_rng([6, seed])
        members = groups(rng)
        facet = members["facet"]
        members["direction"] = np.where(facet < 12, 5, rng.integers(0, 5, TOUCHES))
        noise = rng.normal(size=TOUCHES) * np.where(facet < 12, 0.7, np.where(facet < 17, 2.6, 1.0))
        outside = np.linalg.qr(rng.normal(size=(TOUCHES, 260)))[0]  # 140 unknowns
        space = left(outside, outside.T @ noise, ONE, np.empty((260, 0)), ())
        assert scatter(space.residual, space.own, members).by is None
        found = scatter(space.residual, space.own, members, space)
        assert found.by == "facet" and found.clear


def test_a_few_wild_touches_make_no_facet_rough() -> None:
    rng = np.random.default_rng(3)
    members = groups(rng)
    white = rng.normal(size=TOUCHES)
    white[rng.choice(TOUCHES, 4, replace=False)] = [60.0, -45.0, 80.0, 30.0]
    assert scatter(white, ONE, members).by is None


def test_residuals_of_nothing_have_no_scatter() -> None:
    members = groups(np.random.default_rng(1))
    assert scatter(np.zeros(TOUCHES), ONE, members).by is None
    assert scatter(ONE, np.zeros(TOUCHES), members).by is None


def test_noise_is_told_in_plain_words() -> None:
    assert noise(Scatter(None, 0.0, 0.0, None)) == []
    (either,) = noise(Scatter("facet", 30.0, 2.0, None, rival="direction"))
    assert "facet or on the direction of touch" in either and "cannot separate" in either
    first, second, third = noise(Scatter("direction", 30.0, 20.0, 3.2, 0.6))
    assert "direction of touch" in first and "3 degrees of freedom" in second and "correlation 0.6" in third


def test_html_without_matplotlib_is_a_message_before_anything_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    from tango_cnc.cli import tango
    from tango_cnc.records import InputError

    monkeypatch.setitem(sys.modules, "matplotlib", None)
    result = CliRunner().invoke(tango, ["diagnose", "-C", "examples/hu40t", "--html", "page.html"], standalone_mode=False)
    assert isinstance(result.exception, InputError) and "tango-cnc[report]" in str(result.exception)


def test_progress_is_shown_on_a_terminal_only(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    from tango_cnc.commands._progress import Progress

    for terminal in (False, True):
        monkeypatch.setattr(sys.stderr, "isatty", lambda known=terminal: known, raising=False)
        with Progress() as progress:
            progress.stage("searching")
        shown = capsys.readouterr().err
        assert ("searching" in shown) is terminal
    monkeypatch.setattr("tango_cnc.commands._progress.TICK", 0.3)
    with Progress() as progress:  # a stage that takes long shows its seconds
        progress.stage("searching")
        time.sleep(1.5)
    shown = capsys.readouterr().err
    assert "0 s: searching" in shown and "1 s: searching" in shown


@pytest.mark.parametrize(
    ("by", "rival", "evidence", "against"),
    [
        ("time", None, 40.0, True),
        ("direction", "indexation", 15.0, True),
        ("time", None, 5.0, False),
        ("facet", None, 40.0, False),  # one rough facet says nothing against the names
        ("time", "facet", 40.0, False),
        (None, None, 0.0, False),
    ],
)
def test_scatter_that_is_uneven_in_parts_of_the_test_speaks_against_the_names(
    by: str | None, rival: str | None, evidence: float, against: bool
) -> None:
    assert uneven(Scatter(by, evidence, 7.0 if rival is None else 2.0, None, rival=rival)) == against


@pytest.mark.long
def test_a_pose_that_sags_is_not_called_noise_without_a_word(root: Path, tmp_path: Path) -> None:
    """Two indexations of 34 that stand 12 µm lower: taken for noise of these indexations, they leave nothing for a cause."""
    folder = root / "examples" / "trunnion"
    cell = read_cell(folder)
    read = simulate(cell.machine, cell.artefact, cell.strategy, World(noise=0.0007), seed=8)
    turned = np.round(np.degrees(read.position[:, [cell.machine.column(name) for name in "AC"]]))
    poses = np.unique(turned, axis=0)
    sags = np.zeros(len(turned), dtype=bool)
    for pose in poses[np.argsort(-np.abs(poses[:, 0]))][:2]:
        sags |= (turned == pose).all(axis=1)
    position = read.position.copy()
    position[sags, cell.machine.column("Z")] -= 0.012
    found = diagnose(cell.machine, cell.artefact, replace(read, position=position), cell.terms)
    text = " ".join(render(found).split())
    assert found.verdict != "adequate" or "adequate, if single touches scatter unevenly by chance" in text
    quiet = diagnose(cell.machine, cell.artefact, read, cell.terms)
    assert quiet.verdict == "adequate" and "adequate: the model explains" in " ".join(render(quiet).split())


@pytest.mark.long
@pytest.mark.parametrize(("both", "named"), [(True, False), (False, True)])
def test_a_chip_that_one_touch_shows_is_an_outlier(both: bool, named: bool) -> None:
    """Facet 26 is touched twice before touch 102. Where both are off, one each way, one is set aside and the other stays alone."""
    b = blind.bench()
    rng = np.random.default_rng(11)
    read = simulate(b.cell.machine, b.cell.artefact, b.cell.strategy, replace(b.world, effects=(), noise=6e-4), seed=4)
    rows = np.flatnonzero(np.array(read.facet) == "26")
    way = np.zeros(len(read))
    way[rng.choice(len(read), 12, replace=False)] = rng.choice([-1, 1], 12) * rng.uniform(0.004, 0.012, 12)
    way[rows[:2]] = [0.013, -0.0125] if both else -0.0125
    way[rows[2:]] = 0.0
    found = diagnose(b.cell.machine, b.cell.artefact, pushed(b.cell, read, way), b.cell.terms)
    assert ("chip" in {f.cause for f in found.findings}) == named, found
