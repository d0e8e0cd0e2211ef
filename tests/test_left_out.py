"""Touches that a straight stylus cannot make: in no program unless somebody asks for them, and named where the strategy is used."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.blockcell import block, machine
from support.blockcell import cell as block_cell
from support.runs import Result, readings
from support.simulated_runs import controller

from postprocessors import load, names, program, settings
from tango_cnc import kinematics
from tango_cnc.commands.design import planned
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell
from tango_cnc.files.plan import read_plan
from tango_cnc.plan import part, plan, plan_hash, split
from tango_cnc.plan.standing import standing
from tango_cnc.program import programs
from tango_cnc.readback import check
from tango_cnc.records import Cell, InputError, Obstacle, Plan

REACH = np.cos(np.radians(91.2))  # of the angle between a facet's normal and the direction to the spindle
STRATEGY = """\
name: ten touches, three of which no straight stylus makes
approach: {standoff: 10, search: 5, feed: 180}
indexations:
  - {S: 0, B: 0, C: 0, facets: [3, 5, 7]}
  - {S: 0, B: 90, C: 0, facets: [11, 13]}
  - {S: 0, B: 60, C: 0, facets: [3, 12, 20]}
  - {S: 90, B: 0, C: 0, facets: [5, 7]}
"""
QUICKEST = ("grbl",)  # to read back
MADE = [1, 2, 3, 6, 8, 9, 10]
NAMED = [
    f"touch {touch}): the facet faces {angle}° away from the spindle, a straight stylus reaches up to 91°"
    for touch, angle in (
        ("4 (facet 11, indexation 2: B 90 C 0 S 0", 135),
        ("5 (facet 13, indexation 2: B 90 C 0 S 0", 180),
        ("7 (facet 12, indexation 3: B 60 C 0 S 0", 128),
    )
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The HU40T with ten touches, of which 4 and 5 (all of one indexation) and 7 face away."""
    write_example(tmp_path / "cell", "hu40t")
    (tmp_path / "cell" / "strategy.yaml").write_text(STRATEGY, encoding="utf-8")
    world = (tmp_path / "cell" / "world.yaml").read_text(encoding="utf-8")
    (tmp_path / "cell" / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", world), encoding="utf-8")
    return tmp_path / "cell"


def test_a_choice_of_touches_has_those_alone_that_a_plan_could_have(folder: Path) -> None:
    found = standing(read_cell(folder))
    assert [indexation.facets for indexation in found.indexations] == [("3", "5", "7"), ("3", "20"), ("5", "7")]


def test_where_no_touch_can_be_made_the_choice_says_why(folder: Path) -> None:
    cell = read_cell(folder)
    away = replace(cell.strategy, indexations=cell.strategy.indexations[1:2])
    with pytest.raises(InputError, match=r"none of 2; most often .* or touch other facets"):
        standing(replace(cell, strategy=away))
    short = tuple(replace(axis, travel=(-1.0, 1.0)) if axis.name == "X" else axis for axis in cell.machine.axes)
    with pytest.raises(InputError, match=r"Even the touch that lacks least is beyond a travel: X .* -1 … 1 mm"):
        standing(replace(cell, machine=replace(cell.machine, axes=short)))


def test_touches_beyond_a_travel_are_named_and_counted_beyond_eight(folder: Path) -> None:
    cell = read_cell(folder)
    short = tuple(replace(axis, travel=(-1.0, 1.0)) if axis.name == "X" else axis for axis in cell.machine.axes)
    small = replace(cell, machine=replace(cell.machine, axes=short))
    one = replace(small, strategy=replace(small.strategy, indexations=small.strategy.indexations[3:]))
    with pytest.raises(InputError, match="touches are beyond the travel of an axis") as few:
        plan(one)
    with pytest.raises(InputError, match="touches are beyond the travel of an axis") as many:
        plan(small)
    assert "more" not in str(few.value)
    assert "… and 20 more" in str(many.value)


def numbers(made: Plan) -> list[int]:
    return [touch.number for touch in made.touches]


# What becomes of a touch


def test_a_touch_that_faces_away_is_left_out_by_name_and_the_others_keep_their_numbers(folder: Path) -> None:
    made = plan(read_cell(folder))
    assert numbers(made) == MADE and list(made.left_out.values()) == NAMED and not made.doubtful
    assert [move.touch for move in made.moves if move.kind == "probe"] == MADE


def test_nobody_turns_to_an_indexation_of_which_no_touch_is_left(folder: Path) -> None:
    turned = {round(np.degrees(move.target["B"])) for move in plan(read_cell(folder)).moves if "B" in move.target}
    assert turned == {-5, 0, 60}  # -5: from where every axis is brought to its first place


BLOCKED = Obstacle("box", low=(-140.0, -60.0, -60.0), high=(-101.0, 10.0, 20.0))  # right in front of facet 2


def obstructed(poses: list[dict[str, float]], facets: list[str], obstacle: Obstacle | None = None) -> Cell:
    """A block that is tilted by `poses`, its facets, something on it."""
    artefact = block() if obstacle is None else replace(block(), obstacles=(obstacle,))
    return block_cell(machine("wCBXfZY(S)t"), artefact, poses, facets)


@pytest.mark.parametrize(
    ("choice", "away", "hit"),
    [
        ("leave-out-facing-away", "left out", "refused"),
        ("leave-out", "left out", "left out"),
        ("refuse", "refused", "refused"),
        ("warn", "planned", "refused"),
    ],
)
def test_the_four_choices(choice: str, away: str, hit: str) -> None:
    """Facet 1 faces away at B 40; facet 2 looks up there, and at B 0 a box stands in front of it."""

    def fate(cell: Cell, touch: int) -> str:
        try:
            made = plan(cell, choice)
        except InputError as error:
            assert f"touch {touch} (" in str(error)
            return "refused"
        told = [text for text in made.left_out.values() if text.startswith(f"touch {touch} (")]
        assert (touch in numbers(made)) != bool(told)
        return "left out" if told else "planned"

    assert fate(obstructed([{"B": 40}], ["5", "1"]), 2) == away
    assert fate(obstructed([{}], ["5", "2"], BLOCKED), 2) == hit


def test_what_faces_away_is_left_out_whatever_else_is_in_its_way() -> None:
    cell = obstructed([{"B": -40}], ["5", "2"], BLOCKED)
    (told,) = plan(cell).left_out.values()
    assert "the tip would hit obstacle 1" in told and "and the facet faces 130° away" in told
    with pytest.raises(InputError, match=r"touch 2 .*the tip would hit obstacle 1"):
        plan(cell, "warn")


def test_a_strategy_of_which_nothing_is_left_is_refused(folder: Path) -> None:
    (folder / "strategy.yaml").write_text(STRATEGY.replace("[3, 5, 7]", "[3]").replace("B: 0,", "B: 90,"), encoding="utf-8")
    text = re.sub(r"facets: \[.*\]", "facets: [13]", (folder / "strategy.yaml").read_text(encoding="utf-8"))
    (folder / "strategy.yaml").write_text(text.replace("B: 60", "B: 90"), encoding="utf-8")
    for command in ("plan", "check"):
        result = Result(command, "-C", folder)
        assert result.code == 2 and "no touch is left: a straight probe can make none of 4:\n  touch 1 (facet 13" in result.err
    assert not (folder / "program").exists()


# Programs


@pytest.mark.few(0)
def test_the_command_names_every_touch_that_it_leaves_out_and_how_to_have_them(folder: Path) -> None:
    result = Result("plan", "-C", folder)
    assert result.code == 0
    assert [line for line in result.err.splitlines() if line.startswith("left out: ")] == [f"left out: {text}" for text in NAMED]
    assert (
        "WARNING: a straight stylus cannot make 3 of 10 touches of the strategy: left out" in result.err
        and "--obstructed warn" in result.err
    )
    assert "7 touches on 4 facets at 3 indexations, 3 touches of the strategy left out" in result.out
    known = read_cell(folder)
    assert list(read_plan(folder / "program" / "plan.csv", known.machine).touch) == MADE
    told = json.loads(Result("plan", "-C", folder, "--json", "-").out)
    assert (told["touches"], told["left_out"], told["doubtful"]) == (7, NAMED, [])


def test_whoever_asks_for_them_gets_them_with_a_warning(folder: Path) -> None:
    result = Result("plan", "-C", folder, "--obstructed", "warn")
    assert result.code == 0 and "left out" not in result.err + result.out
    assert "WARNING: 3 of 10 touches are on facets that face away" in result.err and NAMED[0] in result.err
    text = (folder / "program" / "O7700.nc").read_text(encoding="ascii")
    assert "(10 TOUCHES OF" in text and "UNVERIFIED 3 TOUCHES ARE ON FACETS THAT FACE AWAY" in text and "LEFT OUT" not in text


@pytest.mark.few(5)
@pytest.mark.parametrize("name", names())
def test_the_head_of_a_program_says_how_many_touches_are_left_out(name: str, folder: Path) -> None:
    made, post = plan(read_cell(folder)), load(name)
    lines = list(program(post, made, {}, plan_hash(made))[2]())
    assert [line for line in lines[:12] if "3 TOUCHES OF THE STRATEGY LEFT OUT" in line]
    whole = replace(made, left_out={})
    assert not [line for line in program(post, whole, {}, plan_hash(whole))[2]() if "LEFT OUT" in line]


def test_okuma_prints_touch_numbers_in_as_many_places_as_the_last_one_needs(folder: Path) -> None:
    """Seven touches, the last of which is number 10."""
    made, post = plan(read_cell(folder)), load("okuma")
    lines = list(program(post, made, {}, plan_hash(made))[2]())
    assert "PUT PT,6" in lines
    for places in (1, 2):
        cut = [line.replace("PUT PT,6", f"PUT PT,{places}") for line in lines]
        if places == 2:
            assert not check(lambda cut=cut: iter(cut), made, settings(post, {}))
        else:
            with pytest.raises(InputError, match="fewer places than they need"):
                check(lambda cut=cut: iter(cut), made, settings(post, {}))


def test_parts_keep_the_numbers_too(folder: Path) -> None:
    made = plan(read_cell(folder))
    assert [numbers(some) for some in split(made, 3)] == [[1, 2, 3], [6, 8], [9, 10]]
    with pytest.raises(InputError, match="part of a plan: found touch 7"):
        part(made, [6, 7])


@pytest.fixture(scope="module")
def contract(shared: Path) -> Plan:
    return plan(read_cell(shared / "contract" / "hu40t"))


def test_no_touch_of_the_public_cell_is_beyond_what_a_straight_stylus_reaches(contract: Plan) -> None:
    chain = kinematics.chain(contract.machine)
    up = kinematics.spindle_axis(chain, np.array([touch.contact for touch in contract.touches]))
    normal = np.array([contract.artefact.facets[touch.facet].normal for touch in contract.touches])
    assert np.einsum("ij,ij->i", up, normal).min() > REACH
    assert (len(contract.touches), len(contract.left_out)) == (358, 35)


@pytest.mark.few(0)
@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in QUICKEST else pytest.mark.long) for n in names()])
def test_the_program_of_the_public_cell_is_read_back_in_every_dialect_whole_and_in_parts(name: str, contract: Plan) -> None:
    post = load(name)
    for most in (None, 100):
        written = programs(post, contract, {}, most)
        assert not [doubt for program in written for doubt in program.unread]
        assert sum(len(program.plan.touches) for program in written) == 358


