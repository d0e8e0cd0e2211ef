"""Machines drawn at random, measured with scatter, compensated: what was promised is what the true machine has left."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest
from support.closing import EXAMPLES, SETTINGS
from support.compensated import example, first, measured, truth, write

from sim_controller.compensation import read
from tango_cnc.compensate import propose, targets
from tango_cnc.records import Cell, InputError, World

MACHINES = 200


def drawn(cell: Cell, world: World, seed: int) -> World:
    """A true machine with errors of the size of this one's; calibrated facets differ from their certificate as it states."""
    rng = np.random.default_rng([23, seed])
    errors = {name: value * rng.normal() for name, value in world.errors.items()}
    certified = {name: facet.uncertainty for name, facet in cell.artefact.facets.items() if facet.uncertainty is not None}
    facets = {name: world.facets.get(name, 0.0) + std * rng.normal() for name, std in certified.items()}
    return replace(world, errors=errors, facets={**world.facets, **facets}, seed=seed)


def kept(name: str, target: str, seeds: range, folder: Path) -> tuple[int, list[float]]:
    """Example, target, seeds → promises kept, µm left of every machine; one with more error than the target takes is none."""
    cell, world = example(name)
    within, left = 0, []
    for seed in seeds:
        true = drawn(cell, world, seed)
        proposal = propose(measured(cell, true), target, SETTINGS.get(target, ()))
        try:
            control = read(write(proposal, folder / f"{name}{target}{seed}"), cell.machine)
        except InputError as error:
            assert "beyond MAX OFFSET" in str(error)
            continue
        after, promise = truth(cell, true, proposal, control), proposal.fit.rms_after
        within += promise.low <= after <= promise.high
        left.append(after)
    return within, left


@pytest.mark.campaign
def test_promises_are_kept(tmp_path: Path) -> None:
    within, left = kept("trunnion", "siemens", range(10), tmp_path)
    print(f"trunnion, siemens: {within} of 10 within the promise, {np.mean(left):.2f} µm left")
    assert within >= 8


@pytest.mark.campaign
@pytest.mark.parametrize("target", targets.names())
@pytest.mark.parametrize("name", EXAMPLES)
def test_two_hundred_promises_are_kept(name: str, target: str, tmp_path: Path) -> None:
    """What was promised lies within its interval on 95 % of the machines: the count of 200 does not contradict it.

    Of many pairs that keep their promise in exactly 95 %, one in forty fails here by chance.
    """
    try:
        propose(first(name), target, SETTINGS.get(target, ()))
    except InputError as error:
        assert "allowed:" in str(error)
        pytest.skip(f"{name}, {target}: refused: {error}")
    within, left = kept(name, target, range(MACHINES), tmp_path)
    assert len(left) > 0.8 * MACHINES
    share = binomtest(within, len(left)).proportion_ci(0.95, method="wilson")
    said = f"{name}, {target}: {within} of {len(left)} within the promise, 95 % Wilson interval {share.low:.3f} to {share.high:.3f}"
    print(f"{said}; {np.mean(left):.2f} µm left on average")
    assert share.high >= 0.95, said
