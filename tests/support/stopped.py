"""What several tests share of dialects stop."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from postprocessors import companions, load, program
from sim_controller.motion import Motion
from sim_controller.probing import rig
from sim_controller.session import language
from support.controls import GOLDEN, Ran, run_on
from support.dialects import DRIVEN, EVERY, OFFSETS, driven, klartext
from tango_cnc.files import read_cell
from tango_cnc.link.client import Failed, Touched
from tango_cnc.link.trust import Leeway, judge
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import Plan, World


@pytest.fixture(scope="module")
def made() -> Plan:
    return plan(read_cell(GOLDEN))


def ran(made: Plan, name: str, world: World, stuck: bool = False) -> tuple[list[str], str, list[float]]:
    """plan, dialect, true machine, probe deflected at first → what became of touches, what was shown at the end, heights, mm."""
    spoken = EVERY[name]
    family = language(spoken.family)
    profile = replace(family.default_profile(made.machine), g54=OFFSETS, **spoken.settings)
    if name in DRIVEN:
        return driven_to_its_end(made, family, profile, world, stuck)
    library = spoken.library
    if files := companions(load(name), made, {}):
        library = tuple(line for file, lines in files.items() for line in (library[0] if klartext(name) else file, *lines))
    lines = list(program(load(name), made, {}, plan_hash(made))[2]())
    done = run_on(
        lambda motion, punch, note: family.Control(motion, profile, punch, note, library),
        lines[spoken.frame : len(lines) - spoken.frame],
        made,
        world=world,
        stuck=stuck,
    )
    return judged(made, done.records(made)), shown(done), [place["Z"] for place in done.places]


def judged(made: Plan, events: list[Any]) -> list[str]:
    """plan, what the reader of the line has found → ok, miss or early of every touch on record, as `tango run` calls it."""
    touched = [event for event in events if isinstance(event, Touched)]
    leeway = Leeway()
    return [judge(event, planned, made.machine, leeway).status for event, planned in zip(touched, made.touches, strict=False)]


def shown(done: Ran) -> str:
    """→ all that a person at the control can read."""
    said = [str(data.get("message") or data.get("text") or data.get("why") or "") for event, data in done.events if event == "stop"]
    return " ".join([*done.messages, *said, str(done.alarm or "")]).strip()


def driven_to_its_end(made: Plan, family: Any, profile: Any, world: World, stuck: bool) -> tuple[list[str], str, list[float]]:
    heights: list[float] = []

    def note(event: str, **data: Any) -> None:
        if event in ("feed", "rapid", "skip", "contact"):
            heights.append(data["position"]["Z"])

    motion = Motion(rig(made.machine, made.artefact, world), note)
    motion._stuck = stuck
    events = driven(made, family.Control(motion, profile, lambda data: None, note))
    return judged(made, events), " ".join(str(event) for event in events if isinstance(event, Failed)), heights
