"""`tango compare`: two readings files of one plan, touch by touch."""

import csv
import json
import math

import numpy as np
import pytest
from support.runs import Result

from tango_cnc.commands.init import write_example
from tango_cnc.compare import compare, latch
from tango_cnc.files import read_cell, read_readings
from tango_cnc.plan import plan
from tango_cnc.records import InputError

STRATEGY = """\
name: sixty touches
approach: {standoff: 10, search: 5, feed: 180}
indexations:
  - {S: 0, B: 30, C: -90, facets: [3, 5, 8, 9, 10, 11, 14, 16, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28]}
  - {S: 0, B: -45, C: 135, facets: [3, 5, 6, 8, 9, 10, 21, 22, 23, 24, 25, 26, 27, 28]}
  - {S: 0, B: 0, C: 180, facets: [3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28]}
"""


@pytest.fixture
def cell(tmp_path):
    folder = tmp_path / "cell"
    write_example(folder, "hu40t")
    (folder / "strategy.yaml").write_text(STRATEGY)
    assert Result("simulate", "-C", folder, "-o", folder / "simulated.csv", "--exact").code == 0
    return folder


def changed(folder, change):
    """simulated.csv with every row changed → readings.csv"""
    with (folder / "simulated.csv").open() as file:
        rows = list(csv.DictReader(file))
    kept = [row for row in rows if change(row) is not False]
    with (folder / "readings.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(kept)


def latched(folder, period):
    """What a control reads that takes the position at its next look at the probe, on a grid that begins at the stand-off."""
    touches = {touch.number: touch for touch in plan(read_cell(folder)).touches}

    def change(row):
        touch = touches[int(row["touch"])]
        start, way = np.array(touch.standoff[:3]), np.subtract(touch.contact, touch.standoff)[:3]
        step = float(row["feed"]) / 60 * period * way / np.linalg.norm(way)
        at = np.array([float(row[name]) for name in "XYZ"])
        place = start + math.ceil((at - start) @ step / (step @ step)) * step
        row.update({name: repr(float(value)) for name, value in zip("XYZ", place, strict=True)})

    return change


@pytest.mark.long
def test_what_a_sampled_probe_does_is_found_and_explained(cell):
    changed(cell, latched(cell, 0.002))
    result = Result("compare", "-C", cell, "--with", cell / "simulated.csv", "--period", "0.002", "--json", cell / "found.json")
    found = json.loads((cell / "found.json").read_text())
    assert result.code == 0 and "58 touches" in result.out and "looked at once in 2 ms: mean +3.00 µm" in result.out
    assert found["latch"]["mean_um"] == pytest.approx(3.0)
    assert found["latch"]["std_um"] == pytest.approx(6 / math.sqrt(12))
    assert found["mean_um"] == pytest.approx(3.0, abs=3 * found["latch"]["std_um"] / math.sqrt(58))
    assert found["std_um"] == pytest.approx(found["latch"]["std_um"], rel=0.2)
    assert found["min_um"] >= -1e-3 and found["max_um"] <= 6.001 and found["across_max_um"] < 0.05
    assert sum(group["touches"] for group in found["by_direction"].values()) == 58
    assert {"X+", "X-", "Z-"} <= set(found["by_direction"])


@pytest.mark.few(0)
def test_the_same_readings_do_not_differ(cell):
    changed(cell, lambda row: None)
    found = json.loads(Result("compare", "-C", cell, "--with", cell / "simulated.csv", "--json", "-").out)
    assert (found["mean_um"], found["std_um"], found["only_in_first"]) == (0.0, 0.0, 0)
    assert "latch" not in found


@pytest.mark.few(0)
def test_touches_that_only_one_made_are_counted(cell):
    changed(cell, lambda row: row["touch"] != "7" and row.update(status="miss" if row["touch"] == "9" else row["status"]))
    result = Result("compare", "-C", cell, "--with", cell / "simulated.csv")
    assert "56 touches" in result.out and "0 touches that only the first file has, 2 that only the second has" in result.out


def test_readings_of_another_plan_are_refused(cell):
    def swap(row):
        row["facet"] = "6" if row["touch"] == "5" else row["facet"]

    changed(cell, swap)
    result = Result("compare", "-C", cell, "--with", cell / "simulated.csv")
    assert result.code == 2 and "touch 5 is on another facet or at other angles" in result.err


def test_a_period_needs_feeds(cell):
    with pytest.raises(InputError, match="no column feed"):
        latch(np.array([180.0, np.nan]), 0.001)


def test_feeds_that_vary_scatter_by_their_means_too():
    mean, std = latch(np.array([60.0, 180.0]), 0.001)
    late = np.concatenate([np.linspace(0, 1e-3, 2001), np.linspace(0, 3e-3, 2001)])
    assert (mean, std) == (pytest.approx(late.mean()), pytest.approx(late.std(), rel=1e-3))


def test_the_direction_of_the_approach_is_that_of_the_axes(cell):
    """A facet of the table that turns is approached as the plan does it, not as the table has it."""
    parts = read_cell(cell)
    readings = read_readings(cell / "simulated.csv", parts.machine, parts.artefact)
    made = plan(parts)
    found = compare(parts.machine, parts.artefact, readings, readings)
    for main, touch in zip(found.main, made.touches, strict=True):
        way = np.subtract(touch.contact, touch.standoff)[:3]
        k = "XYZ".index(main[0])
        assert abs(way[k]) == pytest.approx(np.abs(way).max()) and (way[k] > 0) == (main[1] == "+")


@pytest.mark.long
def test_readings_of_another_machine_are_said(cell):
    """The other file lies in the cell of another machine, and an edited row in this one."""
    other = cell.with_name("other")
    write_example(other, "hu40t")
    machine = (other / "machine.yaml").read_text()
    name = read_cell(cell).machine.name
    (other / "machine.yaml").write_text(machine.replace(f"name: {name}", "name: the one beside it"))
    (other / "strategy.yaml").write_text(STRATEGY)
    assert Result("simulate", "-C", other, "-o", other / "simulated.csv", "--exact").code == 0
    file = cell / "simulated.csv"
    file.write_text(file.read_text().replace(",ok,1,1,180", ",ok,1,1,181", 1))
    said = Result("compare", "-C", cell, "--with", other / "simulated.csv").out
    assert "is of the machine 'the one beside it'" in said
    assert "1 rows are not as they were written (lines 2)" in said
    same = Result("compare", "-C", other, "--with", other / "simulated.csv").out
    assert "is of the machine" not in same and "as they were written" not in same
