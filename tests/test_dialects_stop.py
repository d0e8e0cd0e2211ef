"""Every dialect on the control that speaks it: what must not become a reading, and what must end the program with a text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
from support.dialects import EVERY, alike
from support.stopped import (
    made,  # noqa: F401  fixtures
    ran,
)

from postprocessors import load
from sim_controller.motion import Motion, Skip
from sim_controller.probing import rig
from tango_cnc.records import Obstacle, Plan, World

every_dialect = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.long if alike(name, "fanuc") else ()) for name in sorted(EVERY)]
)


@every_dialect
def test_a_probe_that_is_deflected_at_the_start_ends_it_before_anything_comes_down(made: Plan, name: str) -> None:
    touched, text, heights = ran(made, name, World(), stuck=True)
    assert not touched and len(text) > 10
    assert min(heights, default=999.0) > max(touch.over[2] for touch in made.touches)


@pytest.mark.few(6)
@every_dialect
def test_contact_on_the_way_ends_it_with_a_text(made: Plan, name: str) -> None:
    """The top is 40 mm higher than everybody thinks, so the stylus meets it between the first touch and the second."""
    touched, text, _ = ran(made, name, World(facets={"top": 40.0}))
    assert touched == ["ok"] and len(text) > 10


@pytest.mark.few(5)
@every_dialect
def test_contact_on_the_way_back_ends_it_with_a_text_and_the_touch_on_record(
    made: Plan, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Something has come to stand behind the probe while it touched facet 1: a plate, 4 mm from where the ball is then."""
    x, y, z = made.artefact.facets["1"].point
    plate = Obstacle("box", low=(x + 10, y - 4, z - 4), high=(x + 11, y + 4, z + 4))
    skip, collide = Motion.skip, Motion._collide
    unguarded: list[str] = []

    def touching(motion: Motion, target: Mapping[str, float], feed: float, **heard: Any) -> Skip:
        done = skip(motion, target, feed, **heard)
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
    assert not unguarded or load(name).language == "rs274"  # which guards a plain move itself


@pytest.mark.few(2)
@every_dialect
def test_a_miss_and_an_early_contact_are_on_record_as_such(made: Plan, name: str) -> None:
    assert ran(made, name, World(facets={"3": 7.0, "4": -8.0}))[0] == ["ok"] * 4 + ["early", "miss"]


@pytest.mark.few(5)
@every_dialect
def test_a_probe_that_never_answers_ends_it_at_the_third_touch(made: Plan, name: str) -> None:
    away = {key: replace(facet, point=(0.0, 0.0, -500.0), ball=None) for key, facet in made.artefact.facets.items()}
    nothing = replace(made, artefact=replace(made.artefact, facets=away, balls={}))
    touched, text, _ = ran(nothing, name, World())
    assert set(touched) <= {"miss"} and len(touched) <= 3 and len(text) > 10
