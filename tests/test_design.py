"""A plan is chosen for a goal and a time: the arithmetic against plain recomputation, the bound against every plan there is."""

from __future__ import annotations

import itertools
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize
from scipy.spatial import ConvexHull
from support.designs import quickly

from tango_cnc.cli import guarded, tango
from tango_cnc.design import goals, order, region
from tango_cnc.design.candidates import candidates
from tango_cnc.design.criterion import Criterion, State, swaps, value
from tango_cnc.design.exchange import Draft
from tango_cnc.design.here import bound_here
from tango_cnc.design.in_a_row import without_each
from tango_cnc.design.relaxed import Costs, Relaxed, efficiency, relax
from tango_cnc.design.senses import ordered, senses_of
from tango_cnc.design.spare import state_of, with_each
from tango_cnc.design.timed import rows_of
from tango_cnc.design.whole import whole
from tango_cnc.design.worst import sharpened
from tango_cnc.files import read_artefact, read_cell
from tango_cnc.plan import plan
from tango_cnc.records import Indexation, InputError

RNG = np.random.default_rng(5)
P = 9
TOUCHES = RNG.normal(size=(40, P))
HELD = 0.05 * np.eye(P)
SPREAD = RNG.normal(size=(P, P))
CRITERIA = [Criterion("trace", SPREAD @ SPREAD.T), Criterion("determinant")]


def information(rows: np.ndarray) -> np.ndarray:
    return HELD + rows.T @ rows


@pytest.mark.parametrize("criterion", CRITERIA, ids=lambda c: c.name)
def test_what_a_touch_is_worth_is_what_the_criterion_changes_by(criterion: Criterion) -> None:
    inside, outside = TOUCHES[:25], TOUCHES[25:]
    now, state = value(criterion, information(inside)), State.of(criterion, information(inside))
    for i in range(len(inside)):
        without = value(criterion, information(np.delete(inside, i, axis=0))) - now
        assert state.loss(*state.seen(inside))[i] == pytest.approx(without)
    for i in range(len(outside)):
        more = now - value(criterion, information(np.vstack([inside, outside[i]])))
        assert state.benefit(*state.seen(outside))[i] == pytest.approx(more)
    assert state.block_loss(inside[3:8]) == pytest.approx(
        value(criterion, information(np.delete(inside, range(3, 8), axis=0))) - now
    )
    assert state.block_benefit(outside[:4]) == pytest.approx(now - value(criterion, information(np.vstack([inside, outside[:4]]))))
    exchanged = swaps(state, inside, outside)
    for i, k in [(0, 0), (7, 3), (24, 14)]:
        other = np.vstack([np.delete(inside, i, axis=0), outside[k]])
        assert exchanged[i, k] == pytest.approx(now - value(criterion, information(other)))


@pytest.mark.parametrize("criterion", CRITERIA, ids=lambda c: c.name)
def test_a_hundred_updates_leave_what_a_new_beginning_gives(criterion: Criterion) -> None:
    chosen = np.arange(40) < 20
    state = State.of(criterion, information(TOUCHES[chosen]))
    for row in np.random.default_rng(1).integers(0, 40, 100):
        state.change(TOUCHES[row], -1 if chosen[row] else 1)
        chosen[row] = not chosen[row]
    fresh = State.of(criterion, information(TOUCHES[chosen]))
    assert np.allclose(state.covariance, fresh.covariance, rtol=1e-8, atol=1e-10)
    assert np.allclose(state.gain, fresh.gain, rtol=1e-7, atol=1e-9)


def test_the_relaxed_design_of_a_parabola_is_that_of_the_textbooks() -> None:
    # Quadratic regression on [-1, 1]: a third each at both ends and in the middle is D-optimal (Kiefer and Wolfowitz 1959).
    x = np.linspace(-1, 1, 41)
    rows = np.vander(x, 3, increasing=True)
    found = relax(
        rows, [np.array([i]) for i in range(41)], 1e-12 * np.eye(3), Costs(np.ones(41), np.zeros(41)), 3.0, Criterion("D")
    )
    weight = found.weights / found.weights.sum()
    assert [weight[:3].sum(), weight[15:26].sum(), weight[38:].sum()] == pytest.approx([1 / 3] * 3, abs=0.02)
    best = value(Criterion("D"), rows[[0, 20, 40]].T @ rows[[0, 20, 40]])
    assert found.bound <= best and efficiency(Criterion("D"), best, found.bound, 3) > 0.99


