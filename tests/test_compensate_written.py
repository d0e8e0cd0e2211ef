"""The cap looks at every number that is written, at those that a target calculates as well."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from support.compensated import ROOT, proposed, text

from tango_cnc.compensate import targets
from tango_cnc.compensate.proposal import Proposal, beyond, capped, changes
from tango_cnc.compensate.space import Held
from tango_cnc.compensate.targets import fanuc, siemens
from tango_cnc.files import read_cell
from tango_cnc.records import InputError, TangoError

NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]\d+)?")


def written(proposal: Proposal, places: dict[str, float]) -> dict[str, list[float]]:
    """Proposal, numbers by place → by file its numbers, in order."""
    files = proposal.module.files(proposal.request, proposal.held, {**proposal.present, **places})
    return {name: [float(text) for text in NUMBER.findall(content)] for name, content in files.items()}


def spoken(proposal: Proposal, places: dict[str, float]) -> list[float]:
    """Proposal, numbers by place → sizes of changes that the cap looks at: mm, deg, rad; increments where a file counts."""
    moved = replace(proposal, numbers={**proposal.present, **places})
    steps = {h.place: h.increment for h in proposal.held if h.counted}
    found = [(name, size) for name, size, _, over in changes(moved) if not over]
    sizes = [size for _, size in found]
    return [*sizes, *(math.radians(size) for size in sizes), *(size / steps[name] for name, size in found if name in steps)]


@pytest.mark.long
@pytest.mark.parametrize("target", targets.names())
def test_every_number_that_changes_in_a_file_is_one_that_the_cap_looks_at(target: str) -> None:
    """Held numbers are changed, each by a size of its own: what changes in the files changes by that, or is listed.

    Not asked: targets that refuse this machine; and ratios, which count by what they do.
    """
    try:
        base = proposed("hu40t", target)
    except InputError as error:
        assert "allowed:" in str(error)
        return
    r = np.random.default_rng(8)
    groups: dict[str, list[str]] = {}
    for h in base.held:
        if h.kind != "ratio":
            groups.setdefault(h.table, []).append(h.place)
    increments = {h.place: h.increment for h in base.held}
    places = {
        place: base.present[place] + (-1) ** (i // 2) * round(float(r.uniform(0.002, 0.02)) / increments[place]) * increments[place]
        for group in groups.values()
        for i, place in enumerate(group if len(group) < 9 else group[:2] + group[-1:])
    }
    before, after = written(base, {}), written(base, places)
    sizes = np.array(spoken(base, places))
    seen = 0
    for name, numbers in after.items():
        if len(numbers) != len(before[name]):  # lines that are there only where something changes
            continue
        for one, two in zip(before[name], numbers, strict=True):
            if abs(two - one) > 1e-3:
                seen += 1
                assert np.abs(sizes - abs(two - one)).min() < 2e-6, (name, one, two)
    assert seen >= 3


def test_a_file_that_counts_increments_has_a_whole_number() -> None:
    """As of a table in steps of half a micrometer; its number stays in mm, which the cap looks at."""
    plain = Held("row 1", "table", "mm", "length", 0.0005, lambda poses: np.zeros((len(poses), 3)))
    counted = replace(plain, counted=True)
    assert (plain.written(plain.number(0.0123)), counted.written(counted.number(0.0123))) == (0.0125, 25.0)
    assert counted.value(counted.written(0.0125) * counted.increment) == 0.0125


def test_a_vector_between_two_centers_is_derived_from_both() -> None:
    machine = read_cell(ROOT / "examples" / "hu40t").machine
    limits = {axis: (0.0, 1.0) for axis in (*machine.linear, *machine.rotary)}
    for module, name in ((siemens, "$TC_CARR55[1], I3 X"), (fanuc, "19703 (VECTOR AB X)")):
        request = targets.Request(machine, limits, targets.options(module, ()))
        held = module.held(request)
        before = {h.place: h.base for h in held}
        moved = {h.place: -0.04 if "B" in h.place else 0.04 for h in held if h.table == "centres" and "X" in h.place}
        after = before | {place: before[place] + far for place, far in moved.items()}
        change = module.derived(request, held, after)[name].value - module.derived(request, held, before)[name].value
        assert abs(change) == pytest.approx(0.08)


@pytest.mark.long
def test_a_vector_that_changes_more_than_its_centers_is_refused_by_its_name() -> None:
    """hu40t: each center moves by less than the cap, the vector between them by more."""
    proposal = proposed("hu40t", "siemens")
    centres = [abs(proposal.numbers[h.place] - proposal.present[h.place]) for h in proposal.held if h.table == "centres"]
    assert 0.09 < max(centres) < 0.1
    assert any(line.startswith("$TC_CARR55[1]=0.10") for line in proposal.files["kinematics.mpf"].splitlines())
    with pytest.raises(TangoError, match=r"\$TC_CARR55\[1\], I3 X: changes by 0.1045 mm; allowed: 0.1 mm"):
        capped(proposal, 0.1, 0.01)
    capped(proposal, 0.11, 0.01)
    said = beyond(proposed("hu40t", "fanuc"), 0.05, 0.01)
    assert any(text.startswith("19703 (VECTOR AB X): changes by 0.11") for text in said)


@pytest.mark.long
def test_that_tables_and_centers_belong_together_is_said() -> None:
    said = "Indexed work without it gets the tables alone"
    assert said in text(proposed("hu40t", "siemens")) and "read with B and C always" in text(proposed("hu40t", "siemens"))
    assert said not in text(proposed("hu40t", "fagor")) and said not in text(proposed("hu40t", "centroid"))


@pytest.mark.long
def test_a_reversal_value_counts_as_it_is_written() -> None:
    """MD32450 is the whole reversal value: twice what the model calls EXXb."""
    base = proposed("trunnion", "siemens")
    place = "MD32450 $MA_BACKLASH[0] of X"
    moved = replace(base, numbers={**base.present, place: base.present[place] + 0.06})
    assert beyond(moved, 0.05, 0.01) == [f"{place}: changes by 0.06 mm; allowed: 0.05 mm"]
