"""What the estimate has not seen: held-out indexations, a CMM, a sphere, the whole volume."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner, Result
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_controller.simulate import simulate
from sim_controller.world import tip_in_table, true_machine
from tango_cnc import kinematics
from tango_cnc.cli import tango
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import read_cell, read_world, readings_text, write_text
from tango_cnc.iso230.poses import at_poses
from tango_cnc.records import Cell, InputError, Readings, TangoError, World
from tango_cnc.verify import cmm, sphere, volume
from tango_cnc.verify import held_out as held
from tango_cnc.verify._shared import tips
from tango_cnc.verify.summary import held_out_lines

ROOT = Path(__file__).parents[1]
THESIS_GROUP = (5, 9, 13, 16, 19)  # five of 28 held back, as in Table 4-9


@cache
def cell() -> Cell:
    return read_cell(ROOT / "examples" / "hu40t")


@cache
def world() -> World:
    return read_world(ROOT / "examples" / "hu40t" / "world.yaml")


def measured(true: World, cycles: int = 1) -> Readings:
    return simulate(cell().machine, cell().artefact, cell().strategy, true, cycles)


@cache
def noisy() -> Readings:
    return measured(world())


@cache
def exact() -> Readings:
    return measured(replace(world(), noise=0.0))


@cache
def fitted(terms: str = "S3", noise: bool = True) -> Estimate:
    return estimate(cell().machine, cell().artefact, noisy() if noise else exact(), (terms,))


def hold_out(readings: Readings, groups: held.Groups, terms: str = "S3") -> held.HeldOut:
    return held.held_out(cell().machine, cell().artefact, readings, (terms,), groups)


# Held-out indexations


@pytest.mark.parametrize("terms", ["S3", "S4"])
def test_without_noise_held_out_touches_are_predicted_exactly(terms: str) -> None:
    found = hold_out(exact(), (THESIS_GROUP,), terms)
    assert found.figures.count > 60
    assert found.figures.worst < 1e-8


@pytest.mark.few(0)
def test_what_only_the_held_out_touches_tell_is_no_reproach_to_the_model() -> None:
    """Without the turned spindle nothing tells how the stylus stands in it; the machine's error there is not zero."""
    number = held.indexations(noisy(), cell().machine)
    turned = np.abs(noisy().position[:, cell().machine.column("S")]) > 0.1
    found = hold_out(noisy(), (tuple(np.unique(number[turned]).tolist()), (2, 4)))
    own = found.residual / found.expected
    assert 0 < np.sum(~found.told) < 100 and np.sqrt(np.mean(own[~found.told] ** 2)) > 3
    assert 0.7 < found.ratio < 1.3


@pytest.mark.few(0)
@pytest.mark.parametrize("terms", ["S3", "S4"])
def test_held_out_residuals_are_as_large_as_promised(terms: str) -> None:
    """Rank by promise, too: what is promised to be uncertain is."""
    found = hold_out(noisy(), held.dealt(held.indexations(noisy(), cell().machine), 5), terms)
    assert found.figures.count > 330
    assert 0.9 < found.ratio < 1.1
    far = found.expected > np.quantile(found.expected, 0.8)
    assert 0.75 < np.sqrt(np.mean((found.residual[far] / found.expected[far]) ** 2)) < 1.25


@pytest.mark.few(0)
def test_an_error_that_the_model_lacks_is_found_out_by_holding_out() -> None:
    """A roll of X by 120 µrad over the touched range is no part of S3: what S3 leaves unexplained it cannot predict either."""
    readings = measured(replace(world(), errors={**world().errors, "EAX1": 3e-7}))
    without = hold_out(readings, (THESIS_GROUP,), "S3").figures.sd
    assert without > 1.4 * held.held_out(cell().machine, cell().artefact, readings, ("S3", "EAX1"), (THESIS_GROUP,)).figures.sd
    assert without > 1.4 * hold_out(noisy(), (THESIS_GROUP,), "S3").figures.sd


