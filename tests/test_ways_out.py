"""A stop leaves things in order where the control carries anything out then; where it cannot, the header names the words."""

from __future__ import annotations

import pytest
from support.controls import golden
from support.dialects import EVERY
from support.gates import ran

from postprocessors._base import companions, load, names, program, settings
from sim_controller.motion import Motion
from sim_controller.probing import rig
from tango_cnc import readback
from tango_cnc.plan import plan_hash
from tango_cnc.records import InputError, World

OFF = {"probe_on": "M720", "probe_off": "M721"}
TIDY = ("centroid", "fagor", "heidenhain", "linuxcnc", "mach3", "okuma", "siemens")
ALARMED = tuple(n for n in names() if load(n).language in ("macro_b", "mach4"))


def lines_of(name: str) -> list[str]:
    made = golden()
    return list(program(load(name), made, OFF, plan_hash(made))[2]())


def test_mach3_switches_the_probe_off_before_it_stops() -> None:
    found = ran("mach3", golden(), OFF, person=False)  # nobody touches the stylus
    assert "NO CONTACT" in found.why
    assert [data["code"] for event, data in found.events if event == "m" and data["code"] in (720, 721)] == [720, 721]


def test_the_read_back_refuses_macros_of_mach3_that_leave_the_probe_on() -> None:
    made, options = golden(), settings(load("mach3"), OFF)
    files = companions(load("mach3"), made, OFF)
    readback.check(lambda: iter(lines_of("mach3")), made, options, files)
    for file, text in files.items():
        at = [i for i, line in enumerate(text) if line == '  Code "M721"']
        for lines in ([*text[: at[0]], *text[at[0] + 4 :]], [*text[: at[0]], '  Code "M720"', *text[at[0] + 1 :]]):
            with pytest.raises(InputError, match=f"{file}: a stop says"):
                readback.check(lambda: iter(lines_of("mach3")), made, options, {**files, file: lines})


@pytest.mark.parametrize("name", ALARMED)
def test_where_an_alarm_ends_everything_the_header_names_the_words(name: str) -> None:
    head = "\n".join(lines_of(name)[:25])
    assert "A STOP LEAVES THE PROBE ON - M721 IN MDI SWITCHES IT OFF" in head
    assert ("PCLOS IN MDI CLOSES IT" in head) == (name != "mach4")


def test_every_dialect_is_one_or_the_other() -> None:
    assert {*TIDY, *ALARMED, "grbl"} == set(EVERY)
    assert "SWITCH IT BY HAND" in "\n".join(lines_of("grbl")[:25])


def of_panel(**panel: float | bool) -> Motion:
    return Motion(rig(golden().machine, golden().artefact, World()), person=False, **panel)  # type: ignore[arg-type]


@pytest.mark.parametrize("panel", [{"override": 0.1}, {"dry_run": 6000.0}])
def test_override_and_dry_run_pass_the_probing_move_by(panel: dict[str, float]) -> None:
    """M700V manual p. 547; Fanuc 6200#7 SKF: what a shop is used to do in order to be safe does nothing here."""
    taken = {}
    for how in ({}, panel, {**panel, "skip_obeys": True}):
        motion = of_panel(**how)
        up = {"Z": float(motion.position[motion.machine.column("Z")]) - 5.0}
        motion.skip(up, 600.0)
        probing = motion.time
        motion.feed({"Z": up["Z"] + 5.0}, 600.0)
        taken[len(how)] = probing, motion.time - probing
    as_told, dialled, obeying = taken[0], taken[1], taken[2]
    assert dialled[0] == pytest.approx(as_told[0]) and dialled[1] != pytest.approx(as_told[1], rel=0.5)
    assert obeying[0] != pytest.approx(as_told[0], rel=0.5)


@pytest.mark.parametrize("name", ["fanuc", "linuxcnc"])
def test_a_program_of_protected_moves_is_as_fast_as_ever_at_a_tenth_of_the_override(name: str) -> None:
    """On a Fanuc every move near the table is a G31; on a LinuxCNC most are G1, and override acts."""
    whole, slow = (ran(name, golden(), override=override).clock() for override in (1.0, 0.1))
    assert (slow / whole < 1.3) == (name == "fanuc"), (whole, slow)
