"""Machines drawn at random, measured with scatter, compensated: what was promised is what the true machine has left."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from support.closing import EXAMPLES, SETTINGS
from support.compensated import drawn, example, first, measured, truth, write
from support.few import every

from sim_controller.compensation import read
from tango_cnc.compensate import Proposal, propose, targets
from tango_cnc.compensate.fit import Holding, holding, known
from tango_cnc.compensate.promise import Figure, likely, mean
from tango_cnc.compensate.space import sample
from tango_cnc.estimate import Estimate
from tango_cnc.records import InputError

MACHINES = int(os.environ.get("TANGO_MACHINES") or "200")
FIRST = int(os.environ.get("TANGO_SEED") or "0")


@cache
def prepared(name: str, target: str) -> tuple[Proposal, Holding]:
    """Example, target → its proposal without scatter, and all that does not depend on how large errors are found."""
    found = first(name)
    proposal = propose(found, target, SETTINGS.get(target, ()))
    at = sample(example(name)[0].machine, proposal.request.limits)
    return proposal, holding(known(found, at), proposal.held, at)


def promised(name: str, target: str, found: Estimate) -> tuple[Proposal, Figure]:
    """Example, target, estimate → what `propose` makes of it, a good deal faster; its promise."""
    proposal, holds = prepared(name, target)
    learned = known(found, holds.poses)
    now = {h.place: h.base for h in holds.held}
    exact, change = holds.numbers(learned, now)
    numbers = {h.place: h.number(h.value(now[h.place]) + float(c)) for h, c in zip(holds.held, change, strict=True)}
    return replace(proposal, numbers=numbers), mean(holds.left(learned, exact - change))


def kept(name: str, wanted: Sequence[str], seeds: Iterable[int], folder: Path) -> dict[str, Counter[str]]:
    """Example, targets, seeds → by target: promises kept, less left, more left; refused: more error than the target takes.

    Each machine is measured once, for all targets.
    """
    cell, world = example(name)
    counts: dict[str, Counter[str]] = {target: Counter() for target in wanted}
    for seed in seeds:
        true = drawn(cell, world, seed)
        found = measured(cell, true)
        for target, count in counts.items():
            proposal, promise = promised(name, target, found)
            try:
                control = read(write(proposal, folder / f"{name}{target}"), cell.machine)
            except InputError as error:
                assert "beyond MAX OFFSET" in str(error)
                count["refused"] += 1
                continue
            after = truth(cell, true, proposal, control)
            count["kept" if promise.low <= after <= promise.high else "less" if after < promise.low else "more"] += 1
    return counts


def fitting(name: str) -> list[str]:
    """Example → the targets that fit its machine."""
    result = []
    for target in targets.names():
        try:
            prepared(name, target)
        except InputError as error:
            assert "allowed:" in str(error)
        else:
            result.append(target)
    return result


@pytest.mark.long
@pytest.mark.parametrize("scatters", every([1.5, 2.5, 4.0, 8.0], 4, first=1))
def test_one_direction_that_stays_is_not_drawn_to_zero(scatters: float) -> None:
    """An error of some scatters that a control leaves: however it was measured, more than promised is left once in forty times."""
    levers = np.ones((60, 1))
    measured_as = [scatters + NormalDist().inv_cdf((i + 0.5) / 200) for i in range(200)]
    ends = [mean(likely(np.array([value]), np.eye(1), levers, levers)).high for value in measured_as]
    assert sum(3**0.5 * 1e3 * scatters > high for high in ends) <= 6


def test_a_scatter_that_was_estimated_from_few_touches_widens_the_promise() -> None:
    """Scatter alone is left, in two directions; an interval for a scatter of 1 is as many times as wide as it was estimated."""
    levers, freedom = np.tile(np.eye(3, 2), (40, 1)), 10
    rng = np.random.default_rng(230)
    found = np.sqrt(rng.chisquare(freedom, 20000) / freedom)
    left = 1e3 * np.sqrt(np.sum(rng.normal(size=(20000, 2)) ** 2, axis=1))
    share = {}
    for told in (None, freedom):
        one = mean(likely(np.zeros(2), np.eye(2), levers, np.zeros_like(levers), freedom=told))
        share[told] = float(np.mean((one.low * found <= left) & (left <= one.high * found)))
    assert share[None] < 0.93
    assert 0.94 < share[freedom] < 0.965


@pytest.mark.long
def test_the_faster_way_promises_what_propose_does() -> None:
    cell, world = example("trunnion")
    found = measured(cell, drawn(cell, world, 1))
    for target in ("etalon", "fagor"):
        fast, promise = promised("trunnion", target, found)
        slow = propose(found, target)
        said = slow.fit.rms_after
        # Each way draws 1000 along eigenvectors of its own: their medians differ by 0.056 of the spread, thrice that once in 400.
        spread = (said.high - said.low) / 3.92
        assert promise.value == pytest.approx(said.value, abs=3 * 1.25 * spread * (2 / 1000) ** 0.5)
        # Its ends are quantiles of which 25 of 1000 draws lie beyond, and each way draws along eigenvectors of its own.
        assert (promise.low, promise.high) == pytest.approx((said.low, said.high), rel=0.06)
        # A table begins and ends where the touches did, which is some µm elsewhere on each machine.
        pairs = zip(fast.numbers.values(), slow.numbers.values(), strict=True)
        assert max(abs(one - other) for one, other in pairs) < 1e-4


@pytest.mark.long
def test_promises_are_kept(tmp_path: Path) -> None:
    counts = kept("trunnion", ("siemens", "etalon"), range(12), tmp_path)
    print(counts)
    assert all(count["kept"] >= 10 for count in counts.values())


@pytest.mark.campaign
@pytest.mark.parametrize("name", EXAMPLES)
def test_two_hundred_promises_are_kept(name: str, tmp_path: Path) -> None:
    """What was promised lies within its interval on 95 % of the machines: no count of 200 contradicts it.

    Of many pairs that keep their promise in exactly 95 %, one in forty fails here by chance.
    """
    low = []
    for target, count in kept(name, fitting(name), range(FIRST, FIRST + MACHINES), tmp_path).items():
        n = count["kept"] + count["less"] + count["more"]
        assert n > 0.8 * MACHINES
        from scipy.stats import binomtest  # slow to load, and every worker reads this file

        share = binomtest(count["kept"], n).proportion_ci(0.95, method="wilson")
        said = f"{name}, {target}: {count['kept']} of {n} kept, {count['less']} less, {count['more']} more, to {share.high:.3f}"
        print(said)
        low += [said] if share.high < 0.95 else []
    assert not low
