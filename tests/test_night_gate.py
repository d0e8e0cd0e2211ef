"""Nobody is there at night: which programs a night accepts, and where the facet has to have been found that proves the probe."""

from __future__ import annotations

import os
import re
import shutil
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from support.common_parts import asks_for_a_finger
from support.controls import GOLDEN, golden
from support.gates import ran
from support.nights_parts import RealControl, Story, nights, nights_of
from support.profiles import spoken
from support.proof_parts import keys_of

import postprocessors as posts
from postprocessors import load, program
from sim_controller.simulate import simulate
from tango_cnc import readback
from tango_cnc.cli import guarded, tango
from tango_cnc.commands._night_gate import NEAR, as_found, proves
from tango_cnc.files import read_cell, read_world
from tango_cnc.files.commissioning import Proof, add_proofs
from tango_cnc.files.nightly import Nightly
from tango_cnc.files.origin import write_origin
from tango_cnc.files.readings import readings_text
from tango_cnc.gate import BENT, proving_touch
from tango_cnc.history import opened
from tango_cnc.plan import part, plan, plan_hash
from tango_cnc.records import Artefact, Cell, InputError, Plan, World


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    shutil.copytree(GOLDEN, tmp_path / "cell")
    return with_gate(read_cell(tmp_path / "cell"), "facet")


def with_gate(cell: Cell, which: str) -> Cell:
    assert cell.controller is not None
    return replace(cell, controller=replace(cell.controller, options={"gate": which, "probe_state": 1004}))


def measured(cell: Cell, by: float) -> None:
    """Writes the readings of a run that found every facet `by` mm farther behind than the plan has it."""
    found = simulate(cell.machine, cell.artefact, cell.strategy, World())
    found = getattr(found, "readings", found)
    one = proving_touch(golden())
    linear = [cell.machine.column(name) for name in cell.machine.linear]
    way = (np.array(one.end) - np.array(one.standoff))[linear]
    position = found.position.copy()
    position[np.ix_([f == one.facet for f in found.facet], linear)] += by * way / np.linalg.norm(way)
    (cell.folder / "readings.csv").write_text(readings_text(replace(found, position=position)), encoding="utf-8")


def test_a_night_takes_no_program_that_waits_for_a_finger(cell: Cell) -> None:
    said = proves(with_gate(cell, "finger"), golden())
    assert not said.passed and "gate: facet" in said.do
    assert "tango run" in said.do and "probe_state" not in said.do  # that is stated
    assert cell.controller is not None
    said = proves(replace(cell, controller=replace(cell.controller, options={})), golden())
    assert "probe_state" in said.do  # all that is missing at once
    said = proves(with_gate(cell, "none"), golden())
    assert said.passed and "nothing proves the probe alive" in said.found


def test_a_cell_that_is_the_folder_where_somebody_stands_has_a_name(cell: Cell, monkeypatch: pytest.MonkeyPatch) -> None:
    """ "readings.csv of  found it +0.02 mm from the plan"."""
    measured(cell, 0.1)
    monkeypatch.chdir(cell.folder)
    here = replace(cell, folder=Path())
    assert "readings.csv of cell found it" in proves(here, golden()).found
    assert "of cell" in proves(with_gate(here, "finger"), golden()).do


def test_where_a_run_has_found_the_facet_only_the_setting_is_missing(cell: Cell) -> None:
    """ "measure once with a person at the machine", an hour after the whole run."""
    measured(cell, 0.1)
    said = proves(with_gate(cell, "finger"), golden())
    assert not said.passed and "nothing has to be measured" in said.do and "readings.csv" in said.do
    assert "gate: facet under controller:" in said.do and "tango run" not in said.do
    measured(cell, NEAR + 0.05)
    assert "measure once with a person" in proves(with_gate(cell, "finger"), golden()).do


@pytest.mark.parametrize(("by", "passed"), [(0.0, True), (NEAR - 0.05, True), (NEAR + 0.05, False), (-NEAR - 0.05, False)])
def test_the_facet_has_to_be_where_the_last_run_found_it(cell: Cell, by: float, passed: bool) -> None:
    measured(cell, by)
    said = proves(cell, golden())
    assert said.passed == passed and f"{by:+.2f} mm" in said.found
    assert passed or "tango locate" in said.do