@pytest.mark.few(0)
def test_what_measures_the_probe_touches_facets_that_can_be_touched(folder: Path) -> None:
    """One facet is chosen for every direction that the strategy offers; in Z it offers only one that faces away."""
    result = Result("plan", "-C", folder, "--capability", "drift", "--post", "linuxcnc")
    assert result.code == 0 and "left out" not in result.err
    touched = read_plan(folder / "capability" / "drift" / "plan.csv", read_cell(folder).machine).facet
    assert set(touched) <= {"3", "5", "7", "20"}
    (folder / "strategy.yaml").write_text(re.sub(r"facets: \[.*\]", "facets: [13]", STRATEGY).replace("B: 0,", "B: 90,"))
    result = Result("plan", "-C", folder, "--capability", "drift", "--post", "linuxcnc")
    assert result.code == 2 and "no touch is left: a straight probe can make none of 4" in result.err


# Runs


def as_simulated(folder: Path) -> bool:
    """The rows of readings.csv are those of `tango simulate`, which makes every touch of the strategy, with the same numbers."""
    assert Result("simulate", "-C", folder, "-o", folder / "simulated.csv").code == 0
    got, whole = readings(folder), readings(folder, "simulated.csv")
    assert list(whole.touch) == list(range(1, 11))
    rows = got.touch - 1
    assert [whole.facet[row] for row in rows] == list(got.facet)
    # a tenth of a micrometre printed, and the least increment of 1 µm in which the control was sent where to go sideways
    return bool(np.abs(got.position - whole.position[rows])[:, :3].max() < 1.5e-3)