@pytest.mark.long
def test_touches_that_make_the_ratio_large_are_named_the_furthest_first() -> None:
    """Three touches after a stop, before everything sat where it sits now: no model lacks anything."""
    readings, groups = noisy(), held.leave_one_out(held.indexations(noisy(), cell().machine))
    assert held_out_lines(hold_out(readings, groups)) == []
    place = readings.position.copy()
    place[:3, cell().machine.column("X")] += np.array([0.02, 0.03, 0.04])
    found = hold_out(replace(readings, position=place), groups)
    (line,) = held_out_lines(found)
    off = {int(t): abs(r) for t, r in zip(found.touch[found.far], found.residual[found.far], strict=True)}
    assert set(off) <= {1, 2, 3} and off and found.ratio > found.chance
    assert f"Furthest off, µm: touch{'es' if len(off) > 1 else ''} {max(off, key=lambda t: off[t])} (" in line
    every = hold_out(readings, groups)
    assert "the model lacks something" in held_out_lines(replace(every, residual=1.5 * every.residual))[0]


@pytest.mark.long
def test_figures_per_subset_fall_as_in_table_4_9() -> None:
    sd = {s: hold_out(noisy(), (THESIS_GROUP,), s).figures.sd * 1e3 for s in ("S1", "S2", "S3", "S4")}
    assert sd["S1"] > 20
    assert sd["S2"] > 20
    assert sd["S3"] < 1
    assert sd["S4"] < 2


def test_indexations_have_the_same_number_in_every_cycle_and_with_misses() -> None:
    readings = measured(replace(world(), noise=0.0), cycles=2)
    number = held.indexations(readings, cell().machine)
    once = [i for i, indexation in enumerate(cell().strategy.indexations, 1) for _ in indexation.facets]
    assert number.tolist() == once * 2
    gone = replace(readings, status=("miss",) * 30 + readings.status[30:])
    assert held.indexations(gone, cell().machine).tolist() == once * 2


@given(size=st.integers(1, 27))
def test_dealt_groups_are_a_partition(size: int) -> None:
    groups = held.dealt(np.repeat(np.arange(1, 29), 3), size)
    assert sorted(i for g in groups for i in g) == list(range(1, 29))
    assert max(map(len, groups)) <= size
    assert max(map(len, groups)) - min(map(len, groups)) <= 1


def test_a_facet_that_is_touched_only_there_is_named_and_not_predicted() -> None:
    bar = held.indexations(noisy(), cell().machine)[[f == "101" for f in noisy().facet]][0]
    found = hold_out(noisy(), ((int(bar),),))
    assert found.unpredictable == ("101", "102", "103", "104", "105", "201", "202", "203", "204", "205")
    assert any("scale" in text for text in found.unseen)


def test_holding_out_refuses_what_is_not_there() -> None:
    with pytest.raises(InputError, match="found indexation 29; allowed: 1 to 28"):
        hold_out(noisy(), ((29,),))
    with pytest.raises(InputError, match="found 28; allowed: 1 to 27"):
        held.dealt(np.arange(1, 29), 28)
    with pytest.raises(TangoError, match="without indexations"):
        hold_out(noisy(), (tuple(range(2, 29)),))


# CMM


def cmm_file(folder: Path, true: World, turn: tuple[float, float, float], shift: tuple[float, float, float]) -> Path:
    """What a perfect CMM would write of the true table, standing anywhere in its own frame."""
    lines = ["facet,x,y,z"]
    for facet in cell().artefact.facets.values():
        if facet.ball is None:
            point = np.array(facet.point) + true.facets.get(facet.id, 0.0) * np.array(facet.normal)
            x, y, z = point + np.cross(turn, point) + shift
            lines.append(f"{facet.id},{x:.12f},{y:.12f},{z:.12f}")
    file = folder / "cmm.csv"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