def test_a_stylus_that_was_replaced_and_entered_is_named_first_with_a_way_on(cell: Cell) -> None:
    """machine.yaml length 90 → 110: eleven nights said "find the table again: tango locate", which refused."""
    measured(cell, 0.0)
    write_origin(cell.folder / "readings.csv", cell.folder, "measured")
    file = cell.folder / "machine.yaml"
    length = cell.machine.probe.length
    other = re.sub(r"(?m)(\blength: *)[0-9.]+", rf"\g<1>{length + 20:g}", file.read_text(encoding="utf-8"), count=1)
    file.write_text(other, encoding="utf-8")
    changed = with_gate(read_cell(cell.folder), "facet")
    assert changed.machine.probe.length == length + 20
    said = proves(changed, plan(changed))
    what = f"somebody has changed machine.yaml (probe.length {length:g} → {length + 20:g})"
    assert not said.passed and said.found.startswith(what)
    assert "tango locate" not in said.do and said.do.startswith("look first whether what was changed in machine.yaml is right")
    assert "gate: finger" in said.do and "'tango run'" in said.do and "gate: facet there again" in said.do
    assert as_found(changed, plan(changed), load("fanuc")).met == {}
    found = simulate(changed.machine, changed.artefact, changed.strategy, World())  # one run with a person
    (cell.folder / "readings.csv").write_text(readings_text(getattr(found, "readings", found)), encoding="utf-8")
    write_origin(cell.folder / "readings.csv", cell.folder, "measured")
    assert proves(changed, plan(changed)).passed


def test_nobody_there_sees_a_stylus_that_hangs_aside(cell: Cell) -> None:
    """The variable of the input is stated, or somebody has tried it: else a night is refused. A person may run without."""
    measured(cell, 0.0)
    assert cell.controller is not None
    bare = replace(cell, controller=replace(cell.controller, options={"gate": "facet"}))
    said = proves(bare, golden())
    assert not said.passed and "probe_state is not stated" in said.found and "tango commission" in said.do
    key = keys_of(bare, load("fanuc"))["deflected"]
    for verdict, passed in (("FAIL", False), ("PASS", True)):
        add_proofs(cell.folder, "fanuc", [Proof("deflected", verdict, "tried", profile=key)])
        assert proves(bare, golden()).passed == passed
    for post in ("siemens", "heidenhain", "linuxcnc", "fagor"):  # these look, or the control refuses by itself
        other = replace(bare, controller=replace(cell.controller, post=post, options={"gate": "facet"}))
        assert proves(other, golden()).passed, post


def test_a_facet_that_no_run_has_touched_proves_nothing(cell: Cell) -> None:
    said = proves(cell, golden())
    assert not said.passed and "tango run" in said.do


@pytest.mark.long
@pytest.mark.parametrize("name", ["trunnion", "fork_head"])
def test_a_check_that_the_program_chooses_begins_with_the_facet_that_proves_the_probe(
    root: Path, tmp_path: Path, name: str
) -> None:
    folder = root / "examples" / name
    cell = with_gate(read_cell(folder), "facet")
    with opened(tmp_path / "history.db") as history:
        ((record, _),) = nights(cell, read_world(folder / "world.yaml"), history, 1, 3, Story())
        made = plan(cell)
        analysis = nights_of(cell, Nightly(diagnose=False), made, deep=False)
        day = datetime.fromisoformat(record["start_utc"]).timestamp() / 86_400 + 1
        kind, _, touches = analysis.choice(history, day)
    assert kind == "check" and 20 < len(touches) < len(made.touches) / 2
    assert proving_touch(part(made, touches)).number == proving_touch(made).number
    points = {p.check: p for p in RealControl(cell, Nightly(), made, None, "now").preflight(kind, touches)}
    assert f"{len(touches)} touches" in points["program"].found  # of this night, and not of the whole strategy


def test_programs_that_a_person_starts_ask_for_the_finger() -> None:
    assert asks_for_a_finger({"gate": "facet", "misses": 3}) == {"gate": "finger", "misses": 3}
    assert asks_for_a_finger({"gate": "none"}) == {"gate": "none"}


