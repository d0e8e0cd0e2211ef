"""`tango uncertainty` at the command line: what it prints, what it writes, what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from support.runs import Result

from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example

BUDGET = """contributions:
  - {source: repeatability, std: 0.0006}
  - {source: drift, amplitude: 0.002}
  - {source: lobing, amplitude: 0.0035, order: 2}
"""


def call(*args: object) -> int:
    return guarded(tango.main, [str(a) for a in args], standalone_mode=False)


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("uncertainty") / "cell"
    write_example(folder, "hu40t")
    assert call("simulate", "-C", folder) == 0
    assert call("simulate", "-C", folder, "--cycles", 2, "--days", 3, "-o", folder / "repeated.csv") == 0
    return folder


@pytest.fixture
def budget(cell: Path, tmp_path: Path) -> Path:
    file = tmp_path / "budget.yaml"
    file.write_text(BUDGET, encoding="utf-8")
    return file


def run(*args: object) -> str:
    return Result(*args).out


def as_json(capsys: pytest.CaptureFixture[str], *args: object) -> dict[str, Any]:
    capsys.readouterr()
    assert call("uncertainty", "--trials", 2000, *args, "--json", "-") == 0
    result: dict[str, Any] = json.loads(capsys.readouterr().out)
    return result


@pytest.mark.long
def test_json_of_a_single_run(cell: Path, budget: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = as_json(capsys, "-C", cell, "--budget", budget, "--factor", 2.6)
    assert data["format"] == "tango-uncertainty/1" and data["pool"] == "none" and data["probability"] == 0.95
    assert len(data["parameters"]) == 17 and set(data["stylus"]) == {"EXt", "EYt", "EZt"}
    one = data["parameters"]["EX0C"]
    assert one["interval"][0] < one["value"] < one["interval"][1] and one["unit"] == "mm"
    assert one["expanded"] == pytest.approx(2.6 * one["std"])
    assert set(one["contributions"]) == {"repeatability", "drift", "lobing", "scale_bar"}
    assert sum(c**2 for c in one["contributions"].values()) == pytest.approx(one["std"] ** 2)
    names, matrix = data["correlation"]["names"], data["correlation"]["matrix"]
    assert len(names) == len(matrix) == 20 and matrix[3][3] == 1.0
    assert 1.9 < data["joint"]["rectangle"] < data["joint"]["ellipsoid"]
    assert data["monte_carlo"]["trials"] == 2000 and data["monte_carlo"]["chord_error_rms"] < 0.01


@pytest.mark.long
def test_json_of_repeated_days(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = as_json(capsys, "-C", cell, "--readings", cell / "repeated.csv")
    assert data["pool"] == "cycles"
    one = data["parameters"]["EX0C"]
    assert set(one["std_by"]) == {"cycles", "days", "budget"} and one["std_of_mean"] > 0
    assert data["days_and_cycles"]["days"] == [1, 2, 3]
    assert data["days_and_cycles"]["parameters"]["EX0C"]["p_days"] > 1e-4
    assert as_json(capsys, "-C", cell, "--readings", cell / "repeated.csv", "--pool", "days")["pool"] == "days"


@pytest.mark.long
def test_text_for_people(cell: Path, budget: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("uncertainty", "-C", cell, "--budget", budget) == 0
    text = capsys.readouterr().out
    for part in ("95 % from", "k_q", "budget, % of variance", "correlat", "nonlinear estimations", "numerical tolerance", "µrad"):
        assert part in text
    assert "linear propagation holds" in text
    assert call("uncertainty", "-C", cell, "--budget", budget, "--trials", 1000, "--seed", 4) == 0  # a seed that scatters
    assert "so few trials do not resolve" in capsys.readouterr().out


@pytest.mark.long
def test_without_a_budget_it_says_what_is_not_taken_into_account(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("uncertainty", "-C", cell, "--trials", 2000) == 0
    assert "Drift, lobing and form are not" in capsys.readouterr().err


@pytest.mark.long
def test_the_budget_of_the_cell_is_taken_when_there_is_one(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = cell / "uncertainty.yaml"
    file.write_text(BUDGET, encoding="utf-8")
    try:
        assert "drift" in as_json(capsys, "-C", cell)["parameters"]["EX0C"]["contributions"]
    finally:
        file.unlink()


@pytest.mark.long
def test_subsets_and_runs_are_compared(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = as_json(capsys, "-C", cell, "--subset", "all=1-28", "--subset", "fewer=1,3,5-28")
    assert data["format"] == "tango-comparison/1"
    (one,) = data["comparisons"]
    assert one["sets"] == ["all", "fewer"] and len(one["condition_numbers"]) == 2
    assert not any(p["differs"] for p in one["parameters"].values())
    runs = ["--compare", f"a={cell / 'simulated.csv'}", "--compare", f"b={cell / 'repeated.csv'}"]
    assert [c["method"][0] for c in as_json(capsys, "-C", cell, *runs)["comparisons"]] == ["χ", "F"]
    assert call("uncertainty", "-C", cell, *runs) == 0
    assert "u of diff." in capsys.readouterr().out


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--subset", "A=1-"], "numbers and ranges"),
        (["--subset", "A"], "LABEL=numbers"),
        (["--subset", "A=1-28", "--subset", "B=99"], "found indexation 99"),
        (["--compare", "a=readings.csv"], "no such file"),
        pytest.param(["--pool", "days"], "--pool days: found 1 day", marks=pytest.mark.long),  # noticed after a fit
        (["--probability", "1.5"], "between 0 and 1"),
        (["--probability", "0.99999", "--trials", "1000"], "allowed: at least"),
        (["--budget", "nowhere.yaml"], "no such file"),
        pytest.param(["--terms", "S9"], "S9", marks=pytest.mark.long),
    ],
)
def test_wrong_options_end_with_2_and_say_what_is_allowed(
    cell: Path, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("uncertainty", "-C", cell, *options) == 2
    assert message in capsys.readouterr().err


@pytest.mark.long
def test_values_that_are_not_those_of_the_estimate_are_said(cell: Path, tmp_path: Path) -> None:
    """A machine that drifts by 12 µm: the estimate follows that, and this command does not."""
    folder = tmp_path / "drifting"
    write_example(folder, "hu40t")
    world = folder / "world.yaml"
    drift = "effects: [{cause: thermal_drift, amplitude: 0.012, tau: 1800, direction: [0, 1, 1]}]"
    world.write_text(world.read_text(encoding="utf-8").replace("effects: []", drift), encoding="utf-8")
    assert call("simulate", "-C", folder) == 0
    said = run("uncertainty", "-C", folder, "--trials", 1000)
    assert f"'tango estimate -C {folder}' lets them count by how the machine wandered, and shows other values: E" in said
    assert "shows other values" not in run("uncertainty", "-C", cell, "--trials", 1000)
