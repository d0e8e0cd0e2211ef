"""Every dialect on the control that speaks it: what must not become a reading, and what must end the program with a text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
from support.controls import GOLDEN, Ran, run_on
from test_dialects import DRIVEN, EVERY, OFFSETS, driven

from postprocessors._base import companions, load, program
from sim_controller.motion import Motion, Skip
from sim_controller.probing import rig
from sim_controller.session import language
from tango_cnc.files import read_cell
from tango_cnc.link._client import Failed, Touched
from tango_cnc.link._trust import Gate, judge
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import Obstacle, Plan, World

AS_FANUC = ("brother", "mazak", "mitsubishi")  # the same text but for names and one word
every_dialect = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.long if name in AS_FANUC else ()) for name in sorted(EVERY)]
)


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
        library = tuple(line for file, lines in files.items() for line in (file if name != "heidenhain" else library[0], *lines))
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
    gate = Gate()
    return [judge(event, planned, made.machine, gate).status for event, planned in zip(touched, made.touches, strict=False)]


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


@every_dialect
def test_a_probe_that_is_deflected_at_the_start_ends_it_before_anything_comes_down(made: Plan, name: str) -> None:
    touched, text, heights = ran(made, name, World(), stuck=True)
    assert not touched and len(text) > 10
    assert min(heights, default=999.0) > max(touch.over[2] for touch in made.touches)


@every_dialect
def test_contact_on_the_way_ends_it_with_a_text(made: Plan, name: str) -> None:
    """The top is 40 mm higher than everybody thinks, so the stylus meets it between the first touch and the second."""
    touched, text, _ = ran(made, name, World(facets={"top": 40.0}))
    assert touched == ["ok"] and len(text) > 10


@every_dialect
def test_contact_on_the_way_back_ends_it_with_a_text_and_the_touch_on_record(
    made: Plan, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Something has come to stand behind the probe while it touched facet 1: a plate, 4 mm from where the ball is then."""
    x, y, z = made.artefact.facets["1"].point
    plate = Obstacle("box", low=(x + 10, y - 4, z - 4), high=(x + 11, y + 4, z + 4))
    skip, collide = Motion.skip, Motion._collide
    unguarded: list[str] = []

    def touching(motion: Motion, target: Mapping[str, float], feed: float) -> Skip:
        done = skip(motion, target, feed)
        if done.hit and motion.touches == 1:
            motion.rig = rig(made.machine, replace(made.artefact, obstacles=(plate,)), World())
        return done

    def colliding(motion: Motion, kind: str, *where: Any) -> None:
        unguarded.append(kind)
        collide(motion, kind, *where)

    monkeypatch.setattr(Motion, "skip", touching)
    monkeypatch.setattr(Motion, "_collide", colliding)
    touched, text, _ = ran(made, name, World())
    assert touched == ["ok"] and len(text) > 10
    assert not unguarded or name == "linuxcnc"  # which guards a plain move itself


@every_dialect
def test_a_miss_and_an_early_contact_are_on_record_as_such(made: Plan, name: str) -> None:
    assert ran(made, name, World(facets={"3": 7.0, "4": -8.0}))[0] == ["ok"] * 4 + ["early", "miss"]


@every_dialect
def test_a_probe_that_never_answers_ends_it_at_the_third_touch(made: Plan, name: str) -> None:
    away = {key: replace(facet, point=(0.0, 0.0, -500.0), ball=None) for key, facet in made.artefact.facets.items()}
    nothing = replace(made, artefact=replace(made.artefact, facets=away, balls={}))
    touched, text, _ = ran(nothing, name, World())
    assert set(touched) <= {"miss"} and len(touched) <= 3 and len(text) > 10