@pytest.mark.long
def test_a_run_that_trusts_a_facet_is_refused_where_nobody_has_found_it(cell: Cell, capsys: pytest.CaptureFixture[str]) -> None:
    settings = cell.folder / "tango.yaml"
    settings.write_text(spoken(settings.read_text(), "post: fanuc, gate: facet, probe_state: 1004, port: 'socket://127.0.0.1:9'"))
    assert read_cell(cell.folder).controller == replace(
        cell.controller, options={"gate": "facet", "probe_state": 1004}, port="socket://127.0.0.1:9"
    )  # type: ignore[type-var]
    tries = ["run", "-C", str(cell.folder), "--yes"]
    assert guarded(tango.main, tries, prog_name="tango", standalone_mode=False) == 2
    said = capsys.readouterr().err
    assert "no run has touched it yet" in said and "gate: finger" in said and "Nothing was sent" in said
    measured(cell, NEAR + 0.05)
    assert guarded(tango.main, tries, prog_name="tango", standalone_mode=False) == 2
    assert "tango locate" in capsys.readouterr().err
    measured(cell, 0.0)
    assert guarded(tango.main, tries, prog_name="tango", standalone_mode=False) == 3  # nobody listens there: it would begin


def off_by(by: float) -> tuple[Plan, Artefact]:
    """mm → the plan with the facet found so far behind its place, and the artefact that really stands there."""
    made = golden()
    one = proving_touch(made)
    linear = [made.machine.column(name) for name in made.machine.linear]
    way = (np.array(one.end) - np.array(one.standoff))[linear]
    way = way / np.linalg.norm(way)
    facet = made.artefact.facets[one.facet]
    there = replace(facet, point=tuple(np.array(facet.point) - by * np.array(facet.normal)))
    artefact = replace(made.artefact, facets={**made.artefact.facets, one.facet: there})
    return replace(made, met={one.number: by}, met_in="readings.csv"), artefact


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["fanuc", pytest.param("grbl", marks=pytest.mark.long), pytest.param("okuma", marks=pytest.mark.long)]
)
@pytest.mark.parametrize("by", [-0.9, 0.9])
def test_the_search_ends_half_a_millimetre_behind_where_the_last_run_found_the_facet(name: str, by: float) -> None:
    """Behind its place in the plan a live probe would not have met it, or a dead one would be bent by 1.35 mm."""
    made, artefact = off_by(by)
    facet = {"gate": "facet"}
    alive = ran(name, made, facet, person=False, really=artefact)
    assert not alive.why and not alive.stops
    dead = ran(name, made, facet, person=False, probe="dead", really=artefact)
    bent = [data["depth"] for event, data in dead.events if event == "bent"]
    assert (dead.why or dead.stops) and 0.4 < max(bent) <= BENT
    lines = list(program(load(name), made, facet, plan_hash(made))[2]())
    assert any(f"{by:+.2f} MM FROM THE PLAN AS LAST FOUND".replace("+", "") in line.replace("+", "") for line in lines[:40])
    readback.check(lambda: iter(lines), made, posts.settings(load(name), facet), written_in=load(name).language)
    with pytest.raises(InputError):  # a program for another place is not this one
        readback.check(lambda: iter(lines), golden(), posts.settings(load(name), facet), written_in=load(name).language)


def test_the_place_is_that_of_the_last_run_and_of_none_before_the_table_was_moved(cell: Cell) -> None:
    one, post = proving_touch(golden()), load("fanuc")
    assert as_found(cell, golden(), post).met == {}
    measured(cell, 0.123)
    found = as_found(cell, golden(), post)
    assert found.met[one.number] == pytest.approx(0.10) and found.met_in == "readings.csv"  # towards the probe
    assert as_found(with_gate(cell, "finger"), golden(), post).met == {}
    assert proves(cell, found).passed and "+0.12 mm" in proves(cell, found).found
    later = (cell.folder / "readings.csv").stat().st_mtime + 3600
    os.utime(cell.folder / "artefact.yaml", (later, later))
    assert as_found(cell, golden(), post).met == {} and not proves(cell, golden()).passed


@pytest.mark.long
def test_the_plan_says_which_place_it_is(cell: Cell, capsys: pytest.CaptureFixture[str]) -> None:
    file = cell.folder / "tango.yaml"
    file.write_text(spoken(file.read_text(), "post: fanuc, gate: facet, probe_state: 1004"))
    for by, words in (
        (None, "no run has found it: the search ends 0.45 mm"),
        (-0.5, "readings.csv found it -0.50 mm from the plan"),
    ):
        if by is not None:
            measured(cell, by)
        assert not guarded(tango.main, ["plan", "-C", str(cell.folder)], prog_name="tango", standalone_mode=False)
        assert words in capsys.readouterr().out