@pytest.mark.few(1)
@pytest.mark.parametrize("criterion", [*CRITERIA, Criterion("worst", None, SPREAD[:4])], ids=lambda c: c.name)
def test_no_plan_there_is_gets_below_the_bound_and_the_chosen_one_is_near_the_best(criterion: Criterion) -> None:
    # Four indexations of three touches: all plans of the same time are looked at.
    rows, pose = TOUCHES[:12], np.repeat(np.arange(4), 3)
    of_pose = [np.flatnonzero(pose == j) for j in range(4)]
    costs, seconds = Costs(np.linspace(1.0, 1.6, 12), np.array([2.0, 2.5, 3.0, 1.5])), 17.0
    best = np.inf
    for mask in itertools.product([False, True], repeat=12):
        chosen = np.array(mask)
        time = costs.touch[chosen].sum() + costs.visit[np.unique(pose[chosen])].sum()
        if time <= seconds:
            best = min(best, value(criterion, information(rows[chosen])))
    relaxed = relax(rows, of_pose, HELD, costs, seconds, criterion)
    chosen = whole(rows, pose, of_pose, HELD, costs, seconds, relaxed, 120)
    assert costs.touch[chosen].sum() + costs.visit[np.unique(pose[chosen])].sum() <= seconds
    assert relaxed.bound <= best + 1e-9
    assert efficiency(criterion, value(criterion, information(rows[chosen])), best, P) > 0.9