@pytest.mark.long
@pytest.mark.parametrize("protocol", ["dnc", "modbus"])
def test_a_run_makes_what_is_left_and_its_readings_have_the_numbers_of_the_strategy(protocol: str, folder: Path) -> None:
    with controller(folder, "--tcp", "127.0.0.1:0", "--protocol", protocol) as url:
        result = Result("run", "-C", folder, "--port", url, "--timeout", "10", "--json", folder / "run.json")
    assert result.code == 0, result.err
    assert "WARNING: a straight stylus cannot make 3 of 10 touches of the strategy: left out" in result.err
    assert list(readings(folder).touch) == MADE and as_simulated(folder)
    told = json.loads((folder / "readings.json").read_text(encoding="utf-8"))
    assert (told["touches"], told["missing"], told["left_out"]) == (7, [], NAMED)
    last = json.loads((folder / "run.json").read_text(encoding="utf-8").splitlines()[-1])
    assert last["event"] == "end" and last["left_out"] == NAMED
    # seven touches are too few for an estimate, so nothing vouches for them
    compared = Result("compare", "-C", folder, "--with", folder / "simulated.csv", "--despite", "--json", "-")
    assert compared.code == 0 and list(json.loads(compared.out)["differences_um"]) == [str(number) for number in MADE]


