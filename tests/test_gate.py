"""Every program proves the probe alive before the first descent: a dead, a forgotten and a wrongly wired one touch nothing."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.controls import Ran, golden
from support.dialects import EVERY, klartext
from support.gates import NEAR, ran, written
from support.randomplans import example, random_plans
from support.readback import renumbered

from postprocessors import companions, load, program, unverified
from postprocessors import settings as settings_of
from tango_cnc import readback
from tango_cnc.gate import ALIVE_TIME, BENT, PROVING, STEP, TOUCH, gate, proving_touch, step
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import Indexation, InputError, Plan

STOPS = re.compile(r"GOTO9008|THEN#3000=88|NS8|GOTO 9006")  # where nothing was noticed
QUICK = ("fanuc", "siemens")  # of two families by default; the others take as long each and run in CI
DIALECTS = [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in sorted(EVERY)]


def events(found: Ran) -> list[str]:
    return [event for event, _ in found.events]


@pytest.mark.few(1)
@pytest.mark.parametrize("name", DIALECTS)
def test_a_finger_opens_the_way_to_the_table(name: str) -> None:
    found = ran(name, golden())
    assert not found.why and not found.stops
    assert events(found).index("finger") < events(found).index("contact")
    assert events(found).count("contact") == len(golden().touches)


@pytest.mark.parametrize("name", DIALECTS)
@pytest.mark.parametrize("who", [{"probe": "dead"}, {"probe": "other"}, {"probe": "inverted"}, {"person": False}], ids=str)
def test_without_it_nothing_comes_near_the_table(name: str, who: Mapping[str, Any]) -> None:
    found = ran(name, golden(), **who)
    assert found.why or found.stops
    assert not set(NEAR) & set(events(found))
    height = [place["Z"] for place in found.places]
    assert not height or min(height) >= gate(golden()).start[golden().machine.column("Z")] - 1e-6


@pytest.mark.parametrize("name", DIALECTS)
def test_what_a_dead_probe_does_where_nobody_asks_for_a_finger_is_said_before(name: str) -> None:
    found = ran(name, golden(), {"gate": "none"}, probe="dead")
    assert "collision" in events(found)
    assert any("nothing proves the probe alive" in doubt for doubt in unverified(load(name), {"gate": "none"}))
    assert not any("nothing proves the probe alive" in doubt for doubt in unverified(load(name), {}))


def counted(name: str, lines: list[str]) -> list[str]:
    """dialect, changed program → the same with its blocks counted anew, so that it is not refused for their numbers."""
    return renumbered([line.partition(" ")[2] for line in lines]) if klartext(name) else lines


def refused(name: str, made: Plan, lines: list[str]) -> bool:
    options = settings_of(load(name), {})
    try:
        readback.check(lambda: iter(counted(name, lines)), made, options, companions(load(name), made, {}))
    except InputError:
        return True
    return False


@pytest.mark.parametrize("name", DIALECTS)
def test_the_read_back_refuses_a_program_without_it(name: str) -> None:
    made = golden()
    lines = list(program(load(name), made, {}, plan_hash(made))[2]())
    at = next(i for i, line in enumerate(lines) if TOUCH in line)
    end = next(i for i, line in enumerate(lines) if "TOUCH 1 FACET" in line)
    assert refused(name, made, lines[:at] + lines[end:])
    without = list(program(load(name), made, {"gate": "none"}, plan_hash(made))[2]())
    assert refused(name, made, without)
    assert refused(name, made, [line.replace(TOUCH, "WAIT") for line in lines])  # nobody would know
    stops = [i for i in range(at, end) if STOPS.search(lines[i])]
    for i in stops:
        assert refused(name, made, lines[:i] + lines[i + 1 :]), lines[i]


def test_the_slow_move_is_one_for_a_person() -> None:
    up = gate(golden())
    assert math.dist(up.start, up.end) / up.feed * 60 == pytest.approx(ALIVE_TIME, rel=0.01)
    assert up.start == (golden().touches[0].enter or golden().touches[0].over)


@pytest.mark.few(0)
@settings(max_examples=20)
@given(st.floats(-1, 60))
def test_it_goes_where_there_is_room(room: float) -> None:
    """Up where the axis has way left, sideways at the clear level where it has none; never down."""
    made = golden()
    z = made.machine.column("Z")
    top = max(gate(made).start[z] + max(room, 0.0), gate(made).start[z])
    axes = tuple(replace(a, travel=(a.travel[0], top)) if a.name == "Z" and a.travel else a for a in made.machine.axes)
    up = gate(replace(made, machine=replace(made.machine, axes=axes)))
    way = np.array(up.end) - np.array(up.start)
    assert way[z] >= 0 and np.linalg.norm(way) == pytest.approx(10)
    assert (way[z] == pytest.approx(10)) == (room >= 10)
    for axis, value in zip(axes, up.end, strict=True):
        assert axis.travel is None or axis.travel[0] - 1e-9 <= value <= axis.travel[1] + 1e-9


FACET = {"gate": "facet"}
WAYS_IT_FAILS = ("dead", "other", "inverted")


def bent(found: Ran) -> float:
    """→ mm by which the stylus was bent without anybody noticing it."""
    return max((data["depth"] for event, data in found.events if event == "bent"), default=0.0)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", DIALECTS)
def test_a_facet_from_above_proves_the_probe_where_nobody_is_there(name: str) -> None:
    made = golden()
    found = ran(name, made, FACET, person=False)
    assert not found.why and not found.stops
    assert events(found).count("contact") == 1 + len(made.touches)
    assert len([line for line in found.lines if line.strip().startswith("P")]) == len(made.touches)
    files = companions(load(name), made, FACET)
    lines = list(program(load(name), made, FACET, plan_hash(made))[2]())
    readback.check(lambda: iter(lines), made, settings_of(load(name), FACET), files, written_in=load(name).language)


@pytest.mark.parametrize("name", DIALECTS)
@pytest.mark.parametrize("probe", WAYS_IT_FAILS)
def test_at_the_facet_a_probe_that_says_nothing_gives_way_and_is_found(name: str, probe: str) -> None:
    found = ran(name, golden(), FACET, person=False, probe=probe)
    assert found.why or found.stops
    assert not set(NEAR) & set(events(found))
    assert bent(found) <= BENT
    assert (bent(found) > 0.4) == (probe != "inverted")
    assert not [line for line in found.lines if line.strip().startswith("P")]


@pytest.mark.parametrize("name", DIALECTS)
def test_the_read_back_refuses_a_facet_that_stops_nothing_or_that_is_pressed_deeper(name: str) -> None:
    made = golden()
    options = settings_of(load(name), FACET)
    lines = list(program(load(name), made, FACET, plan_hash(made))[2]())
    at = next(i for i, line in enumerate(lines) if PROVING in line)
    end = next(i for i, line in enumerate(lines) if "TOUCH 1 FACET" in line)

    def refuses(text: list[str]) -> bool:
        try:
            whole = counted(name, text)
            readback.check(lambda: iter(whole), made, options, companions(load(name), made, FACET), written_in=load(name).language)
        except InputError:
            return True
        return False

    assert not refuses(lines)
    assert refuses(lines[:at] + lines[end:])
    assert refuses(list(program(load(name), made, {"gate": "finger"}, plan_hash(made))[2]()))
    z = golden().machine.column("Z")
    goal = f"{proving_touch(made).end[z]:g}"
    deeper = [line.replace(goal, f"{float(goal) - 1:g}") if at < i < end else line for i, line in enumerate(lines)]
    assert deeper != lines and refuses(deeper)
    stops = [i for i in range(at, end) if STOPS.search(lines[i])]
    for i in stops:
        assert refuses(lines[:i] + lines[i + 1 :]), lines[i]


def test_a_plan_that_touches_nothing_from_above_is_told_so() -> None:
    made = golden()
    sideways = replace(made, touches=[made.touches[0]], turns=made.turns)
    with pytest.raises(InputError, match=r"nothing from above.*allowed: a facet within 45 deg"):
        proving_touch(sideways)


def random_plans_with_a_bad_probe(seed: int, count: int) -> int:
    """→ programs that were run: finger or facet, every dialect, a dead, a wrongly wired or an inverted probe."""
    runs = 0
    for i, drawn in enumerate(random_plans(seed, count)):
        made = drawn.plan
        for which in ("finger", "facet"):
            try:
                proving_touch(made) if which == "facet" else gate(made)
            except InputError:
                continue
            for name in sorted(EVERY):
                probe = WAYS_IT_FAILS[(i + len(name)) % 3] if count > 20 else WAYS_IT_FAILS[i % 3]
                try:
                    written(name, made, {"gate": which})
                except InputError:  # the post refuses the plan: there is no program
                    continue
                found = ran(name, made, {"gate": which}, probe=probe, person=which == "finger")
                where = f"plan {i} of seed {seed}, {name}, {which}, {probe}"
                assert found.why or found.stops, where
                assert not set(NEAR) & set(events(found)), where
                assert bent(found) <= (BENT if which == "facet" else 0.0), (bent(found), where)  # a finger keeps it in the air
                runs += 1
    return runs


@pytest.mark.long
def test_in_random_plans_a_bad_probe_is_stopped_before_it_hits_anything() -> None:
    assert random_plans_with_a_bad_probe(11, 12) > 200


@pytest.mark.campaign
def test_in_a_thousand_random_plans_a_bad_probe_is_stopped_before_it_hits_anything() -> None:
    assert random_plans_with_a_bad_probe(12, 1000) > 14_000


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["fagor", "siemens"])
def test_the_text_does_not_stand_on_the_screen_when_the_hand_has_gone(name: str) -> None:
    """A text stands there until another one comes: LET GO OF THE STYLUS stood there to the end of the program."""
    found = ran(name, golden())
    shown = [(event, data) for event, data in found.events if event in ("message", "contact")]
    first = next(i for i, (event, _) in enumerate(shown) if event == "contact")
    asked = [data["text"] for event, data in shown[:first] if event == "message"]
    assert any(TOUCH in text for text in asked) and not any(word in asked[-1] for word in ("STYLUS", "LET GO")), asked


def test_centroid_shows_each_text_for_some_seconds_and_goes_on_by_itself() -> None:
    """Nobody presses cycle start: the hand is at the stylus."""
    found = ran("centroid", golden())
    shown = [data.get("text", "") for event, data in found.events if event in ("message", "stop")]
    assert [text.partition(" - ")[0] for text in shown] == [TOUCH, "LET GO OF THE STYLUS"]
    assert events(found).index("message") < events(found).index("finger") and not found.stops


@pytest.mark.parametrize(
    ("instead", "words"),
    [
        ("#29125 = 0", "shows its text for 0 s; allowed: up to 10 s, and not 0, which waits for cycle start"),
        ("#29125 = 60", "shows its text for 60 s"),
        ("", "#29125 is read before it has a value"),
    ],
)
def test_a_text_of_centroid_that_would_hold_the_program_up_is_refused(instead: str, words: str) -> None:
    made = golden()
    lines = [instead if line == "#29125 = 4" else line for line in program(load("centroid"), made, {}, plan_hash(made))[2]()]
    with pytest.raises(InputError, match=words):
        readback.check(lambda: iter(lines), made, settings_of(load("centroid"), {}), {}, written_in="centroid")


@pytest.mark.few(1)
@pytest.mark.parametrize("name", [n for n in sorted(EVERY) if load(n).language == "macro_b"])
@pytest.mark.parametrize("macros", ["inline", "called"])
def test_a_control_that_shows_no_comment_stops_with_the_text_before_the_slow_move(name: str, macros: str) -> None:
    post, made, given = load(name), golden(), {"show": "stop", "macros": macros}
    lines, options = list(program(post, made, given, plan_hash(made))[2]()), settings_of(post, given)
    at = lines.index(f"#3006=1({TOUCH})")
    assert TOUCH in lines[at + 1] and not readback.check(lambda: iter(lines), made, options, {}, written_in="macro_b")
    found = ran(name, made, given)
    assert found.stops == [TOUCH] and not found.why and events(found).count("contact") == len(made.touches)
    assert events(found).index("stop") < events(found).index("finger")
    early = lines.index("POPEN")
    for text in ([*lines[:early], lines[at], *lines[early:at], *lines[at + 1 :]], [*lines[: at + 1], *lines[at:]]):
        with pytest.raises(InputError):  # a person is not stopped for anywhere else
            readback.check(lambda text=text: iter(text), made, options, {}, written_in="macro_b")  # type: ignore[misc]


@pytest.mark.few(1)
@pytest.mark.parametrize(("name", "shown"), [("okuma", f"M00({TOUCH})"), ("heidenhain", f"STOP ; {TOUCH}")])
def test_okuma_and_heidenhain_stop_with_the_text_before_the_slow_move(name: str, shown: str) -> None:
    """Their comments move off the screen, or stand in the block before the one that is carried out."""
    post, made, given = load(name), golden(), {"show": "stop"}
    texts = list(program(post, made, given, plan_hash(made))[2]())
    blocks = [line.partition(" ")[2] for line in texts] if klartext(name) else texts
    at, options = blocks.index(shown), settings_of(post, given)

    def read(lines: list[str], stated: Mapping[str, Any] = options) -> None:
        numbered = [f"{i} {line}" for i, line in enumerate(lines)] if klartext(name) else lines
        readback.check(lambda: iter(numbered), made, stated, companions(post, made, given), written_in=post.language)

    read(blocks)
    found = ran(name, made, given)
    assert found.stops == [TOUCH] and not found.why and events(found).count("contact") == len(made.touches)
    assert events(found).index("stop") < events(found).index("finger")
    early = [*blocks[: at // 2], shown, *blocks[at // 2 : at], *blocks[at + 1 :]]
    twice = [*blocks[: at + 1], *blocks[at:]]
    for lines, stated in ((early, options), (twice, options), (blocks, settings_of(post, {}))):
        with pytest.raises(InputError):  # a person is not stopped for anywhere else, nor without being asked to
            read(lines, stated)


def test_the_step_before_all_else_goes_down_wherever_a_head_points_at_the_first_touch() -> None:
    """People begin at the upper end of Z. At B 100 the way off the first facet goes down a little, and Z had no room up."""
    cell = example("split")
    away = [name for name, facet in cell.artefact.facets.items() if facet.normal[2] < 0.1]
    turned = tuple(Indexation({"B": math.radians(100.0), "C": math.radians(c), "S": 0.0}, tuple(away)) for c in (0.0, 90.0))
    made = plan(replace(cell, strategy=replace(cell.strategy, indexations=turned)), "leave-out")
    z = made.machine.column("Z")
    assert made.touches[0].over[z] < made.touches[0].standoff[z]
    assert step(made) == ("Z", -STEP)
    assert not ran("brother", made).why