def test_a_perfect_cmm_in_another_frame_agrees_with_a_perfect_estimate(tmp_path: Path) -> None:
    measured_points = cmm.read_cmm(cmm_file(tmp_path, world(), (3e-6, -2e-6, 1e-6), (0.3, -0.2, 0.1)), cell().artefact)
    result = fitted(noise=False)
    table, tip = cmm.compare_artefact(result, measured_points), cmm.compare_tips(result, exact(), measured_points)
    assert table.figures.worst < 1e-8
    assert tip.figures.worst < 1e-8
    assert tip.figures.count == len(exact()) - 10  # all but the balls
    assert table.turn == pytest.approx([-3e-6, 2e-6, -1e-6], abs=1e-9)


def test_a_wrong_facet_of_5_um_shows_in_the_comparison(tmp_path: Path) -> None:
    points = cmm.read_cmm(cmm_file(tmp_path, world(), (0, 0, 0), (0, 0, 0)), cell().artefact)
    points["17"] = points["17"] + [0, 0, 0.005]
    found = cmm.compare_artefact(fitted(noise=False), points)
    assert found.facet[int(np.argmax(np.abs(found.residual)))] == "17"
    assert -0.005 < found.figures.min < -0.003  # the CMM has more material than the estimate; the fit gives way


def test_held_out_tips_against_the_cmm_fall_with_the_subset(tmp_path: Path) -> None:
    points = cmm.read_cmm(cmm_file(tmp_path, world(), (0, 0, 0), (0, 0, 0)), cell().artefact)
    out = np.isin(held.indexations(noisy(), cell().machine), THESIS_GROUP)
    sd = {}
    for terms in ("S1", "S3"):
        result = estimate(cell().machine, cell().artefact, noisy().rows(~out), (terms,))
        sd[terms] = cmm.compare_tips(result, noisy(), points, out).figures.sd
    assert sd["S1"] > 0.02
    assert sd["S3"] < 0.0012


def test_offsets_and_points_are_two_ways_to_say_the_same(tmp_path: Path) -> None:
    by_point = cmm.read_cmm(cmm_file(tmp_path, world(), (0, 0, 0), (0, 0, 0)), cell().artefact)
    text = "facet,offset\n" + "\n".join(f"{f},{world().facets.get(f, 0.0)}" for f in by_point)
    (tmp_path / "offsets.csv").write_text(text + "\n", encoding="utf-8")
    by_offset = cmm.read_cmm(tmp_path / "offsets.csv", cell().artefact)
    assert by_offset.keys() == by_point.keys()
    assert all(np.allclose(by_offset[f], by_point[f], atol=1e-9) for f in by_point)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("facet,x,y\n3,1,2\n", "facet and either x, y, z"),
        ("facet,x,y,z,offset\n", "facet and either x, y, z"),
        ("facet,ofset\n3,0.1\n", "Did you mean 'offset'"),
        ("facet,offset\n99,0.1\n", "'99'"),
        ("facet,offset\n101,0.1\n", "no part of a ball"),
        ("facet,offset\n3,nan\n", "a finite number"),
        ("facet,offset\n3,12\n", "12.000 mm from its nominal plane"),
        ("facet,offset\n3\n", "1 values; allowed: 2"),
        ("facet,offset\n3,0\n4,0\n", "7 or more"),
    ],
)
def test_a_cmm_file_that_is_wrong_is_refused_with_line_and_reason(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "cmm.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="cmm") as found:
        cmm.read_cmm(tmp_path / "cmm.csv", cell().artefact)
    assert message in str(found.value)


def test_facets_on_top_alone_do_not_place_a_table(tmp_path: Path) -> None:
    text = "facet,offset\n" + "".join(f"{f},0\n" for f in range(16, 29))
    (tmp_path / "cmm.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="on the top and on at least three sides"):
        cmm.compare_artefact(fitted(), cmm.read_cmm(tmp_path / "cmm.csv", cell().artefact))


# Sphere


def test_the_33_directions_of_chapter_6() -> None:
    n = sphere.directions()
    assert np.allclose(np.linalg.norm(n, axis=1), 1)
    latitudes = np.round(np.degrees(np.arcsin(n[:, 2]))).astype(int).tolist()
    assert {lat: latitudes.count(lat) for lat in set(latitudes)} == {0: 12, 30: 8, -30: 8, 60: 4, 90: 1}


@given(
    centre=st.tuples(*[st.floats(-300, 300)] * 3),
    radius=st.floats(1, 100),
    seed=st.integers(0, 2**32),
)
@settings(max_examples=40)
def test_a_sphere_is_found_from_points_on_a_cap_of_it(centre: tuple[float, float, float], radius: float, seed: int) -> None:
    n = np.random.default_rng(seed).normal(size=(40, 3))
    n[:, 2] = np.abs(n[:, 2])
    n /= np.linalg.norm(n, axis=1)[:, None]
    found = sphere.fit_sphere(np.array(centre) + radius * n)
    assert np.allclose(found.centre, centre, atol=1e-9)
    assert found.radius == pytest.approx(radius, abs=1e-9)
    assert found.out_of_sphericity < 1e-9


def test_a_fitted_sphere_leaves_no_slope() -> None:
    """At the least-squares sphere the residuals are orthogonal to every change of centre and radius."""
    n = sphere.directions()
    found = sphere.fit_sphere(12.0 * n + np.random.default_rng(1).normal(scale=0.002, size=(33, 1)) * n)
    assert abs(found.residual.sum()) < 1e-10
    spoke = (12.0 * n - found.centre) / np.linalg.norm(12.0 * n - found.centre, axis=1)[:, None]
    assert np.abs(spoke.T @ found.residual).max() < 1e-6


def test_points_in_a_plane_are_no_sphere() -> None:
    angle = np.linspace(0, 6, 20)
    with pytest.raises(InputError, match="in one plane"):
        sphere.fit_sphere(np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]))


