"""What a target cannot hold leaves its tables alone: a fit over chance poses would write waves and reversals that nobody has."""

from __future__ import annotations

import numpy as np
import pytest
from support.compensated import first

from tango_cnc.compensate import targets
from tango_cnc.compensate.fit import NONE, holding, known
from tango_cnc.compensate.space import limits_of, sample
from tango_cnc.compensate.targets import Request

NOTHING = 0.3  # µm in a table, of an error of 10 µm rms that the target does not hold


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["trunnion", "hu40t", "fork_head"])
def test_a_target_writes_nothing_for_what_it_cannot_hold(name: str) -> None:
    result = first(name)
    machine = result.model.touches.machine
    at = sample(machine, limits_of(machine, result.model.touches, "probed", {}))
    found, module = known(result, at), targets.load("linuxcnc")
    held = module.held(
        Request(machine, limits_of(machine, result.model.touches, "probed", {}), targets.options(module, ()), found.coefficients)
    )
    best = holding(found, held, at)
    effect = np.sqrt(np.mean(np.sum(best.levers.reshape(len(at), 3, -1) ** 2, axis=1), axis=0))  # (p,) mm rms
    left = np.linalg.norm(best.levers - best.taken, axis=0) / np.maximum(np.linalg.norm(best.levers, axis=0), 1e-12)
    seen = set()
    for k, c in enumerate(found.coefficients):
        if effect[k] < 1e-9:  # a set-up takes it out
            continue
        per = 0.010 / effect[k]
        tables: dict[tuple[str, float], list[float]] = {}
        for h, number in zip(held, best.best[:, k], strict=True):
            if h.kind == "length" and h.at is not None:
                tables.setdefault((h.table, round(h.at, 9)), []).append(1e3 * float(number) * per)
        if 1 - left[k] < NONE:
            seen.add(c.name)
            assert max(abs(v) for both in tables.values() for v in both) < NOTHING, c.name
        if not c.name.endswith("b"):  # no reversal: both directions of motion get the same
            assert max(np.ptp(both) for both in tables.values()) < NOTHING, c.name
    assert len(seen) >= 2
