"""The followed machine: what it says of a measured night, what it alarms on, and how often it does so for nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.nights_parts import Story, nights

from sim_controller.simulate import simulate
from tango_cnc import state as s
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import opened
from tango_cnc.nightly import learning
from tango_cnc.records import Cell, Readings, World
from tango_cnc.state import charts, naming, rates
from tango_cnc.state.filter import as_numbers, matched, restored
from tango_cnc.touches import from_readings


@pytest.fixture(scope="module")
def cell(root: Path) -> Cell:
    return read_cell(root / "examples" / "hu40t")


@pytest.fixture(scope="module")
def truth(root: Path) -> World:
    return read_world(root / "examples" / "hu40t" / "world.yaml")


def read(cell: Cell, truth: World, seed: int, part: int = 1, warm: float = 20.0) -> Readings:
    strategy = replace(cell.strategy, indexations=cell.strategy.indexations[::part])
    readings = simulate(cell.machine, cell.artefact, strategy, truth, seed=seed)
    return replace(readings, temperatures={"bed": np.full(len(readings), warm)})


@pytest.fixture(scope="module")
def known(cell: Cell, truth: World) -> tuple[s.Frame, s.State]:
    """The state after one full night, linearised where it ended."""
    readings = read(cell, truth, 3)
    followed = s.frame(from_readings(cell.machine, cell.artefact, readings), cell.terms)
    begin = after = s.start(followed, 0.0, 20.0)
    for _ in range(3):
        what = s.seen(followed, readings, after.mean, 20.0)
        after = s.updated(begin, what, s.judge(begin, what), quiet=False)
    return followed, after


def test_after_one_night_the_state_is_the_estimate(cell: Cell, truth: World, known: tuple[s.Frame, s.State]) -> None:
    followed, after = known
    result = estimate(cell.machine, cell.artefact, read(cell, truth, 3), cell.terms)
    places = [followed.place[name] for name in result.model.names]
    assert np.max(np.abs(after.mean[places] - result.values) / result.std) < 0.02
    ratio = after.std[places] * result.sigma / result.std / result.sigma
    assert 0.9 < ratio.min() <= ratio.max() < 1.1  # the state knows the stated scatter, the estimate the seen one


def test_a_state_comes_back_from_plain_numbers(known: tuple[s.Frame, s.State]) -> None:
    followed, after = known
    back = restored(after.names, after.mean, after.covariance, as_numbers(after))
    assert np.allclose(back.covariance, after.covariance, rtol=1e-9, atol=1e-20)
    assert matched(back, followed) is back
    fewer = replace(
        back, names=back.names[1:], mean=back.mean[1:], root=np.linalg.cholesky(back.covariance[1:, 1:]), rates=back.rates[1:]
    )
    assert matched(fewer, followed).names == followed.names
    assert matched(fewer, followed).std[0] > 1e-4  # what is new is not known


def test_after_a_year_without_a_night_a_knock_is_no_wander(known: tuple[s.Frame, s.State]) -> None:
    """A clock that has jumped by a year looks the same: what is expected grows as in a month, and the date is that of the night."""
    _, state = known
    year, month, week = (s.grown(state, state.day + days) for days in (365.0, 30.0, 7.0))
    np.testing.assert_allclose(year.std, month.std)
    np.testing.assert_allclose(month.std, s.predicted(state, state.day + 30.0).std)
    assert year.day == state.day + 365.0 and (week.std < month.std).any()
    assert s.grown(state, state.day - 5.0).day == state.day


def test_what_a_check_does_not_see_becomes_less_certain(known: tuple[s.Frame, s.State]) -> None:
    _, after = known
    later = s.predicted(after, 10.0)
    wandering = after.rates > 0
    assert np.all(later.std[wandering] > after.std[wandering])
    assert np.allclose(later.std[~wandering], after.std[~wandering])
    assert (
        np.array_equal(s.predicted(after, -3.0).root.round(15), after.root.round(15)) or s.predicted(after, -3.0).day == after.day
    )


CHANGES = {
    "EX0C": ("axis_location", {"EX0C": 0.006}),
    "EA0B": ("axis_location", {"EA0B": 2e-5}),
    "EYYb": ("backlash", {"EYYb": 0.003}),
}


@pytest.mark.few(1)
@pytest.mark.parametrize("name", CHANGES)
def test_one_parameter_that_jumps_is_named(cell: Cell, truth: World, known: tuple[s.Frame, s.State], name: str) -> None:
    followed, after = known
    cause, change = CHANGES[name]
    errors = {key: value + change.get(key, 0.0) for key, value in truth.errors.items()}
    ahead = s.predicted(after, 1.0)
    what = s.seen(followed, read(cell, replace(truth, errors=errors), 11, 3), ahead.mean, 20.0)
    tonight = s.judge(ahead, what)
    assert tonight.alarm()
    found = s.name_change(ahead, followed, tonight, s.hypotheses(followed, 0.0))
    assert found is not None and (found.hypothesis.cause, found.hypothesis.parameter) == (cause, name)
    assert abs(found.size[0] - change[name]) < 4 * found.std[0]
    opened = s.reopened(ahead, followed, found.hypothesis.directions * 3 * abs(found.size))
    follows = s.updated(opened, what, tonight, quiet=False)
    place = followed.place[name]
    assert abs(follows.mean[place] - errors[name]) < 4 * follows.std[place]


def test_a_table_that_was_knocked_is_told_from_a_machine_that_was(cell: Cell, truth: World, known: tuple[s.Frame, s.State]) -> None:
    followed, after = known
    moved = np.array([0.0, 0.012, 0.004])
    facets = {i: truth.facets.get(i, 0.0) + float(moved @ f.normal) for i, f in cell.artefact.facets.items()}
    ahead = s.predicted(after, 1.0)
    what = s.seen(followed, read(cell, replace(truth, facets=facets), 12, 3), ahead.mean, 20.0)
    tonight = s.judge(ahead, what)
    found = s.name_change(ahead, followed, tonight, s.hypotheses(followed, 0.0))
    assert tonight.alarm() and found is not None and found.hypothesis.cause == "table"
    assert np.allclose(found.size, moved, atol=0.0015)


def test_two_changes_at_once_are_both_named_with_sizes_of_one_fit(cell: Cell, truth: World, known: tuple[s.Frame, s.State]) -> None:
    followed, after = known
    change = {"EX0C": 0.012, "EA0B": 3e-5}
    errors = {key: value + change.get(key, 0.0) for key, value in truth.errors.items()}
    ahead = s.predicted(after, 1.0)
    what = s.seen(followed, read(cell, replace(truth, errors=errors), 21, 3), ahead.mean, 20.0)
    tonight = s.judge(ahead, what)
    found = s.name_change(ahead, followed, tonight, s.hypotheses(followed, 0.0))
    assert found is not None and found.besides is not None
    named = {f.hypothesis.parameter: f for f in (found, found.besides)}
    assert set(named) == set(change)
    assert all(abs(f.size[0] - change[name]) < 4 * f.std[0] for name, f in named.items())


def test_scales_that_change_alike_are_named_together(cell: Cell, truth: World, known: tuple[s.Frame, s.State]) -> None:
    followed, after = known
    errors = {key: value + (3e-5 if key in ("EXX1", "EYY1", "EZZ1") else 0.0) for key, value in truth.errors.items()}
    ahead = s.predicted(after, 1.0)
    what = s.seen(followed, read(cell, replace(truth, errors=errors), 22, 3), ahead.mean, 20.0)
    found = s.name_change(ahead, followed, s.judge(ahead, what), s.hypotheses(followed, 0.0))
    assert found is not None and found.hypothesis.cause == "scales"
    assert abs(found.size[0] - 3e-5) < 4 * found.std[0]


def test_a_chip_on_a_facet_is_no_alarm(cell: Cell, truth: World, known: tuple[s.Frame, s.State]) -> None:
    followed, after = known
    readings = read(cell, truth, 13, 3)
    position = readings.position.copy()
    position[20, :3] += 0.03 * np.sign(position[20, :3])
    ahead = s.predicted(after, 1.0)
    tonight = s.judge(ahead, s.seen(followed, replace(readings, position=position), ahead.mean, 20.0))
    assert tonight.outliers == (int(readings.touch[20]),)
    assert not tonight.alarm()


@pytest.mark.long
def test_false_alarms_are_as_rare_as_stated(known: tuple[s.Frame, s.State], cell: Cell, truth: World) -> None:
    """400 nights drawn from what the state itself believes: at a rate of one in twenty, 20 alarms."""
    followed, after = known
    ahead = s.predicted(replace(after, noise=(1e6 * after.sigma**2, 1e6), agreement=(1e6, 1e6)), 1.0)
    what = s.seen(followed, read(cell, truth, 14, 6), ahead.mean, 20.0)
    keep = what.touch > 0
    rng = np.random.default_rng(5)
    alarms = 0
    rows = what.rows[keep]
    for _ in range(400):
        true = ahead.mean + ahead.root @ rng.normal(size=len(ahead.mean))
        value = rows @ true + rng.normal(scale=after.sigma, size=len(rows))
        tonight = s.judge(ahead, replace(what, rows=rows, value=value, touch=what.touch[keep]))
        alarms += tonight.p_value < 0.05
    assert 8 <= alarms <= 34  # 20 expected, 99.7 % within


@pytest.mark.long
def test_rates_are_learned_from_what_there_was(known: tuple[s.Frame, s.State], cell: Cell, truth: World) -> None:
    """A parameter that wanders ten times faster than the others is found out, and the others are not blamed."""
    followed, after = known
    fast, slow = followed.place["EX0C"], followed.place["EY0S"]
    rng = np.random.default_rng(8)
    what = s.seen(followed, read(cell, truth, 15, 2), after.mean, 20.0)
    rows, true = what.rows[what.touch > 0], after.mean.copy()
    nights = []
    for day in range(1, 41):
        true[fast] += rng.normal(0, 3e-3)
        true[slow] += rng.normal(0, 3e-4)
        value = rows @ true + rng.normal(scale=after.sigma, size=len(rows))
        nights.append((float(day), s.Seen(rows, value, what.touch[what.touch > 0], 20.0)))
    learned = s.learn(followed, after, nights).rates
    assert 1.5e-3 < np.sqrt(learned[fast]) < 5e-3
    assert np.sqrt(learned[slow]) < 1e-3
    assert np.all(learned[followed.wander == 0] == 0)


def nights_of_a_quiet_machine(
    after: s.State, what: s.Seen, variance: np.ndarray, count: int, seed: int = 9
) -> list[tuple[float, s.Seen]]:
    """state, touches of a night, true variance a day, how many nights → what was seen in them."""
    rng, keep, true = np.random.default_rng(seed), what.touch > 0, after.mean.copy()
    rows, found = what.rows[keep], []
    for day in range(1, count + 1):
        true = true + rng.normal(size=len(true)) * np.sqrt(variance)
        value = rows @ true + rng.normal(scale=after.sigma, size=len(rows))
        found.append((float(day), s.Seen(rows, value, what.touch[keep], 20.0)))
    return found


def test_the_slope_of_the_likelihood_is_that_of_its_differences(known: tuple[s.Frame, s.State], cell: Cell, truth: World) -> None:
    """Rates are learned by a slope that is exact: of every family one unknown, a night of an alarm among them."""
    followed, after = known
    what = s.seen(followed, read(cell, truth, 15, 8), after.mean, 20.0)
    told = rates._nights(after, nights_of_a_quiet_machine(after, what, followed.wander / 4, 8), (3,))
    slope, _ = rates._slopes(told, after.rates, rates._gain(after, told, after.rates))
    for family in ("location", "angle", "gain", "backlash", "table"):
        place = followed.families.index(family)
        moved = [after.rates.copy() for _ in range(2)]
        for one, way in zip(moved, (1e-4, -1e-4), strict=True):
            one[place] *= np.exp(way)
        up, down = (rates._gain(after, told, one).likelihood for one in moved)
        # The night of the alarm is let in with the rate as well, and says nothing of it: at most half by its volume.
        assert slope[place] - 0.05 < (up - down) / 2e-4 + 0.5 < slope[place] + 0.55, family


@pytest.mark.long
def test_a_machine_quieter_than_the_first_idea_is_found_to_be_so(known: tuple[s.Frame, s.State], cell: Cell, truth: World) -> None:
    """Errors wander by 0.6 (scales 0.4) of the first idea. Learned from twenty nights, none is taken for twice as restless."""
    followed, after = known
    what = s.seen(followed, read(cell, truth, 15, 4), after.mean, 20.0)
    share = np.array([{"location": 0.6, "angle": 0.6, "gain": 0.4, "backlash": 0.9}.get(f, 0.0) for f in followed.families])
    true = followed.wander * share**2
    learned = s.learn(followed, after, nights_of_a_quiet_machine(after, what, true, 20)).rates
    for family in ("location", "angle", "gain", "backlash"):
        own = np.array([f == family for f in followed.families])
        assert 0.5 < np.sqrt(learned[own].mean() / true[own].mean()) < 1.6, family
    points = np.array([f == "table" for f in followed.families])
    assert np.all(learned[points] < 0.3 * followed.wander[points])  # facets lie where they lay


@pytest.mark.long
def test_nights_to_come_are_as_far_from_learned_rates_as_learning_says(
    known: tuple[s.Frame, s.State], cell: Cell, truth: World
) -> None:
    """Machines of half the first idea; rates from ten nights. The next forty lie from them as far as the ten say, once what was
    fitted is paid for; the ten themselves lie nearer, and nights judged with the first idea much nearer.
    """
    followed, after = known
    what = s.seen(followed, read(cell, truth, 15, 8), after.mean, 20.0)
    count, told, paid, later, before = int(np.sum(what.touch > 0)), [], [], [], []
    for seed in range(4):
        nights = nights_of_a_quiet_machine(after, what, followed.wander / 4, 50, seed)
        learned = s.learn(followed, after, nights[:10])
        total, dof = learned.agreement([count] * 10, [(0.0, 0.0)] * 10) or (0.0, 0.0)
        assert dof == 10 * count
        paid.append(total / dof)
        told.append(learned.squares.mean() / count)
        every = rates._nights(after, nights, ())
        later.append(rates._gain(after, every, learned.rates).squares[10:].mean() / count)
        before.append(rates._gain(after, every, after.rates).squares[:10].mean() / count)
    assert abs(np.mean(paid) / np.mean(later) - 1) < 0.04  # 400 touches a machine: 4 %
    assert np.mean(told) < np.mean(paid) < 1.1
    assert np.mean(before) < 0.9 * np.mean(later)


def test_an_alarm_says_nothing_of_how_far_quiet_nights_lie(known: tuple[s.Frame, s.State], cell: Cell, truth: World) -> None:
    followed, after = known
    what = s.seen(followed, read(cell, truth, 15, 8), after.mean, 20.0)
    nights = nights_of_a_quiet_machine(after, what, followed.wander / 4, 8)
    learned = s.learn(followed, after, nights, (3, 7))
    assert [int(n) for n in np.flatnonzero(np.isnan(learned.squares))] == [3, 4, 7]  # a night after an alarm sees what it opened
    total, dof = learned.agreement([100] * 8, [(20.0, 25.0)] * 8) or (0.0, 0.0)
    assert dof == 5 * 75
    assert total == pytest.approx(np.nansum(learned.squares) - 5 * 20.0 + 2 * learned.fitted)
    assert s.learn(followed, after, nights[:2]).agreement([100] * 2, [(20.0, 25.0)] * 2) is None


@pytest.mark.long
def test_smoothing_is_never_less_certain_than_filtering(known: tuple[s.Frame, s.State], cell: Cell, truth: World) -> None:
    from tango_cnc.state.smooth import Filtered, smoothed

    followed, state = known
    filtered = []
    for day in range(1, 6):
        ahead = s.predicted(state, float(day))
        what = s.seen(followed, read(cell, truth, 20 + day, 4), ahead.mean, 20.0)
        state = s.updated(ahead, what, s.judge(ahead, what))
        filtered.append(Filtered(state.mean, state.covariance, float(day)))
    past = smoothed(filtered, state.rates)
    for a, b in zip(filtered, past, strict=True):
        assert np.all(np.diag(b.covariance) <= np.diag(a.covariance) * (1 + 1e-6))


@pytest.mark.long
def test_chosen_touches_tell_more_than_every_fifth_indexation(known: tuple[s.Frame, s.State], cell: Cell, truth: World) -> None:
    from tango_cnc.state.volume import aim, levers, over_volume

    followed, after = known
    ahead = s.predicted(after, 30.0)
    lever = levers(followed)
    readings = read(cell, truth, 30)
    what = s.seen(followed, readings, ahead.mean, 20.0)
    rows = what.rows[what.touch > 0]
    turned = np.concatenate([[0], np.cumsum(np.any(np.diff(readings.position[:, 3:], axis=0) != 0, axis=1))])
    choice = s.choose(ahead, rows, turned, aim(lever), 380.0, 4.2, 5.0)
    assert choice.seconds <= 380.0 and choice.variance_after < choice.variance_before

    def left(keep: np.ndarray) -> float:
        own = s.Seen(rows[keep], what.value[what.touch > 0][keep], readings.touch[keep], 20.0)
        return over_volume(lever, ahead.mean, s.updated(ahead, own, s.judge(ahead, own)).covariance).std

    assert left(choice.rows) < left(np.flatnonzero(turned % 5 == 0))


def test_run_lengths_are_those_of_the_literature() -> None:
    """Montgomery, Introduction to Statistical Quality Control, tables 9.3 (CUSUM) and 9.11 (EWMA)."""
    assert charts.run_length_shewhart(3.0) == pytest.approx(370.4, abs=0.1)
    assert charts.run_length_cusum(0.5, 5.0) == pytest.approx(465, rel=0.01)
    assert charts.run_length_cusum(0.5, 4.0) == pytest.approx(168, rel=0.01)
    assert charts.run_length_cusum(0.5, 5.0, 1.0) == pytest.approx(10.4, rel=0.01)
    assert charts.run_length_ewma(0.2, 2.962) == pytest.approx(500, rel=0.01)
    assert charts.run_length_ewma(0.1, 2.814) == pytest.approx(500, rel=0.01)
    assert charts.limit_for(charts.run_length_shewhart, 370.4) == pytest.approx(3.0, abs=1e-3)


@pytest.mark.long
@pytest.mark.parametrize("kind", charts.KINDS)
def test_a_chart_alarms_for_nothing_as_often_as_it_states(kind: str) -> None:
    """100 000 nights of a machine on which nothing happens, the chart begun anew after every alarm: within four sigmas."""
    quiet = np.random.default_rng(3).normal(size=100_000)
    alarms = begun = 0
    while begun < len(quiet):
        found = np.flatnonzero(charts.KINDS[kind](quiet[begun : begun + 6000]).alarm)
        alarms += bool(len(found))
        begun += int(found[0]) + 1 if len(found) else 6000
    expected = len(quiet) / charts.KINDS[kind](quiet[:2]).nights_to_false_alarm
    assert abs(alarms - expected) < 4 * np.sqrt(expected)


@pytest.mark.parametrize("kind", charts.KINDS)
def test_a_chart_alarms_on_a_shift(kind: str) -> None:
    quiet = np.random.default_rng(4).normal(size=80)
    shifted = charts.KINDS[kind](np.concatenate([quiet[:50], quiet[50:80] + 4]))
    assert shifted.alarm[50:55].any()


@pytest.mark.few(0)
def test_the_only_touch_of_a_point_is_set_apart_once_and_counts_when_it_comes_again(
    cell: Cell, truth: World, known: tuple[s.Frame, s.State]
) -> None:
    """A facet or ball that is touched once tonight: 7 µm on it are a chip the first night, and a facet that moved the second."""
    followed, after = known
    ahead = s.predicted(after, 1.0)
    readings = read(cell, truth, 11, part=6)
    count = {f: readings.facet.count(f) for f in readings.facet}
    lone = next(i for i, f in enumerate(readings.facet) if count[f] == 1)
    position = readings.position.copy()
    facet = cell.artefact.facets[readings.facet[lone]]
    # Along the normal as the machine sees it: what a facet raised in the simulator does to the reading.
    raised = replace(truth, facets={**truth.facets, readings.facet[lone]: truth.facets.get(readings.facet[lone], 0.0) + 0.010})
    clean, moved = (read(cell, replace(w, noise=0.0), 11, part=6) for w in (truth, raised))
    position[lone] += (moved.position - clean.position)[lone]
    chipped = replace(readings, position=position)
    what, number = s.seen(followed, chipped, ahead.mean, 20.0), int(readings.touch[lone])
    assert s.judge(ahead, what).alarm() and not s.judge(ahead, what).outliers, facet  # it may be the facet as well
    first = s.judge(ahead, what, followed.points)
    assert first.outliers == (number,) and not first.alarm()
    second = s.judge(ahead, what, followed.points, again=(number,))
    assert second.alarm() and second.outliers == ()
    named = s.name_change(ahead, followed, second, s.hypotheses(followed, None))
    assert named is not None and named.hypothesis.parameter in (f"facet {readings.facet[lone]}", f"ball {facet.ball}")


def test_what_no_touch_of_tonight_sees_is_no_story(cell: Cell, truth: World, known: tuple[s.Frame, s.State]) -> None:
    followed, after = known
    readings = read(cell, replace(truth, errors={**truth.errors, "EX0C": truth.errors["EX0C"] + 0.004}), 12, part=12)
    tonight = s.judge(s.predicted(after, 1.0), s.seen(followed, readings, after.mean, 20.0))
    named = s.name_change(s.predicted(after, 1.0), followed, tonight, s.hypotheses(followed, None))
    touched = {f"facet {f}" for f in readings.facet}
    assert len(touched) < len(cell.artefact.facets) and named is not None
    assert not [n for n in (named.hypothesis.parameter, *named.instead) if n.startswith("facet") and n not in touched]


def test_a_ball_of_which_touches_without_weight_leave_next_to_nothing_has_not_moved_by_metres() -> None:
    ball = naming.Hypothesis("ball", "ball 2", np.eye(3), "mm", ("X", "Y", "Z"))
    pattern = np.diag([1400.0, 1e-4, 1400.0])  # standard deviations a mm
    seen = naming._seen(ball, pattern)
    assert seen is not None and seen[0].axes == ("X", "Z") and seen[1].shape == (3, 2)
    assert naming._seen(ball, 1e-7 * pattern) is None
    along = np.array([[1400.0, 1398.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 1400.0]])  # from one side: X and Y are one distance
    seen = naming._seen(ball, along)
    assert seen is not None and seen[0].axes == ("X", "Z")


@pytest.mark.long
def test_rates_are_learned_anew_after_so_many_nights_and_not_every_night(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cell, truth = read_cell(root / "examples" / "hu40t"), read_world(root / "examples" / "hu40t" / "world.yaml")
    few = replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations[::8]))
    monkeypatch.setattr(learning, "LEARNED_EVERY", 4)
    monkeypatch.setattr(learning, "LEARNED_FROM", 4)  # full from the fifth night on
    nothing = lambda followed, begin, nights, opened: rates.Learned(begin.rates, np.full(len(nights), np.nan))  # noqa: E731
    monkeypatch.setattr(learning, "learn", nothing)
    with opened("sqlite://") as history:
        records = [r for r, _ in nights(few, truth, history, 10, 0, Story(), Nightly(diagnose=False))]
    assert [i for i, r in enumerate(records, 1) if r["state"]["since_learned"] == 0 and i > 1] == [5, 9]