@pytest.mark.long
def test_a_run_in_parts_that_stopped_goes_on_with_what_is_left(folder: Path) -> None:
    with controller(folder, "--tcp", "127.0.0.1:0", "--fault", "stop-after=4", once=False) as url:
        result = Result("run", "-C", folder, "--port", url, "--timeout", "1", "--split", "3")
    assert result.code == 3 and f"'tango run -C {folder} --split 3 --port" in result.err and "--resume'" in result.err
    other = Result("run", "-C", folder, "--port", "socket://127.0.0.1:1", "--resume", "--obstructed", "warn")
    assert other.code == 2 and "restore the files of the cell and state the same --obstructed" in other.err
    with controller(folder, "--tcp", "127.0.0.1:0", once=False) as url:
        result = Result("run", "-C", folder, "--port", url, "--timeout", "10", "--split", "3", "--resume")
    assert result.code == 0, result.err
    assert sorted(readings(folder).touch.tolist()) == MADE and as_simulated(folder)


def test_a_program_with_other_touches_than_the_run_wants_is_not_sent(folder: Path) -> None:
    assert Result("plan", "-C", folder, "--obstructed", "warn").code == 0
    sent = ["run", "-C", folder, "--program", folder / "program" / "O7700.nc", "--port", "socket://127.0.0.1:1"]
    result = Result(*sent)
    assert result.code == 2 and "or --obstructed is another" in result.err
    assert Result(*sent, "--obstructed", "warn").code == 3  # nobody is there


@pytest.mark.long
def test_the_public_cell_is_measured_by_what_is_left_and_gives_its_parameters(shared: Path, tmp_path: Path) -> None:
    """All 17 machine parameters and 3 stylus offsets of the machine that made the public readings, out of 358 touches."""
    folder = tmp_path / "cell"
    shutil.copytree(shared / "contract" / "hu40t", folder)
    truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    stylus = {name: value for name, value in truth.items() if re.fullmatch("E[XYZ]t", name)}
    errors = {name: value for name, value in truth.items() if name not in stylus}
    world = {"errors": errors, "stylus": stylus, "noise": 0.0006, "seed": 7}
    (folder / "world.yaml").write_text(yaml.safe_dump(world), encoding="utf-8")
    with (folder / "tango.yaml").open("a", encoding="utf-8") as profile:
        profile.write("controller: {post: fanuc, probe_state: none}\n")
    with controller(folder, "--tcp", "127.0.0.1:0", once=False) as url:
        result = Result("run", "-C", folder, "--port", url, "--timeout", "30")
    assert result.code == 0, result.err
    told = json.loads(Result("estimate", "-C", folder, "--json", "-").out)
    checked = json.loads(Result("check", "-C", folder, "--json", "-").out)
    assert told["touches"] == checked["planned_touches"] == 358 and not told["outliers"]
    assert told["condition_number"] == pytest.approx(checked["condition_number"], rel=0.01)
    for name, parameter in told["parameters"].items():
        assert abs(parameter["value"] - truth[name]) < 4 * parameter["std"], name
    for name, value in told["stylus"].items():
        assert abs(value - truth[name]) < 4 * told["stylus_std"][name], name


# What has no iron


def test_the_simulated_machine_makes_every_touch_by_the_planned_way(folder: Path) -> None:
    told = json.loads(Result("simulate", "-C", folder, "-o", folder / "simulated.csv", "--json", "-").out)
    assert (told["touches"], told["ok"], told["planned"]) == (10, 10, True)


def test_the_design_knows_when_each_touch_that_is_left_will_be_made(folder: Path) -> None:
    touches = planned(read_cell(folder))
    assert len(touches) == 7 and (np.diff(touches.time) > 1.0).all()