@pytest.mark.few(4)
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("criterion", [*CRITERIA, Criterion("worst", None, SPREAD[:4])], ids=lambda c: c.name)
def test_no_choice_of_touches_at_the_visits_of_a_plan_gets_below_its_bound(criterion: Criterion, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, touch, seconds = rng.normal(size=(10, P)), rng.uniform(1.0, 1.6, 10), float(rng.uniform(5.0, 10.0))
    best = np.inf
    for mask in itertools.product([False, True], repeat=10):
        if touch[chosen := np.array(mask)].sum() <= seconds:
            best = min(best, value(criterion, information(rows[chosen])))
    bound = bound_here(rows, HELD, touch, seconds, criterion)
    assert bound <= best + 1e-9
    if criterion.worst is None:  # what a solver that knows nothing of gradients makes of touches by the fraction
        room = LinearConstraint(touch, 0.0, seconds)
        solved = minimize(
            lambda w: value(criterion, HELD + (rows.T * w) @ rows),
            np.full(10, seconds / touch.sum()),
            method="SLSQP",
            bounds=[(0.0, 1.0)] * 10,
            constraints=[room],
        )
        assert bound == pytest.approx(solved.fun, rel=0.01, abs=0.05)
    # A facet is touched once at a visit. With time for most of them, the bound is above that of touches without such a limit.
    most = 0.8 * float(touch.sum())
    free = relax(rows, [np.array([i]) for i in range(10)], HELD, Costs(touch, np.zeros(10)), most, criterion)
    if not criterion.determinant:  # which touches alike seldom and so seldom meets the limit
        assert bound_here(rows, HELD, touch, most, criterion) > free.bound
    # Where there is time for all touches, they are the best choice.
    whole_time = bound_here(rows, HELD, touch, float(touch.sum()) + 1.0, criterion)
    assert whole_time == pytest.approx(value(criterion, information(rows)), rel=0.01, abs=0.05)


@pytest.mark.parametrize("criterion", [*CRITERIA, Criterion("worst", None, SPREAD[:4])], ids=lambda c: c.name)
def test_what_one_more_touch_leaves_and_one_less_is_what_a_plain_recomputation_has(criterion: Criterion) -> None:
    now = information(TOUCHES[:20])
    state, phi = state_of(criterion, now), value(criterion, now)
    plain = [value(criterion, now + np.outer(row, row)) for row in TOUCHES[20:]]
    assert with_each(criterion, state, phi, TOUCHES[20:]) == pytest.approx(plain)
    plain = [value(criterion, now - np.outer(row, row)) for row in TOUCHES[:20]]
    assert without_each(criterion, state, phi, TOUCHES[:20]) == pytest.approx(plain)


def test_after_exchanges_by_the_worst_no_swap_makes_the_worst_better() -> None:
    many, pose = Criterion("worst", None, SPREAD[:4]), np.zeros(40, dtype=int)
    costs, of_pose = Costs(np.ones(40), np.ones(1)), [np.arange(40)]
    relaxed = Relaxed(np.ones(40), np.ones(1), 0.0, many.with_weights(np.full(4, 0.25)))
    draft = Draft(TOUCHES, pose, of_pose, HELD, costs, relaxed, np.arange(40) < 14)
    before = value(many, draft.information)
    sharpened(draft, 15.0, many)
    after = value(many, draft.information)
    assert after < before and draft.chosen.sum() == 14
    inside, outside = np.flatnonzero(draft.chosen), np.flatnonzero(~draft.chosen)
    for i, k in itertools.product(inside, outside):
        other = np.append(inside[inside != i], k)
        assert value(many, information(TOUCHES[other])) > after * (1 - 1e-3)


@pytest.mark.long
def test_rows_of_an_order_are_those_of_its_plan_where_backlash_of_rotary_axes_is_concerned() -> None:
    cell = read_cell(Path(__file__).parents[1] / "examples" / "trunnion")
    choice = candidates(cell, ("S3",), cell.strategy.approach)
    visits = [40, 90, 12]
    picked = [choice.of_pose[j][:3] for j in visits]
    stations = [choice.cell.strategy.indexations[j].position for j in visits]
    own = tuple(Indexation(p, tuple(choice.facet[i] for i in some)) for p, some in zip(stations, picked, strict=True))
    made = plan(replace(cell, strategy=replace(cell.strategy, indexations=own)), "leave-out")
    columns = [j for j, name in enumerate(choice.selection.model.names) if name in ("EAAb", "ECCb")]
    came = ordered(choice, senses_of(choice), visits).rows[np.concatenate(picked)][:, columns]
    assert len(columns) == 2 and not np.allclose(came, choice.rows[np.concatenate(picked)][:, columns])
    assert np.allclose(came, rows_of(choice, made)[:, columns], rtol=1e-6, atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(("kind", "printed"), [("D", 3.675919), ("I", 8.096772)])
def test_exact_designs_are_as_good_as_those_that_algdesign_prints(kind: str, printed: float) -> None:
    # Vignette of R's AlgDesign: quadratic model of three factors at five levels, 15 trials.
    x = np.array(list(itertools.product([-2.0, -1, 0, 1, 2], repeat=3)))
    pairs = [x[:, i] * x[:, k] for i, k in itertools.combinations(range(3), 2)]
    rows = np.column_stack([np.ones(125), x, x**2, *pairs])
    of_pose, costs, held = [np.array([i]) for i in range(125)], Costs(np.ones(125), np.zeros(125)), 1e-9 * np.eye(10)
    criterion = Criterion("D") if kind == "D" else Criterion("I", rows.T @ rows / 125)
    relaxed = relax(rows, of_pose, held, costs, 15.0, criterion)
    chosen = whole(rows, np.arange(125), of_pose, held, costs, 15.0, relaxed)
    moment = rows[chosen].T @ rows[chosen] / 15
    if kind == "D":
        assert np.linalg.det(moment) ** 0.1 > printed * (1 - 1e-6)
        assert np.exp(-relaxed.bound / 10) / 15 == pytest.approx(3.8, abs=0.05)  # "the optimum approximate theory D is 3.8"
    else:
        assert np.trace(np.linalg.solve(moment, rows.T @ rows / 125)) < printed * (1 + 1e-6)
        assert relaxed.bound * 15 == pytest.approx(7.57, abs=0.03)


@pytest.mark.parametrize(
    ("body", "count"), [("box:-200:200,-150:150,-80:0", 25), ("table:400,300", 25), ("cylinder:125,-60:0", 16)]
)
def test_facets_are_proposed_on_every_side_that_does_not_look_down(
    body: str, count: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "artefact.yaml"
    assert guarded(tango.main, ["design", "--facets", body, "-o", str(file)], standalone_mode=False) == 0
    assert ("--facets box:" in capsys.readouterr().err) == body.startswith("table:")  # a table is taken to be at zero
    found = read_artefact(file)
    normals = np.array([facet.normal for facet in found.facets.values()])
    points = np.array([facet.point for facet in found.facets.values()])
    assert len(normals) >= count and normals[:, 2].min() > -0.1
    assert {tuple(np.sign(np.round(n, 3)).astype(int)) for n in normals} >= {
        (1, 0, 0),
        (-1, 0, 0),
        (0, 1, 0),
        (0, -1, 0),
        (0, 0, 1),
    }
    assert np.sum(points * normals, axis=1).max() < 201 and len({tuple(p) for p in points}) == len(points)


@pytest.mark.parametrize("binary", [False, True])
def test_a_drawing_gives_the_facets_of_its_hull(binary: bool, tmp_path: Path) -> None:
    corners = np.array(list(itertools.product([-200.0, 200], [-150.0, 150], [-80.0, 0])))
    triangles = corners[ConvexHull(corners).simplices]
    drawing, one, other = tmp_path / "table.stl", tmp_path / "one.yaml", tmp_path / "other.yaml"
    if binary:
        rows = np.zeros(len(triangles), np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("more", "<u2")]))
        rows["corner"] = triangles
        drawing.write_bytes(b"a table".ljust(80) + len(rows).to_bytes(4, "little") + rows.tobytes())
    else:
        loops = ["outer loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in t) + "endloop\n" for t in triangles]
        drawing.write_text("solid table\n" + "".join(loops) + "endsolid\n", encoding="utf-8")
    for body, file in ((f"mesh:{drawing}", one), ("box:-200:200,-150:150,-80:0", other)):
        assert guarded(tango.main, ["design", "--facets", body, "-o", str(file)], standalone_mode=False) == 0
    assert read_artefact(one).facets == read_artefact(other).facets


def test_a_face_of_any_shape_has_facets_up_to_its_corners_and_none_twice(tmp_path: Path) -> None:
    """A table with seven corners that an STL rounds: its top is one face, and facets stand on all of it."""
    turns = 2 * np.pi * np.arange(7) / 7
    rings = [
        np.column_stack([r * np.cos(turns), 0.85 * r * np.sin(turns), np.full(7, z)]) for r, z in ((118.0, 0.0), (150.0, -40.0))
    ]
    corners = np.round(np.vstack(rings), 3)
    triangles = corners[ConvexHull(corners).simplices]
    loops = ["outer loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in t) + "endloop\n" for t in triangles]
    (tmp_path / "table.stl").write_text("solid table\n" + "".join(loops) + "endsolid\n", encoding="utf-8")
    file = tmp_path / "artefact.yaml"
    assert (
        guarded(tango.main, ["design", "--facets", f"mesh:{tmp_path / 'table.stl'}", "-o", str(file)], standalone_mode=False) == 0
    )
    places = np.array([facet.point for facet in read_artefact(file).facets.values()])
    apart = np.linalg.norm(places[:, None] - places, axis=2) + 1e3 * np.eye(len(places))
    assert apart.min() > 10
    top = places[places[:, 2] > -1e-6]
    assert len(top) == 9 and (top[:, :2].max(axis=0) > (85, 65)).all() and (top[:, :2].min(axis=0) < (-75, -65)).all()


def test_a_drawing_that_is_cut_off_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    corners = np.array(list(itertools.product([-200.0, 200], [-150.0, 150], [-80.0, 0])))
    loops = [
        "outer loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in t) + "endloop\n"
        for t in corners[ConvexHull(corners).simplices]
    ]
    (tmp_path / "half.stl").write_text("solid table\n" + "".join(loops[:8]), encoding="utf-8")
    asked = ["design", "--facets", f"mesh:{tmp_path / 'half.stl'}", "-o", str(tmp_path / "a.yaml")]
    assert guarded(tango.main, asked, standalone_mode=False) == 2
    assert "is cut off" in capsys.readouterr().err and not (tmp_path / "a.yaml").exists()


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("cylinder:100,0:-50", "found Z from 0 to -50; allowed: from the smaller end"),
        ("table:0,100", "allowed: a WIDTH and a DEPTH of at least"),
        ("table:5,5", "allowed: a WIDTH and a DEPTH of at least"),
        ("table:1e9,1e9", "allowed: no more than"),
        ("box:0:20,0:20,0:20", "no face that has room for a facet"),
    ],
)
def test_what_is_wrong_with_a_body_is_said_of_that_body(
    body: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert guarded(tango.main, ["design", "--facets", body, "-o", str(tmp_path / "a.yaml")], standalone_mode=False) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "body", ["mesh:nothing.stl", "box:1:0,0:1,0:1", "ball:3", "cylinder:5,0:1", "table:4", "table:nan,4", "table:10,10"]
)
def test_a_body_that_is_none_is_refused(body: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert guarded(tango.main, ["design", "--facets", body, "-o", str(tmp_path / "a.yaml")], standalone_mode=False) == 2
    assert not list(tmp_path.iterdir())
    assert "Did you mean" not in capsys.readouterr().err  # the word is right, or like none of them


def test_a_relaxed_design_that_goes_on_from_another_ends_where_one_that_begins_anew_does() -> None:
    rows, of_pose = TOUCHES[:12], [np.arange(3 * j, 3 * j + 3) for j in range(4)]
    cheap, dear = (Costs(np.full(12, c), np.full(4, 2.0)) for c in (1.0, 1.7))
    first = relax(rows, of_pose, HELD, cheap, 17.0, CRITERIA[0])
    anew, on = relax(rows, of_pose, HELD, dear, 17.0, CRITERIA[0]), relax(rows, of_pose, HELD, dear, 17.0, CRITERIA[0], first)
    assert on.bound == pytest.approx(anew.bound, rel=0.02)


@pytest.mark.parametrize("count", [2, 3, 6, 9])
def test_one_tour_makes_every_turn(count: int) -> None:
    tour = order._tour(count)
    made = {frozenset(pair) for pair in itertools.pairwise(tour)}
    assert {frozenset(pair) for pair in itertools.combinations(range(count), 2)} <= made


def test_the_way_through_places_on_a_line_goes_along_the_line() -> None:
    place = np.array([3.0, 0.0, 5.0, 1.0, 4.0, 2.0])
    way = order.path(np.abs(place[:, None] - place))
    assert sorted([way, way[::-1]])[0] == [1, 3, 5, 0, 4, 2]


@pytest.mark.parametrize("text", ["volum", "EX0C", "EX0C=", "EX0C=-1", "EX0C=1,EA0C=x", "EX0C=inf", "EX0C=nan"])
def test_a_goal_that_is_none_is_refused_with_what_is_allowed(text: str) -> None:
    with pytest.raises(InputError, match=r"--goal: found .*allowed: volume"):
        goals.read(text)


def test_help_of_the_command_is_asked_for_often(capsys: pytest.CaptureFixture[str]) -> None:
    assert guarded(tango.main, ["design", "--help"], standalone_mode=False) == 0
    assert "--minutes" in capsys.readouterr().out


@pytest.mark.parametrize("option", ["--minutes", "--within", "--stylus-within", "--early"])
def test_a_number_that_is_none_is_refused(option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert guarded(tango.main, ["design", "-C", str(tmp_path), option, "nan"], standalone_mode=False) == 2
    assert f"'{option}': nan is not in the range" in capsys.readouterr().err
    assert guarded(tango.main, ["design", "-C", str(tmp_path), option, "five"], standalone_mode=False) == 2
    assert f"'{option}': 'five' is not a valid float range" in capsys.readouterr().err


def bare(folder: Path) -> Path:
    """folder → a cell as somebody has it who has described machine and table and nothing else."""
    assert guarded(tango.main, ["init", str(folder), "--example", "trunnion"], standalone_mode=False) == 0
    (folder / "strategy.yaml").unlink()
    return folder


@pytest.mark.few(0)
def test_a_table_that_no_axis_reaches_is_refused_with_the_axis_and_what_it_lacks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = bare(tmp_path)
    table = ["design", "--facets", "box:-200:200,-200:200,-2080:-2000", "-o", str(folder / "artefact.yaml")]
    assert guarded(tango.main, table, standalone_mode=False) == 0
    assert guarded(tango.main, ["design", "-C", str(folder), "--goal", "locations"], standalone_mode=False) == 2
    said = capsys.readouterr().err
    assert re.search(r"lacks least is beyond a travel: [XYZ] -?\d+\.\d+ mm, travel -", said) and "obstacles" in said


@pytest.mark.few(1)
@pytest.mark.parametrize("goal", ["volume", "check", "locations"])
def test_a_goal_that_no_touch_of_the_machine_can_see_is_refused_with_the_reason(
    goal: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Three axes and facets that nobody has calibrated: scales and squareness go into the places of the facets."""
    folder = tmp_path / "cell"
    assert guarded(tango.main, ["init", str(folder), "--example", "three_axis"], standalone_mode=False) == 0
    assert guarded(tango.main, ["design", "-C", str(folder), "--goal", goal], standalone_mode=False) == 2
    said = capsys.readouterr().err
    assert re.search(rf"--goal {goal}: no plan here can see an error of the machine .*: EA0Z cannot be separated from", said)
    assert "D, A or condition" in said and "facets with an uncertainty in artefact.yaml are calibrated" in said


@pytest.mark.long
def test_a_check_of_a_cell_that_nobody_has_measured_says_what_comes_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = bare(tmp_path / "cell")
    assert guarded(tango.main, ["design", "-C", str(folder), "--goal", "check"], standalone_mode=False) == 2
    assert f"tango design -C {folder} --goal volume" in capsys.readouterr().err


@pytest.mark.long
def test_a_time_that_is_too_short_is_refused_with_one_that_does_and_a_cell_gets_its_first_strategy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    quickly(monkeypatch)
    folder = bare(tmp_path / "cell")
    file = folder / "strategy.yaml"
    asked = ["design", "-C", str(folder), "--goal", "locations", "--within", "0.3", "-o", str(file), "--json", str(tmp_path / "j")]
    assert guarded(tango.main, [*asked, "--minutes", "1.5"], standalone_mode=False) == 2
    said = capsys.readouterr().err
    assert not file.exists()
    minutes = re.search(r"about ([\d.]+)(?: minutes|\))", said)
    assert not file.exists() and minutes is not None
    assert guarded(tango.main, [*asked, "--minutes", minutes[1]], standalone_mode=False) == 0
    data = json.loads((tmp_path / "j").read_text(encoding="utf-8"))
    assert data["determined"] and len(plan(read_cell(folder)).touches) == data["touches"]
    # What a part of the run determines is told as 'tango estimate' has it: without touches enough there is no number.
    told = [each["value"] for each in data["broken_off"]]
    assert told[0] is None and told[-1] == pytest.approx(data["criterion"]["value"])


def test_the_region_is_printed_with_the_spans_that_its_poses_have() -> None:
    """Beyond 90° of the trunnion the tool would come from below the table: the number of a plan is not of these poses."""
    machine, artefact = (lambda cell: (cell.machine, cell.artefact))(read_cell(Path("examples/trunnion")))
    where = region.region(machine, artefact)
    position = region.poses(machine, where)
    low, high = re.search(r"A (-\d+) … (\d+), C -180 … 180° \(A: ", region.counted(machine, where, position)).groups()  # type: ignore[union-attr]
    assert -92 <= int(low) <= -85 and 85 <= int(high) <= 92
    assert "A -120 … 120" in region.text(where)
    ends = np.where(np.arange(len(machine.names)) == machine.column("A"), math.radians(120), 0.0)
    assert region.counted(machine, where, np.vstack([position, ends, -ends])) == region.text(where)