@pytest.mark.long
def test_model_and_simulator_touch_the_sphere_alike() -> None:
    """Two programs: the fixed point on the model, and contacts solved by the simulator; one error of each kind at once."""
    errors = {"EX0C": 0.05, "EA0B": 4e-5, "EYY1": 2e-5, "EB0Z": -3e-5, "EXXb": 0.002}
    artefact, strategy = sphere.sphere_cell(cell().machine, cell().strategy.indexations[:20], (0, 150, 100), 9.525)
    true = World(errors)
    result = estimate(cell().machine, cell().artefact, measured(true), ("S3",))
    ours = sphere.contacts(cell().machine, artefact, strategy, result)
    theirs = sphere.measured(cell().machine, artefact, simulate(cell().machine, artefact, strategy, true))
    assert len(ours) == len(theirs) == 434
    spheres = [sphere.sphere_test(result, t) for t in (ours, theirs)]
    assert spheres[0].nominal.out_of_sphericity == pytest.approx(spheres[1].nominal.out_of_sphericity, rel=1e-3)
    assert spheres[0].nominal.out_of_sphericity > 0.05
    assert all(s.compensated.out_of_sphericity < 1e-8 for s in spheres)
    assert all(abs(s.size_error(s.compensated)) < 1e-8 for s in spheres)


@pytest.mark.long
def test_the_scatter_that_a_sphere_test_must_show_is_predicted() -> None:
    """Both vary: the readings that the estimate comes from, and the touches on the sphere."""
    artefact, strategy = sphere.sphere_cell(cell().machine, cell().strategy.indexations[:20], (0, 150, 100), 9.525)
    found = []
    for seed in range(8):
        touches = sphere.measured(
            cell().machine, artefact, simulate(cell().machine, artefact, strategy, replace(world(), facets={}), seed=seed)
        )
        readings = simulate(cell().machine, cell().artefact, cell().strategy, world(), seed=100 + seed)
        result = estimate(cell().machine, cell().artefact, readings, ("S3",))
        found.append(sphere.sphere_test(result, touches))
    spread = [f.compensated.out_of_sphericity for f in found]
    assert found[0].nominal.out_of_sphericity > 0.2
    assert np.median(spread) == pytest.approx(np.median([f.expected[0] for f in found]), rel=0.15)
    assert sum(s > f.expected[1] for s, f in zip(spread, found, strict=True)) <= 2


