"""The kinematics description of a HEIDENHAIN: entries that move one rotary axis move nothing that comes after it."""

from __future__ import annotations

from collections import Counter

import pytest
from support.compensated import proposed


def standing(text: str) -> dict[str, Counter[str]]:
    """kinematics.txt → for every axis the entries that are in force where it stands, summed."""
    sums: Counter[str] = Counter()
    found = {}
    for line in text.splitlines():
        match line.split():
            case ["Trans", letter, value]:
                sums[letter] += float(value)  # type: ignore[assignment]
            case ["MachAxis", axis]:
                found[axis] = Counter({letter: v for letter, v in sums.items() if abs(v) > 1e-12})
    return found


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["trunnion", *(pytest.param(other, marks=pytest.mark.long) for other in ("fork_head", "split"))])
def test_linear_axes_stand_where_they_stood(name: str) -> None:
    proposal = proposed(name, "heidenhain")
    machine = proposal.request.machine
    found = standing(proposal.files["kinematics.txt"])
    assert set(found) == {*machine.linear, *machine.rotary}
    assert not any(found[axis] for axis in machine.linear)
    assert all(found[axis] for axis in machine.rotary)
    tool = [axis for axis in reversed(machine.tool_branch) if axis in found]
    assert list(found) == [*tool, *machine.workpiece_branch]
