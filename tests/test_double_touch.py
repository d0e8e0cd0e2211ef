"""Touching twice: a facet is found quickly, then measured slowly from nearby. Same readings, in less time, and no less safe."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import gates
from support.controls import GOLDEN
from support.dialects import DRIVEN, EVERY, EXAMPLE, OFFSETS, PRINTED, measured, s3
from support.linkfaults import scene, stopped_by_the_user
from support.runs import STRATEGY, Result, readings
from support.simulated_runs import agree, controller
from support.stopped import ran

from postprocessors import Job, Leg, Post, companions, load, program, settings
from postprocessors._base import _steps
from sim_controller.motion import Motion
from sim_controller.probing import rig
from sim_controller.session import language
from sim_controller.simulate import simulate
from tango_cnc.duration import duration, saved
from tango_cnc.files import read_cell, read_world
from tango_cnc.files.write import strategy_text
from tango_cnc.link.client import Failed
from tango_cnc.plan import last_motion, last_moves, plan, plan_hash
from tango_cnc.readback import check
from tango_cnc.records import Cell, Find, InputError, Plan, World

FIND = Find(feed=800.0, retreat=6.0)  # of touches with standoff 10, search 5, feed 180
QUICK = ("fanuc",)  # the others are many seconds together
quick_and_long = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.long) for name in sorted(EVERY)]
)


def twice(cell: Cell, find: Find = FIND) -> Cell:
    """cell → the same with every facet touched twice."""
    return replace(cell, strategy=replace(cell.strategy, approach=replace(cell.strategy.approach, find=find)))


@pytest.fixture(scope="module")
def cell() -> Cell:
    """Thirty-one touches of the HU40T at six indexations, every facet at two of them at least."""
    whole = read_cell(EXAMPLE)
    some = [i for i in whole.strategy.indexations if len(i.facets) > 1][::6]
    thin = tuple(replace(i, facets=i.facets[::3]) for i in some[:6])
    return replace(whole, strategy=replace(whole.strategy, indexations=thin))


@pytest.fixture(scope="module")
def golden() -> Plan:
    return plan(twice(read_cell(GOLDEN)))


@pytest.fixture(scope="module")
def world() -> World:
    return replace(read_world(EXAMPLE / "world.yaml"), noise=0.0)


@pytest.fixture(scope="module")
def rounded(cell: Cell, world: World) -> dict[str, float]:
    """→ by how much each parameter moves when every coordinate is rounded somehow."""
    true, rng = simulate(cell.machine, cell.artefact, cell.strategy, world), np.random.default_rng(1)
    linear = np.array([name in "XYZ" for name in true.axes])
    exact, moved = s3(cell, true), dict[str, float]()
    for _ in range(8):
        off = rng.uniform(-0.5, 0.5, true.position.shape) * np.where(linear, PRINTED, np.radians(PRINTED))
        other = s3(cell, replace(true, position=true.position + off))
        moved = {name: max(moved.get(name, 0.0), abs(other[name] - value)) for name, value in exact.items()}
    return moved


# The same readings


def test_every_touch_is_found_backed_off_from_and_measured_from_nearby(golden: Plan) -> None:
    first = golden.touches[0]
    kinds = [move.kind for move in golden.moves if move.touch == first.number]
    assert kinds[-7:] == ["approach", "find", "off", "near", "probe", "back", "retract"]
    assert [kind for kind in kinds if kind in ("find", "probe")] == ["find", "probe"]
    near, contact = (np.array(place) for place in (golden.near(first), first.contact))
    assert np.linalg.norm(near - contact) == pytest.approx(FIND.retreat)
    assert np.cross((near - contact)[:3], (np.array(first.standoff) - contact)[:3]) == pytest.approx(0, abs=1e-9)


@pytest.mark.long
@quick_and_long
def test_the_readings_are_those_of_touching_once(name: str, cell: Cell, world: World, rounded: dict[str, float]) -> None:
    """Every coordinate to the last digit or two that the control knows of, and so the parameters."""
    once, double = (measured(plan(of), name, world) for of in (cell, twice(cell)))
    assert set(double.status) == {"ok"} and double.facet == once.facet
    off, digit = float(np.abs(double.position - once.position).max()), EVERY[name].resolution
    assert off <= 2.5 * digit, (
        f"postprocessors/{name}.py: {off:.1e} mm apart, its digit is {digit} mm (printed, support/dialects.py)"
    )
    found, exact = s3(cell, double), s3(cell, once)
    assert found.keys() == exact.keys()
    for parameter, value in exact.items():  # both are rounded
        assert abs(found[parameter] - value) <= 4 * rounded[parameter] * EVERY[name].resolution / PRINTED, parameter


def test_each_axis_moves_last_as_it_does_when_touching_once_but_not_as_far(cell: Cell, world: World) -> None:
    once, double = plan(cell), plan(twice(cell))
    assert (last_motion(double) == last_motion(once)).all()
    shorter = np.abs(last_moves(once)) - np.abs(last_moves(double))
    assert shorter.min() > -1e-9 and (shorter.max(axis=1) > 1.0).all()
    one, two = (
        simulate(of.machine, of.artefact, of.strategy, world, moved=last_moves(made))
        for of, made in ((cell, once), (twice(cell), double))
    )
    planned = last_motion(double)
    assert (one.position == two.position).all() and (two.direction == planned)[planned != 0].all()
    assert (np.diff(one.time) != np.diff(two.time)).all()


def test_the_hash_of_the_plan_knows_of_it(golden: Plan) -> None:
    once = plan(read_cell(GOLDEN))
    hashes = {plan_hash(made) for made in (once, golden, plan(twice(read_cell(GOLDEN), Find(800.0, 7.0))))}
    assert len(hashes) == 3


# What goes wrong


@pytest.mark.few(0)
@quick_and_long
def test_an_early_facet_and_a_miss_are_on_record_as_such(name: str) -> None:
    far = plan(twice(read_cell(GOLDEN), Find(800.0, 8.0)))
    assert ran(far, name, World(facets={"3": 7.0, "4": -8.0}))[0] == ["ok"] * 4 + ["early", "miss"]


def test_how_many_misses_in_a_row_stop_it_is_counted_in_touches_not_in_moves(golden: Plan) -> None:
    """Each touch is two moves here: twenty touches without contact are allowed as with one move, one more is not."""
    list(program(load("fanuc"), golden, {"misses": 20}, plan_hash(golden))[2]())
    with pytest.raises(InputError, match=r"controller\.misses: found 21; allowed: 1 … 20"):
        list(program(load("fanuc"), golden, {"misses": 21}, plan_hash(golden))[2]())


@pytest.mark.few(0)
@quick_and_long
def test_a_facet_that_is_nearer_than_the_measuring_move_begins_stops_with_a_text(name: str, golden: Plan) -> None:
    touched, text, _ = ran(golden, name, World(facets={"3": 7.0}))
    assert touched == ["ok"] * 4 and len(text) > 10


@quick_and_long
def test_a_probe_that_never_answers_ends_it_at_the_third_touch(name: str, golden: Plan) -> None:
    away = {key: replace(facet, point=(0.0, 0.0, -500.0), ball=None) for key, facet in golden.artefact.facets.items()}
    nothing = replace(golden, artefact=replace(golden.artefact, facets=away, balls={}))
    touched, text, _ = ran(nothing, name, World())
    assert touched == ["miss"] * len(touched) and len(touched) in (2, 3) and len(text) > 10


# What is read back


def lines_of(post: Post, made: Plan, **options: str) -> list[str]:
    return list(program(post, made, options, plan_hash(made))[2]())


def refused(post: Post, made: Plan) -> str:
    """post with something wrong in it → what the check of its program says; empty when it lets it pass."""
    try:
        assert not check(lambda: iter(lines_of(post, made)), made, settings(post, {}), companions(post, made, {})), (
            "nobody has read it"
        )
    except InputError as error:
        return str(error)
    return ""


def at_feed(job: Job, feed: float) -> Job:
    approach = replace(job.plan.strategy.approach, feed=feed, find=Find(feed, FIND.retreat))
    return replace(job, plan=replace(job.plan, strategy=replace(job.plan.strategy, approach=approach)))


def without(post: Post, step: str, kind: str) -> Post:
    """post → the same that forgets a step of moves of this kind."""
    made = getattr(post, step)
    return replace(post, **{step: lambda job, leg: () if leg.kind == kind else made(job, leg)})


def hasty(post: Post) -> Post:
    """post → one that measures as quickly as it finds."""
    return replace(
        post, probe=lambda job, leg: post.probe(at_feed(job, FIND.feed), leg), end=lambda job: post.end(at_feed(job, FIND.feed))
    )


def slow(post: Post) -> Post:
    """post → one that finds as slowly as it measures."""
    return replace(post, probe=lambda job, leg: post.probe(at_feed(job, 180.0), leg), end=lambda job: post.end(at_feed(job, 180.0)))


def talkative(post: Post) -> Post:
    """post → one that records the contact that was only to find."""

    def back(job: Job, leg: Leg) -> Iterator[str]:
        yield from post.back(job, leg)
        yield from post.record(job, leg) if leg.kind == "off" else ()

    return replace(post, back=back, record=lambda job, leg: ())


WRONG = {
    "measuring": lambda post: without(post, "probe", "probe"),
    "finding": lambda post: without(post, "probe", "find"),
    "off": lambda post: without(post, "back", "off"),
    "near": lambda post: without(post, "retract", "near"),
    "hasty": hasty,
    "slow": slow,
    "talkative": talkative,
}


@pytest.mark.few(0)
@quick_and_long
def test_what_the_posts_write_passes_and_what_is_missing_is_refused(name: str, golden: Plan) -> None:
    post = load(name)
    assert not refused(post, golden)
    for what, wrong in WRONG.items():
        if (name, what) == ("grbl", "talkative"):
            continue  # its records are remarks: the driver makes them
        assert refused(wrong(post), golden), what


def test_programs_of_single_touches_and_of_double_ones_are_not_taken_for_each_other(golden: Plan) -> None:
    once, post = plan(read_cell(GOLDEN)), load("fanuc")
    for written, meant in ((once, golden), (golden, once)):
        with pytest.raises(InputError, match=r"the plan (has|goes)|the feed is"):
            check(lambda written=written: iter(lines_of(post, written)), meant, settings(post, {}))


def test_a_post_that_does_not_know_of_it_measures_twice_and_records_once(golden: Plan) -> None:
    """Finding is its own measuring move at another feed, backing off its own way back."""
    fanuc = load("fanuc")
    own = replace(
        fanuc,
        probe=lambda job, leg: [f"PROBE F{job.plan.strategy.approach.feed:g}"],
        back=lambda job, leg: ["BACK"],
        retract=lambda job, leg: ["GUARDED"],
        record=lambda job, leg: ["RECORD"],
    )
    said = [line for line in _steps(own, Job(golden, settings(own, {}), "", "", ())) if re.match("PROBE|BACK|GUARDED|RECORD", line)]
    assert " ".join(said).count("PROBE F800 BACK GUARDED PROBE F180 RECORD BACK GUARDED") == len(golden.touches)


# Time


@pytest.mark.long
def test_the_predicted_time_is_that_of_the_simulated_control(cell: Cell, world: World) -> None:
    """Of both, and of what is saved. Not predicted: the check after every move that the axes are in position, and the gate."""
    spoken, spent, told = language("macro_b"), [], []
    for made in (plan(cell), plan(twice(cell))):
        motion = Motion(rig(made.machine, made.artefact, world))
        profile = replace(spoken.default_profile(made.machine), g54=OFFSETS)
        spoken.Control(motion, profile, lambda data: None, lambda event, **data: None, ()).run(
            lines_of(load("fanuc"), made, gate="none")[1:-1], False
        )
        spent.append(motion.time)
        told.append(sum(duration(made, 3000.0).values()))
    assert told == pytest.approx(spent, rel=0.04)
    gain = saved(plan(twice(cell)), 3000.0)
    assert gain == pytest.approx(told[0] - told[1]) and gain > 0
    assert spent[0] > spent[1]


def test_one_touch_counted_by_hand(golden: Plan) -> None:
    """10 mm at 800 mm/min, off 1.5 mm, back 8.5 mm and down 4 mm at 50 mm/s and 2 m/s², 6 mm at 180 mm/min."""
    parts, count = duration(golden, 3000.0), len(golden.touches)
    assert parts["probe"] == pytest.approx(count * 2.0)
    assert parts["find and back"] == pytest.approx(count * (0.75 + (0.03 + 0.025) + (0.17 + 0.025) + (0.08 + 0.025)), rel=1e-3)
    assert "find and back" not in duration(plan(read_cell(GOLDEN)))


# Files and commands


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copytree(EXAMPLE, tmp_path / "cell")
    file, wrong = tmp_path / "cell" / "strategy.yaml", tmp_path / "cell" / "world.yaml"
    file.write_text(STRATEGY.replace("feed: 180}", "feed: 180, find: {feed: 800, retreat: 6}}"))
    wrong.write_text(re.sub(r"noise: .*", "noise: 0.0", wrong.read_text()))
    return tmp_path / "cell"


def test_it_is_read_and_written(folder: Path) -> None:
    strategy = read_cell(folder).strategy
    assert strategy.approach.find == FIND
    (folder / "strategy.yaml").write_text(strategy_text(strategy))
    assert read_cell(folder).strategy == strategy


@pytest.mark.parametrize(
    ("find", "said"),
    [
        ("{feed: 100, retreat: 6}", "find.feed: found '100'; allowed: at least 180, the measuring feed"),
        (
            "{feed: 800, retreat: 5.2}",
            "find.retreat: found '5.2'; allowed: at least 5.5: .* 0.5 mm before the search zone; raise retreat",
        ),
        ("{feed: 800, retreat: 11}", "find.retreat: found '11'; allowed: at most 10, the standoff"),
        ("{feed: 800, retreat: .nan}", "find.retreat: found"),
        ("{feed: 800}", "retreat"),
        ("{feed: 800, retreat: 6, retract: 1}", "retract"),
        ("800", "find"),
    ],
)
def test_what_it_cannot_be_is_refused(folder: Path, find: str, said: str) -> None:
    file = folder / "strategy.yaml"
    file.write_text(file.read_text().replace("{feed: 800, retreat: 6}", find))
    with pytest.raises(InputError, match=said):
        read_cell(folder)


@pytest.mark.few(0)
def test_check_tells_the_time_by_part_and_what_is_saved(folder: Path) -> None:
    told = Result("check", "-C", folder).out
    assert re.search(r"find and back \d+ s, probe \d+ s", told), told
    assert re.search(r"touching twice saves \d+ s against touching once", told)
    file = folder / "strategy.yaml"
    file.write_text(file.read_text().replace("feed: 800, retreat: 6", "feed: 180, retreat: 10"))
    assert re.search(r"touching twice costs \d+ s against touching once", Result("check", "-C", folder).out)
    listed = Result("plan", "-C", folder, "--dry-run").out
    assert listed.count("  find ") == listed.count("  probe ") == 7


SESSIONS: dict[str, Any] = {
    "grbl": (("--protocol", "grbl"), "?orient=m19"),
    "grbl, targets not confirmed": (("--protocol", "grbl"), "?orient=m19&targets=plain"),
    "modbus": (("--protocol", "modbus"), ""),
    "fanuc": ((), ""),
}


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.long) for n in SESSIONS])
def test_a_whole_run(folder: Path, name: str) -> None:
    options, query = SESSIONS[name]
    with controller(folder, *options, "--tcp", "127.0.0.1:0") as url:
        result = Result("run", "-C", folder, "--port", f"{url}{query}", "--timeout", "20")
    assert result.code == 0, result.err
    assert agree(folder) and len(readings(folder)) == 7


@pytest.mark.few(0)
def test_the_driver_of_grbl_takes_no_reading_from_finding(golden: Plan) -> None:
    assert "grbl" in DRIVEN
    assert ran(golden, "grbl", World(facets={"4": -8.0}))[0] == ["ok"] * 5 + ["miss"]


@pytest.mark.few(1)
@pytest.mark.parametrize("protocol", ["modbus", "grbl"])
@pytest.mark.parametrize("kind", ["find", "near", "probe"])
def test_ctrl_c_within_a_touch_draws_the_probe_clear(protocol: str, kind: str) -> None:
    """By the stand-off, the way that is known to be free, wherever between both contacts it comes."""
    cell, _, truth = scene(turning=False)
    made = plan(twice(cell))

    def within(client: Any, events: list[Any]) -> bool:
        moves = [(move.touch, move.kind) for move in client._moves]
        return client.sent[0] > moves.index((3, kind)) + (protocol == "modbus")  # whose first command is none of the plan's

    events, went = stopped_by_the_user(protocol, made, Motion(truth), {}, within)
    assert events[-1] == Failed("stopped by the user; the probe has been drawn clear")
    standoff, over = (np.array(place) for place in (made.touches[2].standoff, made.touches[2].over))
    assert np.abs(np.array(went[-1]) - over)[:3].max() < 0.01
    assert min(np.abs(np.array(place) - standoff)[:3].max() for place in went[-40:]) < 0.01


@pytest.mark.few(0)
@pytest.mark.parametrize(("retreat", "near"), [(9.75, 0), (9.5, 1)])
def test_a_way_back_to_the_facet_that_some_controls_find_too_short_is_not_made(retreat: float, near: int) -> None:
    """Mach3 takes no G31 of less than 0.254 mm: the second of two touches begins at the stand-off then, and is as slow."""
    made = plan(twice(read_cell(GOLDEN), Find(feed=800.0, retreat=retreat)))
    assert sum(move.kind == "near" for move in made.moves) == near * len(made.touches)
    post = load("mach3")
    check(program(post, made, {}, plan_hash(made))[2], made, settings(post, {}), companions(post, made, {}))
    assert not gates.ran("mach3", made).why