# The volume


@cache
def chart(terms: str = "S3", noise: bool = True) -> volume.VolumeMap:
    result = fitted(terms, noise)
    own = np.array(result.model.touches.position)
    own[:, -1] = 0.0
    return volume.volume(result, np.vstack([volume.grid(cell().machine, result.model.touches, 3), own]))


def true_error(map_: volume.VolumeMap, true: World) -> np.ndarray:
    machine = true_machine(cell().machine, replace(true, stylus={}))
    tip = tip_in_table(machine, map_.position, np.zeros_like(map_.position))
    return volume.of_tips(map_, tip, fitted().model.touches)


def test_the_map_of_an_exact_estimate_is_the_true_machine() -> None:
    map_ = chart(noise=False)
    assert np.abs(map_.error - true_error(map_, world())).max() < 1e-8
    assert map_.size.max() > 0.1


@pytest.mark.long
def test_the_map_errs_as_it_says() -> None:
    """|error of the map|² is between one and three times the variance of the worst direction, on average over many machines."""
    map_ = chart()
    ratio = []
    for seed in range(8):
        result = estimate(
            cell().machine, cell().artefact, simulate(cell().machine, cell().artefact, cell().strategy, world(), seed=seed), ("S3",)
        )
        again = volume.volume(result, map_.position)
        left = again.error - true_error(again, world())
        ratio.append(np.mean(np.sum(left**2, axis=1)) / np.mean(again.std**2))
    assert 0.8 < np.mean(ratio) < 3


def test_a_table_set_up_elsewhere_and_a_longer_tool_are_no_error() -> None:
    map_ = chart()
    poses = at_poses(cell().machine, map_.position, np.zeros_like(map_.position))
    moved = map_.point + np.cross([2e-5, -1e-5, 3e-5], map_.point) + [0.1, -0.2, 0.05]
    moved += 0.07 * kinematics.spindle_axis(poses.chain, poses.position)
    assert np.abs(volume.of_tips(map_, moved, fitted().model.touches)).max() < 1e-5


def test_backlash_is_told_apart_from_the_map() -> None:
    assert np.allclose(chart(noise=False).reversal.max(), worst_reversal(), rtol=1e-3)


def worst_reversal() -> float:
    """By the simulator: the largest change of the tip when every axis may have come from either side."""
    map_ = chart(noise=False)
    machine = true_machine(cell().machine, replace(world(), stylus={}))
    still = tip_in_table(machine, map_.position, np.zeros_like(map_.position))
    worst = 0.0
    for signs in np.array(np.meshgrid(*[[-1.0, 1.0]] * 4)).reshape(4, -1).T:
        direction = np.zeros_like(map_.position)
        for name, sign in zip("XYBC", signs, strict=True):
            direction[:, cell().machine.column(name)] = sign
        worst = max(worst, float(np.linalg.norm(tip_in_table(machine, map_.position, direction) - still, axis=1).max()))
    return worst


def test_what_was_touched_is_inside_and_the_ends_of_the_travel_are_not() -> None:
    map_ = chart()
    touched = len(fitted().model.touches)
    assert not map_.extrapolated[-touched:].any()
    far = np.abs(map_.position[:, 0]) > 399
    assert far.any()
    assert map_.extrapolated[far].all()
    assert map_.outside[far, 0].all()


def test_inside_every_range_may_still_be_outside_the_hull() -> None:
    """B far over with C the other way round: each angle was touched, never together."""
    touches = fitted().model.touches
    pose = np.array(touches.position[:1])
    pose[0] = [0.0, 0.0, 300.0, np.radians(85), np.radians(260), 0.0]
    assert touches.machine.names == ("X", "Y", "Z", "B", "C", "S")
    outside, extrapolated = volume.probed(touches, pose)
    assert not outside.any()
    assert extrapolated.all()


