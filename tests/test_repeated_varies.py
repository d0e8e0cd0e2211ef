"""Runs of a machine that varies from day to day: the intervals stand, and a mistake in one run is named with its run."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from sim_controller.simulate import simulate
from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell, read_world
from tango_cnc.judging import judged

VARIES = {"EX0S": 1e-3, "EY0C": 2e-3, "EC0X": 6e-6, "EB0C": 6e-6}  # mm and rad, from day to day
DAYS, RUNS = 3, 2
EXAMPLES = Path(__file__).parents[1] / "examples"


def call(*args: object) -> int:
    return guarded(tango.main, [str(a) for a in args], standalone_mode=False)


def told(folder: Path, capsys: pytest.CaptureFixture[str], *more: object) -> tuple[int, dict[str, Any]]:
    capsys.readouterr()
    files = ("--readings", folder / "repeated.csv", "--trials", 1000, "--json", "-")
    done = call("uncertainty", "-C", folder, *files, *more)
    return done, json.loads(capsys.readouterr().out)


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("varies") / "cell"
    write_example(folder, "trunnion")
    world = yaml.safe_load((folder / "world.yaml").read_text(encoding="utf-8"))
    rng, rows = np.random.default_rng(4), list[dict[str, str]]()
    for day in range(1, DAYS + 1):
        moved = {name: world["errors"][name] + float(size * rng.normal()) for name, size in VARIES.items()}
        (folder / "day.yaml").write_text(yaml.safe_dump(world | {"errors": world["errors"] | moved}), encoding="utf-8")
        for cycle in range(1, RUNS + 1):
            seed = 10 * day + cycle
            assert call("simulate", "-C", folder, "--world", folder / "day.yaml", "--seed", seed, "-o", folder / "one.csv") == 0
            with (folder / "one.csv").open(encoding="utf-8", newline="") as one:
                later = 86400 * day + 3600 * cycle
                for row in csv.DictReader(one):
                    rows.append(row | {"day": str(day), "cycle": str(cycle), "time_s": str(float(row["time_s"]) + later)})
    write(folder, rows)
    return folder


def write(folder: Path, rows: list[dict[str, str]]) -> None:
    with (folder / "repeated.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


@pytest.mark.long
def test_a_machine_that_varies_from_day_to_day_has_intervals_and_a_decision(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All runs together look like a machine that drifts, or is knocked: what repetitions are made for is no mistake."""
    (cell / "limits.yaml").write_text("limits: {EXXb: 0.01, EC0A: 1.0e-4}\n", encoding="utf-8")
    done, data = told(cell, capsys, "--limits", cell / "limits.yaml")
    assert (done, data["verdict"], data["untrusted"]) == (0, "trustworthy", [])
    assert any("varies from run to run" in text for text in data["remarks"])
    assert any("rest on the length of the scale bar" in text for text in data["remarks"])
    assert {d["verdict"] for d in data["conformity"].values()} == {"conforms"}
    assert data["days_and_cycles"]["touches_left_out"] == 0
    one, other = (data["parameters"][n]["repetitions"]["one_run"]["half_width"] for n in ("EX0S", "EY0C"))
    assert min(one, other) > 5e-4


@pytest.mark.long
def test_a_mistake_in_one_run_is_named_with_its_run(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with (cell / "repeated.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    good = [dict(row) for row in rows]
    for row in rows:
        if row["day"] == "2" and row["cycle"] == "1" and int(row["touch"]) > 120:
            row["X"] = f"{float(row['X']) + 0.012:.6f}"  # something slipped within this run
    write(cell, rows)
    _, data = told(cell, capsys)
    write(cell, good)
    assert data["verdict"] != "trustworthy"
    assert not any("varies from run to run" in text for text in data["remarks"])
    assert all("day 1" not in text and "day 3" not in text for text in data["reasons"])


@pytest.mark.long
def test_a_day_that_repeats_another_is_still_no_measurement(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with (cell / "repeated.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    good = [dict(row) for row in rows]
    first = [row for row in rows if row["day"] == "1"]
    copied = [row | {"day": "3", "time_s": str(float(row["time_s"]) + 2 * 86400)} for row in first]
    write(cell, [row for row in rows if row["day"] != "3"] + copied)
    _, data = told(cell, capsys, "--despite")
    write(cell, good)
    assert data["verdict"] != "trustworthy"


@pytest.mark.few(0)
def test_a_verdict_is_the_same_without_the_search_for_what_explains_it() -> None:
    """Of many runs that are not to be believed the mistake is looked for in three; the search is most of the time."""
    source = read_cell(EXAMPLES / "trunnion")
    readings = simulate(source.machine, source.artefact, source.strategy, read_world(EXAMPLES / "trunnion" / "world.yaml"))
    slipped = readings.position.copy()
    slipped[120:, 0] += 0.012
    spoilt = replace(readings, position=slipped)
    (_, one), (_, other) = (judged(source, spoilt, source.terms, explain=explain) for explain in (True, False))
    assert one.verdict == other.verdict != "trustworthy" and one.reasons == other.reasons and one.untrusted == other.untrusted
    assert one.suspicions and not other.suspicions
