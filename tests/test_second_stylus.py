"""A second stylus: its own program, its own offsets and tip in one estimate, and what it parts."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from support.dialects import EVERY, OFFSETS, QUICK, measured

from sim_controller.languages import Alarm
from sim_controller.motion import Motion
from sim_controller.probing import rig
from sim_controller.session import language
from sim_controller.simulate import simulate
from tango_cnc.cli import guarded, tango
from tango_cnc.commands._stylus import bought
from tango_cnc.commands.estimate import as_json
from tango_cnc.commands.report import paper
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import joined, read_cell, read_readings, read_world, readings_text
from tango_cnc.model import residual
from tango_cnc.plan import by_stylus, plan
from tango_cnc.records import Cell, InputError, Readings, TangoError, World
from tango_cnc.uncertainty._batch import batch, gaps
from tests.support.controls import lines_of
from tests.support.iso_coverage import one

EXAMPLE = Path(__file__).parents[1] / "examples" / "hu40t"
GOLDEN = Path(__file__).parent / "golden" / "cell"
LONGER = 60.0
OWN = {"EXt2": 0.021, "EYt2": -0.013, "EZt2": 0.15, "ERt2": 0.004}


def twice(cell: Cell, longer: float = LONGER) -> Cell:
    """cell → the same with a second stylus and every touch made again with it."""
    probe = cell.machine.probe
    machine = replace(cell.machine, styli=(probe, replace(probe, length=probe.length + longer)))
    again = tuple(replace(i, stylus=2) for i in cell.strategy.indexations)
    return replace(cell, machine=machine, strategy=replace(cell.strategy, indexations=(*cell.strategy.indexations, *again)))


def simulated(cell: Cell, world: World) -> Readings:
    parts = by_stylus(cell)
    done = [simulate(p.machine, p.artefact, p.strategy, replace(world, seed=world.seed + i)) for i, p in enumerate(parts)]
    numbered = [replace(r, touch=r.touch + p.strategy.before) for p, r in zip(parts, done, strict=True)]
    return joined(numbered[0], numbered[1], 2)


@pytest.fixture(scope="module")
def whole() -> Cell:
    return twice(read_cell(EXAMPLE))


@pytest.fixture(scope="module")
def world() -> World:
    known = read_world(EXAMPLE / "world.yaml")
    return replace(known, stylus={**known.stylus, **OWN}, noise=0.0)


@pytest.fixture(scope="module")
def exact(whole: Cell, world: World) -> Estimate:
    return estimate(whole.machine, whole.artefact, simulated(whole, world), ("S3",))


@pytest.mark.long
def test_the_joint_estimate_finds_machine_and_both_styli(exact: Estimate, world: World) -> None:
    """The simulator shares no mathematics with the estimator; without noise both styli come back as they are."""
    for name, value in {**world.errors, **world.stylus}.items():
        assert exact.value(name) == pytest.approx(value, abs=2e-8), name
    assert exact.setup.keys() == {"EXt", "EYt", "EZt", *OWN}
    assert np.abs(exact.residuals).max() < 1e-8


def test_the_file_of_the_estimate_has_both_styli_as_the_terminal_has(exact: Estimate) -> None:
    data = as_json(exact, ())
    assert set(data["stylus"]) == set(data["stylus_std"]) >= {"EXt", "EYt", "EXt2", "EYt2", "EZt2", "ERt2"}
    assert data["stylus"]["EXt2"] == exact.setup["EXt2"].value


def test_monte_carlo_has_the_same_gaps(exact: Estimate) -> None:
    values = exact.values + np.random.default_rng(1).normal(size=(3, len(exact.values))) * 1e-5
    ready = batch(exact.model, np.float64)
    np.testing.assert_allclose(gaps(ready, values), np.array([residual(exact.model, v) for v in values]), atol=1e-9)


@pytest.mark.few(0)
def test_a_second_stylus_of_another_length_taken_for_the_first_is_not_believed(whole: Cell, world: World) -> None:
    """Who forgets the column stylus gets no estimate that looks right."""
    readings = replace(simulated(whole, world), stylus=None)
    with pytest.raises(TangoError, match="393 touches were made more than 5 mm from the facet"):
        estimate(whole.machine, whole.artefact, readings, ("S3",))


@pytest.mark.few(0)
def test_touches_keep_their_numbers_and_each_program_has_one_stylus(whole: Cell) -> None:
    first, second = (plan(part, "leave-out") for part in by_stylus(whole))
    count = sum(len(i.facets) for i in read_cell(EXAMPLE).strategy.indexations)
    assert [t.number - count for t in second.touches] == [t.number for t in first.touches]
    assert second.machine.probe.length == first.machine.probe.length + LONGER
    shorter, longer = (min(t.standoff[2] for t in made.touches) for made in (first, second))
    assert longer == pytest.approx(shorter + LONGER)
    with pytest.raises(InputError, match="one stylus a program"):
        plan(whole)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in QUICK[:2] else pytest.mark.long) for n in sorted(EVERY)])
def test_the_program_of_the_second_stylus_runs_in_every_dialect(name: str) -> None:
    """Read back as every program, then executed by the simulated control with that stylus in its spindle."""
    first, second = by_stylus(twice(read_cell(GOLDEN)))
    told = {p.machine.stylus: "\n".join(lines_of(name, plan(p))) for p in (first, second)}
    assert "STYLUS 2 360 MM LONG" in told[2].upper() and "STYLUS 1 300 MM LONG" in told[1].upper()
    found = measured(plan(second), name, World())
    assert set(found.status) == {"ok"}
    contact = np.array([t.contact for t in plan(second).touches])
    assert np.abs(found.position[:, :3] - contact[:, :3]).max() < 0.003


@pytest.mark.parametrize(("planned", "there"), [(1, 2), (2, 1)])
def test_the_other_stylus_in_the_spindle_stops_the_program(planned: int, there: int) -> None:
    """A shorter one meets nothing; a longer one meets what it should not, and the moves that watch the probe stop it."""
    machine = twice(read_cell(GOLDEN)).machine
    made = plan(by_stylus(twice(read_cell(GOLDEN)))[planned - 1])
    spoken = language("macro_b")
    punched: list[bytes] = []
    motion = Motion(rig(machine.with_stylus(there), made.artefact, World()))
    profile = replace(spoken.default_profile(made.machine), g54=OFFSETS)
    control = spoken.Control(motion, profile, punched.append, lambda event, **data: None, ())
    with pytest.raises(Alarm):
        control.run(lines_of("fanuc", made)[1:-1], False)
    assert b"END" not in b"".join(punched)


def write(cell: Path, longer: Sequence[float] = (LONGER,), again: bool = False) -> None:
    """folder of a cell → its machine has more styli, its strategy is repeated with the second one."""
    file = cell / "machine.yaml"
    data = yaml.safe_load(file.read_text())
    data["styli"] = [{"length": data["probe"]["length"] + more} for more in longer]
    file.write_text(yaml.safe_dump(data, sort_keys=False))
    file = cell / "strategy.yaml"
    data = yaml.safe_load(file.read_text())
    first = data["indexations"]
    data["indexations"] = [*first, *({**i, "stylus": 2} for i in first), *(first[:1] if again else ())]
    file.write_text(yaml.safe_dump(data, sort_keys=False))


def run(arguments: list[str]) -> int:
    return guarded(tango.main, arguments, standalone_mode=False)


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    folder = tmp_path / "cell"
    assert CliRunner().invoke(tango, ["init", str(folder), "--example", "hu40t"]).exit_code == 0
    write(folder)
    return folder


@pytest.mark.long
def test_the_command_line_from_check_to_iso_figures(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "-C", str(cell), "--json", "-"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert [s["stylus"] for s in data["styli"]] == [1, 2]
    assert {"EAY", "EBY", "ECZ"} <= set(data["figures"]) - set(data["one_stylus"]["figures"])
    assert run(["plan", "-C", str(cell)]) == 0
    assert f"tango plan -C {cell} --stylus 2" in capsys.readouterr().err
    assert run(["plan", "-C", str(cell), "--stylus", "2"]) == 0
    assert sorted(f.parent.name for f in (cell / "program").rglob("plan.csv")) == ["program", "stylus2"]
    assert run(["plan", "-C", str(cell), "--stylus", "3"]) == 2
    assert "allowed: 1, 2" in capsys.readouterr().err
    assert run(["simulate", "-C", str(cell), "--seed", "3"]) == 0
    capsys.readouterr()
    assert run(["iso230", "-C", str(cell), "--json", "-"]) == 0
    figures = {(f["kind"], f["name"]): f for f in json.loads(capsys.readouterr().out)["figures"]}
    for name in ("EAY", "EBY", "ECZ"):
        low, high = figures["angular", name]["interval"]
        assert low <= 0.0 <= high, "the simulated machine has no such tilt"


@pytest.mark.few(0)
def test_readings_of_two_runs_are_read_as_one(cell: Path) -> None:
    """tango run writes a file for each stylus; whoever reads the first reads both."""
    here = read_cell(cell)
    both = simulated(here, World())
    for number, name in ((1, "readings.csv"), (2, "readings.stylus2.csv")):
        rows = replace(both.rows(both.stylus == number), stylus=None)
        (cell / name).write_text(readings_text(rows), encoding="utf-8")
    read = read_readings(cell / "readings.csv", here.machine, here.artefact)
    assert read.stylus is not None and both.stylus is not None
    assert read.stylus.tolist() == both.stylus.tolist()
    assert read.touch.tolist() == both.touch.tolist() == list(range(1, len(both) + 1))
    assert (np.diff(read.time) >= 0).all()
    (cell / "together.csv").write_text(readings_text(both), encoding="utf-8")
    again = read_readings(cell / "together.csv", here.machine, here.artefact)
    assert again.stylus is not None and again.stylus.tolist() == both.stylus.tolist()


def test_a_stylus_that_is_changed_back_is_refused_in_words(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(cell, again=True)
    assert run(["check", "-C", str(cell)]) == 2
    said = capsys.readouterr().err
    assert "strategy.yaml:" in said and "one after the other" in said


@pytest.mark.few(0)
def test_a_stylus_that_the_machine_lacks_is_refused_in_words(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(cell, longer=())
    assert run(["check", "-C", str(cell)]) == 2
    assert "machine.yaml lists the others under styli" in capsys.readouterr().err


@pytest.mark.long
def test_tilts_come_back_that_one_stylus_cannot_part() -> None:
    """By an independent program: every error motion of every axis, a second stylus with its own offsets and tip."""
    alone, parted = ({(r[0], r[1]): r for r in one("hu40t", 1, longer)} for longer in (None, LONGER))
    for name in ("EAY", "EBY", "ECZ"):
        assert alone["angular", name][2] is None
        _, _, value, interval, truth = parted["angular", name]
        assert value is not None and interval is not None
        assert interval[0] <= truth <= interval[1], name


@pytest.mark.long
def test_a_plan_says_what_a_second_stylus_would_add() -> None:
    """Before one is bought: machine.yaml of the example has none, so one that is 60 mm longer is taken."""
    found = bought(plan(read_cell(EXAMPLE), "leave-out"), ("S3",), 3)
    assert found["length_mm"] == pytest.approx(386.674)
    assert {"EAY", "EBY", "ECZ"} <= set(found["more"])
    assert not {"VX", "VY", "VZ"} & set(found["more"])  # one stylus of this length decides positions over the volume
    assert found["alone"] < found["together"] <= found["figures"]


def test_the_report_has_the_hash_of_the_second_run(tmp_path: Path) -> None:
    (tmp_path / "tango.yaml").write_text("machine: machine.yaml\n", encoding="utf-8")
    for name in ("readings.csv", "readings.stylus2.csv"):
        (tmp_path / name).write_text(name, encoding="utf-8")
    known = {name: digest for name, _, digest in paper(tmp_path, tmp_path / "readings.csv", "", "").files}
    assert known["readings.stylus2.csv"] == hashlib.sha256(b"readings.stylus2.csv").hexdigest()


@pytest.mark.long
def test_a_second_stylus_as_long_as_the_first_is_said_to_part_nothing() -> None:
    """Twice as many touches decide seven figures more, with styli of one length, too: they were counted as what it adds."""
    cell = read_cell(EXAMPLE.parent / "trunnion")
    probe, said = cell.machine.probe, []
    for more in (0.0, LONGER):
        styli = probe, replace(probe, length=probe.length + more)
        found = bought(plan(replace(cell, machine=replace(cell.machine, styli=styli)), "leave-out"), ("S3",), 3)
        by = found["by_length"]
        said.append((len(found["more"]), by["adds"], by.get("least"), by.get("longer")))
    (equal, nothing, least, longer), (far, some, _, _) = said
    assert nothing == [] and equal > 5 and far == equal + len(some)
    assert least is not None and 0 < least["difference_mm"] <= LONGER and least["adds"]
    assert longer is not None and set(longer["adds"]) == set(some) == {"EZZ M", "EZZ (positioning gain)", "VA"}
