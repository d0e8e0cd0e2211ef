"""The Mach4 program with its Lua scripts on the simulated control, and what the control does without them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from support.controls import golden
from support.gates import ran

from postprocessors import companions, load, program, settings
from sim_controller.languages import Alarm, mach4
from sim_controller.motion import Motion
from sim_controller.probing import rig
from tango_cnc import readback
from tango_cnc.cli import guarded, tango
from tango_cnc.files import read_cell
from tango_cnc.link.client import Touched
from tango_cnc.link.words import record
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import InputError, Plan, World

GOLDEN = Path(__file__).parent / "golden" / "cell"


@pytest.fixture(scope="module")
def made() -> Plan:
    return plan(read_cell(GOLDEN))


def lines_of(made: Plan, **options: Any) -> list[str]:
    return list(program(load("mach4"), made, options, plan_hash(made))[2]())


def library(made: Plan, **options: Any) -> list[str]:
    return [line for name, lines in companions(load("mach4"), made, options).items() for line in (name, *lines)]


def run(
    lines: list[str],
    made: Plan,
    stored: list[str] | None = None,
    world: World | None = None,
    g54: Mapping[str, float] | None = None,
) -> tuple[list[str], str]:
    """program, Macros folder, true machine → lines of the file of records, what it stopped with."""
    out: list[bytes] = []
    profile = replace(mach4.default_profile(made.machine), g54=g54 or {})
    motion = Motion(rig(made.machine, made.artefact, world or World()))
    stop = ""
    try:
        control = mach4.Control(
            motion, profile, out.append, lambda event, **data: None, library(made) if stored is None else stored
        )
        control.run(lines, False)
    except Alarm as alarm:
        stop = str(alarm)
    return b"".join(out).decode("ascii").splitlines(), stop


def flags(lines: list[str], made: Plan) -> list[int]:
    return [event.flag for event in (record(line, made.machine.names) for line in lines) if isinstance(event, Touched)]


def test_the_scripts_write_every_record(made: Plan) -> None:
    lines, stop = run(lines_of(made), made)
    assert not stop and lines[0].startswith("TANGO START ") and re.fullmatch("TANGO END [0-9A-F]{12} 6", lines[-1])
    assert lines[0].split()[2] in "\n".join(lines_of(made)[:3]), "the mark of the loaded program"
    assert flags(lines, made) == [1] * 6
    assert lines[1] == "P1 H1 X-103.0000 Y-10.0000 Z280.0000 B0.0000 C0.0000 S0.0000 K167.0000"


def test_records_are_machine_coordinates_whatever_the_offset(made: Plan) -> None:
    assert run(lines_of(made), made, g54={"X": 11.5, "Y": -3.25, "Z": 100.25, "C": 7.0})[0] == run(lines_of(made), made)[0]


def test_a_miss_an_early_contact_and_contact_on_the_way(made: Plan) -> None:
    assert flags(run(lines_of(made), made, world=World(facets={"4": -8.0}))[0], made)[-1] == 0
    assert flags(run(lines_of(made), made, world=World(facets={"4": 7.0}))[0], made)[-1] == 2
    lines, stop = run(lines_of(made), made, world=World(facets={"top": 40.0}))
    assert "PROBE ON OR MET SOMETHING" in stop and len(lines) == 2


@pytest.mark.parametrize("looks", [True, False])
def test_its_program_looks_at_the_probe_where_g31_ignores_a_deflected_one(looks: bool) -> None:
    found = ran("mach4", golden(), {"gate": "none", "probe_state": looks}, probe="inverted", begins_deflected=True)
    moved = [event for event, _ in found.events if event in ("skip", "feed", "rapid", "contact", "collision")]
    assert ("PROBE IS DEFLECTED" in found.why and not moved) == looks


@pytest.mark.long
def test_the_read_back_misses_a_look(made: Plan) -> None:
    post, lines = load("mach4"), lines_of(made)
    for at in [i for i, line in enumerate(lines) if line == "M884"]:
        blind = [*lines[:at], *lines[at + 1 :]]
        with pytest.raises(InputError, match="without having asked whether the probe is deflected"):
            readback.check(partial(iter, blind), made, settings(post, {}), companions(post, made, {}))


def test_without_its_scripts_nothing_moves(made: Plan) -> None:
    lines, stop = run(lines_of(made), made, stored=[])
    assert (lines, "M883 has no script" in stop) == ([], True)


def test_axes_count_by_letter(made: Plan) -> None:
    assert "#105=#5025-#5045(B)" in lines_of(made) and "#106=#5026-#5046(C)" in lines_of(made)


def test_a_program_without_marks_is_not_begun(made: Plan) -> None:
    bare = [line.replace("TANGO START", "START") for line in lines_of(made)]
    assert "NO START MARK IN THE PROGRAM" in run(bare, made)[1]


def test_what_the_control_does_not_know(made: Plan) -> None:
    for line in ("DPRNT[X#1[44]]", "M900", "M880 G0 X1."):
        assert run([line, "M30"], made)[1], line


def test_the_name_of_the_file_goes_nowhere_but_into_a_string(made: Plan) -> None:
    for bad in ('a" os.remove("b', "Prüfung.txt"):
        with pytest.raises(InputError, match=r"controller\.readings"):
            lines_of(made, readings=bad)
        library(made, readings=bad)  # is made before anybody looks at the name
    assert any(line.endswith('.. "mine.txt"') for line in library(made, readings="mine.txt"))


def test_scripts_of_another_program_let_nothing_move(made: Plan) -> None:
    lines, stop = run(lines_of(made), made, stored=library(made, readings="mine.txt"))
    assert (lines, "SCRIPTS ARE NOT THOSE OF THIS PROGRAM" in stop) == ([], True)


def test_tango_plan_writes_the_scripts_beside_the_program(tmp_path: Path, capsys: pytest.CaptureFixture[str], made: Plan) -> None:
    arguments = ["plan", "-C", str(GOLDEN), "--post", "mach4", "--out", str(tmp_path)]
    assert guarded(tango.main, arguments, prog_name="tango", standalone_mode=False) == 0
    assert "beside  m880.mcs, m881.mcs, m882.mcs, m883.mcs, m884.mcs: have to be on the control too" in capsys.readouterr().out
    for name, lines in companions(load("mach4"), made, {}).items():
        assert (tmp_path / name).read_text() == "".join(f"{line}\n" for line in lines)
