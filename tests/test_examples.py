"""Every example cell is checked, planned, measured by its true machine and estimated, with the commands that a user would type."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import examples
from tango_cnc.files import read_cell, read_world


@pytest.fixture(scope="module", params=examples())
def cell(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("examples") / request.param
    assert call("init", folder, "--example", request.param) == 0
    return folder


def call(*arguments: object) -> int:
    return guarded(tango.main, [str(a) for a in arguments], standalone_mode=False)


def result(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, dict]:
    capsys.readouterr()
    status = call(*arguments, "--json", "-")
    return status, json.loads(capsys.readouterr().out)


def test_first_line_says_what_it_is_an_example_of(cell: Path) -> None:
    first = (cell / "tango.yaml").read_text(encoding="utf-8").splitlines()[0]
    assert first.startswith("# ") and len(first) > 20


# One with a tilting table, one with a head, one without rotary axes; the others go the same way.
some_now_all_in_long = pytest.mark.parametrize(
    "cell",
    [n if n in ("trunnion", "fork_head", "three_axis") else pytest.param(n, marks=pytest.mark.long) for n in examples()],
    indirect=True,
)


@pytest.mark.long
@some_now_all_in_long
def test_check_counts_every_touch_and_names_what_cannot_be_seen(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, found = result(capsys, "check", "-C", cell)
    assert found["touches"] == sum(len(i.facets) for i in read_cell(cell).strategy.indexations)
    assert status == 0 or found["not_identifiable"]
    assert all(text.strip() for text in found["not_identifiable"])


@pytest.mark.long  # what is checked above is the same program
def test_plan_writes_a_program(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, found = result(capsys, "plan", "-C", cell)
    assert status == 0 and not found["left_out"]
    assert Path(found["program"]).stat().st_size > 1000
    assert len((cell / "program" / "plan.csv").read_text(encoding="utf-8").splitlines()) == found["touches"] + 1


@pytest.mark.few(0)
@some_now_all_in_long
def test_estimate_finds_the_true_machine(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, _ = result(capsys, "simulate", "-C", cell)
    assert status == 0
    status, found = result(capsys, "estimate", "-C", cell)
    assert status == 0
    world = read_world(cell / "world.yaml")
    assert not world.effects
    noise = world.noise * 1e3
    assert 0.8 * noise < found["residual"]["std_um"] < 1.2 * noise
    for name, parameter in found["parameters"].items():
        one, _, other = name.partition("-")  # EYY1-EXX1 where the absolute scale cannot be seen
        truth = world.errors.get(one, 0.0) - world.errors.get(other, 0.0)
        assert abs(parameter["value"] - truth) < 4 * parameter["std"], name