def test_uncertainty_grows_where_nobody_has_touched() -> None:
    map_ = chart("S4")
    assert map_.std[map_.extrapolated].max() > 5 * map_.std[~map_.extrapolated].max()


def test_an_estimate_without_errors_of_the_machine_gives_no_map() -> None:
    with pytest.raises(TangoError, match=r"contains no error of the machine.*its terms ask for none"):
        volume.volume(fitted("S1"), np.zeros((1, 6)))


def test_predicted_tips_of_the_estimate_are_those_of_the_simulator() -> None:
    result = fitted(noise=False)
    position, direction = exact().position, exact().direction
    ours = tips(result, at_poses(cell().machine, position, direction))
    theirs = tip_in_table(true_machine(cell().machine, world()), position, direction)
    assert np.abs(ours - theirs).max() < 1e-8


def test_what_drifts_or_remembers_is_no_part_of_the_map() -> None:
    """scale_drift is nothing at the start of a test; move_length_memory depends on the way and not on the pose."""
    drifting = estimate(cell().machine, cell().artefact, noisy(), ("S3", {"cause": "scale_drift", "axis": "X", "tau": 900.0}))
    assert any("scale_drift" in c.name for c in drifting.model.coefficients)
    still = volume.volume(drifting, chart().position)
    drawn = replace(drifting, values=drifting.values + 1e-3 * np.array(["scale_drift" in n for n in drifting.model.names]))
    assert np.array_equal(volume.volume(drawn, chart().position).error, still.error)


# The command


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("verify") / "cell"
    for name in ("tango.yaml", "machine.yaml", "artefact.yaml", "strategy.yaml", "world.yaml"):
        write_text(target / name, (ROOT / "examples" / "hu40t" / name).read_text(encoding="utf-8"))
    write_text(target / "readings.csv", readings_text(noisy()))
    return target


def verify(folder: Path, *options: str) -> Result:
    return CliRunner().invoke(tango, ["verify", "-C", str(folder), *options], standalone_mode=False)


@pytest.mark.long
def test_verify_says_what_it_found_as_text_and_json(folder: Path) -> None:
    text = verify(folder, "--groups", "5")
    assert text.exit_code == 0, text.output
    assert "Held-out indexations" in text.output
    found = json.loads(verify(folder, "--groups", "5", "--json", "-").stdout)
    assert found["format"] == "tango-verification/1"
    own = found["held_out"]["S3"]
    assert own["touches"] == len(own["residuals"])
    assert [len(g["indexations"]) for g in own["groups"]] == [5, 5, 5, 5, 4, 4]
    assert max(r["residual_um"] for r in own["residuals"]) == pytest.approx(own["max_um"])


@pytest.mark.long
def test_verify_compares_the_subsets_side_by_side(folder: Path) -> None:
    found = json.loads(verify(folder, "--subsets", "--hold-out", "3,7", "--json", "-").stdout)["held_out"]
    assert list(found) == ["S1", "S2", "S3", "S4"]
    assert found["S1"]["sd_um"] > 20 > 2 > found["S3"]["sd_um"]


@pytest.mark.long
@pytest.mark.parametrize(("limit", "status"), [("5", 0), ("1", 1)])
def test_a_limit_that_is_exceeded_ends_with_status_1(folder: Path, limit: str, status: int) -> None:
    found = verify(folder, "--hold-out", "3", "--limit-um", limit, "--json", "-")
    assert found.return_value == status
    assert json.loads(found.stdout)["passed"] is (status == 0)


@pytest.mark.long
def test_before_and_after_over_the_volume(folder: Path) -> None:
    found = json.loads(verify(folder, "--volume", "--levels", "3", "--world", str(folder / "world.yaml"), "--json", "-").stdout)[
        "volume"
    ]
    assert found["touched"]["before"]["max_um"] > 50
    assert found["touched"]["after"]["max_um"] < 3
    assert found["extrapolated"]["poses"] > 0


