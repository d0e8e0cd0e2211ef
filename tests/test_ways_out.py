"""A stop leaves things in order: the probe off, the port closed; where nothing can be carried out, the header names the words."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import pytest
from support.controls import Ran, golden
from support.dialects import ALONE, DRIVEN, klartext
from support.gates import ran
from support.wrongcontrols import by_option

from postprocessors import companions, load, names, program, settings
from sim_controller.motion import Motion
from sim_controller.probing import rig
from tango_cnc import readback
from tango_cnc.plan import plan_hash
from tango_cnc.records import InputError, World

OFF = {"probe_on": "M720", "probe_off": "M721"}
OPENED, CLOSED = b"\x12", b"\x14"  # DC2 and DC4, which a port sends when it is opened and closed
JUMPING = tuple(n for n in names() if {"alarm", "macros"} <= {option.name for option in load(n).options})  # to a way out


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


SHORT = replace(golden().machine.probe, length=golden().machine.probe.length - 20.0)
WRONG: dict[str, dict[str, Any]] = {  # what stops a program, each at another place of it
    "nobody": {"person": False},
    "inverted": {"probe": "inverted"},
    "shorter": {"truly": replace(golden().machine, probe=SHORT)},  # nothing is met where the facets are
}
WORDS = {"rs274": ("M64 P1", "M65 P1"), "mach4": ("M52", "M53"), "centroid": ("M64", "M65")}  # of languages that have no M720
OTHERS = {"centroid": {"macros": ("M19", "M64", "M65")}}
QUICK = ("fanuc", "mach4")
EACH = [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in sorted(ALONE)]


def left_on(found: Ran, on: str, off: str) -> bool:
    """what came of a program, words that switch the probe → whether it is on."""
    codes = [data.get("code", data.get("why")) for event, data in found.events if event == "m"]
    words = " ".join(f"M{str(code).removeprefix('M')} " for code in codes)
    on, off = on.split()[0], off.split()[0]
    return words.rfind(f"{on} ") > words.rfind(f"{off} ")


@pytest.mark.parametrize("name", EACH)
@pytest.mark.parametrize("wrong", WRONG)
def test_at_every_alarm_the_probe_is_off_and_the_port_closed(name: str, wrong: str) -> None:
    language = load(name).language
    on, off = WORDS.get(language, ("M720", "M721"))
    found = ran(name, golden(), {"probe_on": on, "probe_off": off}, OTHERS.get(language), **WRONG[wrong])
    assert found.why or found.stops, f"postprocessors/{name}.py: its program ends as if nothing were wrong: {wrong}"
    if "TOUCH PROBE IS DEFLECTED" in found.why:  # Heidenhain's own alarm, at TCH PROBE
        assert klartext(name)
        return
    what = f"postprocessors/{name}.py: {found.why or 'a stop'} leaves the"
    assert not left_on(found, on, off), f"{what} probe on: write {off} before it"
    assert not [event for event, _ in found.events if event == "left open"], f"{what} port open"
    ported = OPENED in found.out or language == "macro_b"
    assert not ported or found.out.endswith(CLOSED), f"{what} port open"


@pytest.mark.few(12)
@pytest.mark.parametrize("name", JUMPING)
@pytest.mark.parametrize("looks", [False, True])
@pytest.mark.parametrize("macros", [{}, {"macros": "called"}])
def test_each_alarm_has_a_way_out_that_closes_the_port(name: str, macros: dict[str, Any], looks: bool) -> None:
    """Every alarm of the text stands behind the words that leave things in order, but those before the port is open."""
    made, state = golden(), by_option(name).get("probe_state")
    options = macros | (dict(state.mended or {}) if state and looks else {})
    lines = [re.sub(r"\([^()]*\)", "", line) for line in program(load(name), made, OFF | options, plan_hash(made))[2]()]
    file = f"postprocessors/{name}.py"
    assert "POPEN" in lines or load(name).language != "macro_b", f"{file}: a post of macro_b opens its port with POPEN"
    closing, opened = ["PCLOS"] * ("POPEN" in lines), lines.index("POPEN") if "POPEN" in lines else 0
    ends = [i for i, line in enumerate(lines) if line.startswith("#3000=")]
    ways = ["M721", *closing]
    assert ends and all(lines[i - len(ways) : i] == ways for i in ends), f"{file}: has `alarm`: {ways} stand before each #3000="
    assert not [line for line in lines[opened:] if "THEN#3000" in line], f"{file}: an alarm without its way out"
    goals = {line.partition("GOTO")[2] for line in lines if "GOTO" in line}
    assert goals <= {line[1:] for line in lines if re.fullmatch(r"N\d+", line)}, f"{file}: a GOTO to a number that is nowhere"


@pytest.mark.parametrize("name", ["fanuc", "mach4"])
@pytest.mark.parametrize("macros", ["inline", pytest.param("called", marks=pytest.mark.long)])
def test_the_read_back_refuses_an_alarm_that_leaves_something_on(name: str, macros: str) -> None:
    made = golden()
    stated = OFF if name == "mach4" else OFF | {"macros": macros}
    options, files = settings(load(name), stated), companions(load(name), made, stated)
    lines = list(program(load(name), made, stated, plan_hash(made))[2]())

    def refused(text: list[str]) -> str:
        with pytest.raises(InputError) as error:
            readback.check(lambda: iter(text), made, options, files, written_in=load(name).language)
        return str(error.value)

    ends = [i for i, line in enumerate(lines) if line.startswith("#3000=")]
    for i in ends[:: 1 if macros == "called" else 3]:
        assert re.search(r"or the port open|behind which an alarm|leaves it out", refused(lines[: i - 1] + lines[i:]))
        assert refused([*lines[: i - 1], "M720", *lines[i:]])
        number = lines[i].partition("=")[2].partition("(")[0]
        jump = next(k for k, line in enumerate(lines) if line.endswith(f"GOTO{int(number) + 8920}"))
        direct = lines[jump].partition("GOTO")[0] + "THEN" + lines[i]
        assert "leaves the probe on or the port open" in refused([*lines[:jump], direct, *lines[jump + 1 :]])
        assert "behind which an alarm" in refused([*lines[:jump], lines[jump][:-4] + "9999", *lines[jump + 1 :]])
    past = max(k for k, line in enumerate(lines) if line == "GOTO9000")
    assert refused(lines[:past] + lines[past + 1 :])  # the way out would be carried out where all has gone well
    assert "leaves it out" in refused([*lines[: past + 1], "G0 Z0.", *lines[past + 1 :]])


def test_an_alarm_at_once_leaves_the_port_open_where_no_word_switches_the_probe() -> None:
    made, post = golden(), load("fanuc")
    lines = list(program(post, made, {}, plan_hash(made))[2]())
    end = next(i for i, line in enumerate(lines) if line.startswith("#3000="))
    number = int(lines[end].partition("=")[2].partition("(")[0])
    jump = next(i for i, line in enumerate(lines) if line.endswith(f"GOTO{number + 8920}"))
    lines[jump] = lines[jump].partition("GOTO")[0] + "THEN" + lines[end]
    with pytest.raises(InputError, match="without PCLOS right before the alarm: it leaves the probe on or the port open"):
        readback.check(lambda: iter(lines), made, settings(post, {}), companions(post, made, {}), written_in=post.language)


def test_the_scripts_of_mach4_switch_the_probe_off_before_their_alarm() -> None:
    made, options = golden(), settings(load("mach4"), OFF)
    files = companions(load("mach4"), made, OFF)
    for file, text in files.items():
        lines = [line for line in text if "GcodeExecuteWait" not in line]
        assert len(lines) == len(text) - 1
        with pytest.raises(InputError, match=f"{file}: found"):
            readback.check(lambda: iter(lines_of("mach4")), made, options, {**files, file: lines}, written_in="mach4")


def test_a_drip_fed_program_cannot_jump_and_says_what_it_leaves_on() -> None:
    made, given = golden(), OFF | {"alarm": "at once"}
    lines = list(program(load("fanuc"), made, given, plan_hash(made))[2]())
    assert not [line for line in lines if "GOTO" in line]
    head = "\n".join(lines[:25])
    assert "A STOP LEAVES THE PROBE ON - M721 IN MDI SWITCHES IT OFF" in head and "PCLOS IN MDI CLOSES IT" in head
    readback.check(lambda: iter(lines), made, settings(load("fanuc"), given), {}, written_in="macro_b")
    assert "A RESET LEAVES THE PROBE ON" in "\n".join(lines_of("fanuc")[:25])


@pytest.mark.parametrize("name", sorted(DRIVEN))
def test_where_nothing_of_the_program_acts_after_a_stop_its_header_says_so(name: str) -> None:
    assert "SWITCH IT BY HAND" in "\n".join(lines_of(name)[:25]), f"postprocessors/{name}.py: its header says what a stop leaves on"


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


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["fanuc", "linuxcnc"])
def test_a_program_of_protected_moves_is_as_fast_as_ever_at_a_tenth_of_the_override(name: str) -> None:
    """On a Fanuc every move near the table is a G31; on a LinuxCNC most are G1, and override acts."""
    whole, slow = (ran(name, golden(), override=override).clock() for override in (1.0, 0.1))
    assert (slow / whole < 1.3) == (name == "fanuc"), (whole, slow)
