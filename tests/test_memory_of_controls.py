"""A control with a small memory: a program longer than it is refused as it is stored, and its parts are carried out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import pytest
from support.controls import golden
from support.dialects import ALONE, EXAMPLE

from postprocessors import load, of_part, program
from sim_controller.languages import Alarm
from sim_controller.motion import Motion
from sim_controller.probing import rig
from sim_controller.session import language
from tango_cnc.files import read_cell
from tango_cnc.plan import plan, plan_hash
from tango_cnc.program import parts
from tango_cnc.records import Plan, World

LIMITED = [name for name in ALONE if getattr(language(ALONE[name].family).default_profile(golden().machine), "memory", 0)]


@cache
def whole() -> Plan:
    """→ every touch of the HU40T."""
    return plan(read_cell(EXAMPLE), "warn")


def texts(name: str, found: Sequence[Plan], of: Plan) -> list[list[str]]:
    """dialect, parts of a plan → the program of each, as it goes into the control."""
    frame, many = ALONE[name].frame, len(found)
    lines = [
        list(program(load(name), part, of_part(load(name), {}, (i, many)), plan_hash(of), (i, many))[2]())
        for i, part in enumerate(found, 1)
    ]
    return [text[frame : len(text) - frame] for text in lines]


def carried_out(name: str, text: Sequence[str], made: Plan, room: int) -> tuple[int, int]:
    """dialect, program, plan, kB of the control → records that it printed, blocks that it carried out. Raises Alarm."""
    spoken = ALONE[name]
    spoke = language(spoken.family)
    settings = replace(spoke.default_profile(made.machine), memory=room, **spoken.settings)
    printed: list[bytes] = []
    events: list[str] = []
    motion = Motion(rig(made.machine, made.artefact, World(noise=0.0)))
    control = spoke.Control(motion, settings, printed.append, lambda event, **data: events.append(event), spoken.library)
    try:
        control.run(text, False)
    except Alarm as alarm:
        assert "block" not in events, "it has carried out something before it complained"
        raise alarm
    return b"".join(printed).count(b" H"), events.count("block")


def test_every_post_for_a_control_with_a_small_memory_says_how_much_a_program_may_have() -> None:
    for name in LIMITED:
        assert load(name).memory, (
            f"postprocessors/{name}.py: a control of the language {load(name).language} keeps programs in a small memory and "
            "refuses a longer one: state memory=kB of the Post, so that its programs are split"
        )
    assert {load(name).language for name in LIMITED} >= {"fagor", "macro_b", "osp", "siemens"}, "no control has a memory any more"


@pytest.mark.few(1)
@pytest.mark.parametrize("name", LIMITED)
def test_a_program_longer_than_the_memory_moves_nothing_and_its_parts_do(name: str) -> None:
    made = golden()
    (long,) = texts(name, (made,), made)
    size = sum(len(line) + 1 for line in long) / 1000
    room = int(0.92 * size)
    with pytest.raises(Alarm, match=f"MEMORY.*more than {room} kB"):
        carried_out(name, long, made, room)
    found = parts(load(name), made, {"memory": room})
    assert len(found) > 1
    records = [carried_out(name, text, part, room)[0] for text, part in zip(texts(name, found, made), found, strict=True)]
    assert sum(records) == len(made.touches)


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in LIMITED if name != "okuma"])
def test_the_hu40t_is_refused_whole_by_a_control_of_256_kb_and_every_part_of_it_is_taken(name: str) -> None:
    made = whole()
    with pytest.raises(Alarm, match="more than 256 kB"):
        carried_out(name, texts(name, (made,), made)[0], made, 256)
    found = parts(load(name), made, {"memory": 256})
    assert len(found) > 2
    for text in texts(name, found, made):
        assert sum(len(line) + 1 for line in text) <= 256_000


@pytest.mark.long
def test_the_parts_of_the_hu40t_measure_every_touch_on_a_control_of_256_kb() -> None:
    made = whole()
    found = parts(load("fanuc"), made, {"memory": 256})
    records = [carried_out("fanuc", text, part, 256)[0] for text, part in zip(texts("fanuc", found, made), found, strict=True)]
    assert sum(records) == len(made.touches)