@pytest.mark.long
def test_the_map_is_written_pose_by_pose(folder: Path, tmp_path: Path) -> None:
    file = tmp_path / "map.csv"
    assert verify(folder, "--volume", "--levels", "2", "--map", str(file)).return_value == 0
    head, *rows = [line.split(",") for line in file.read_text(encoding="utf-8").splitlines()]
    assert head[:5] == ["X", "Y", "Z", "B", "C"]
    assert head[-1] == "extrapolated"
    assert len(rows) == 2**5 + len(noisy())
    corner = dict(zip(head, map(float, rows[0]), strict=True))
    assert (corner["X"], corner["Z"], corner["B"], corner["extrapolated"]) == (-400, -100, -95, 1)


@pytest.mark.long
def test_after_compensation_the_second_estimate_is_the_map(folder: Path, tmp_path: Path) -> None:
    """Readings of a machine from which all axis locations were taken out."""
    better = replace(world(), errors={name: value for name, value in world().errors.items() if "0" not in name})
    write_text(tmp_path / "after.csv", readings_text(measured(better)))
    found = json.loads(verify(folder, "--volume", "--levels", "2", "--after", str(tmp_path / "after.csv"), "--json", "-").stdout)
    touched = found["volume"]["touched"]
    assert touched["before"]["max_um"] > 50
    assert touched["after"]["max_um"] < 0.2 * touched["before"]["max_um"]


@pytest.mark.long
def test_the_sphere_cell_goes_the_whole_way(folder: Path, tmp_path: Path) -> None:
    ball = tmp_path / "ball"
    assert verify(folder, "--write-sphere", str(ball)).exit_code == 0
    assert read_cell(ball).controller is not None
    text = yaml.safe_load((folder / "world.yaml").read_text(encoding="utf-8")) | {"facets": {}}
    (tmp_path / "world.yaml").write_text(yaml.safe_dump(text), encoding="utf-8")
    assert CliRunner().invoke(tango, ["simulate", "-C", str(ball), "--world", str(tmp_path / "world.yaml")]).exit_code == 0
    found = json.loads(verify(folder, "--sphere-cell", str(ball), "--json", "-").stdout)["sphere"]
    assert found["nominal"]["out_of_sphericity_um"] > 200
    assert found["compensated"]["out_of_sphericity_um"] < 7
    again = verify(folder, "--write-sphere", str(ball))
    assert isinstance(again.exception, InputError)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--hold-out", "three"], "numbers of indexations"),
        (["--limit-um", "-1"], "greater than 0"),
        (["--sphere", "--sphere-at", "1,2"], "three numbers"),
        (["--volume", "--levels", "40"], "allowed: 2 to"),
        (["--sphere", "--sphere-diameter", "0"], "greater than 0"),
    ],
)
def test_wrong_options_are_refused_in_words(folder: Path, options: list[str], message: str) -> None:
    found = verify(folder, *options)
    assert isinstance(found.exception, InputError)
    assert message in str(found.exception)


def test_without_matplotlib_pictures_are_refused_before_anything_is_done(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tango_cnc.report.pictures.available", lambda: False)
    found = verify(folder, "--hold-out", "3", "--pictures", str(tmp_path / "none"))
    assert isinstance(found.exception, InputError)
    assert "tango-cnc[report]" in str(found.exception)
    assert not (tmp_path / "none").exists()


@pytest.mark.long
def test_pictures_are_written(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    file = cmm_file(tmp_path, world(), (0, 0, 0), (0, 0, 0))
    options = ["--hold-out", "3", "--cmm", str(file), "--sphere", "--volume", "--levels", "2"]
    found = verify(folder, *options, "--pictures", str(tmp_path / "pictures"))
    assert found.exit_code == 0, found.output
    pictures = sorted((tmp_path / "pictures").iterdir())
    assert [p.name for p in pictures] == ["cmm.png", "held_out.png", "sphere.png", "volume.png"]
    assert all(p.read_bytes().startswith(b"\x89PNG") and p.stat().st_size > 20_000 for p in pictures)
