"""The chain of axes in `topology` is another: two neighbours exchanged, or a rotary axis on the other side of the foundation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from ...records import Machine
from ._case import Case, Hypothesis


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → every chain that differs by one exchange or one rotary axis moved across."""
    machine = case.machine
    work, tool = list(machine.workpiece_branch), list(machine.tool_branch[:-1])
    found: list[tuple[list[str], list[str], str]] = []
    for branch in (work, tool):
        for i in range(len(branch) - 1):
            for j in range(i + 1, len(branch)):
                if branch[i] in machine.rotary or branch[j] in machine.rotary:
                    other = list(branch)
                    other[i], other[j] = other[j], other[i]
                    pair = (other, tool) if branch is work else (work, other)
                    found.append((*pair, f"{branch[i]} and {branch[j]} change places"))
    for name in machine.rotary:
        if name in work:
            rest = [n for n in work if n != name]
            found += [(rest, [*tool[:k], name, *tool[k:]], f"{name} carries the tool") for k in range(len(tool) + 1)]
        else:
            rest = [n for n in tool if n != name]
            found += [([*work[:k], name, *work[k:]], rest, f"{name} carries the workpiece") for k in range(len(work) + 1)]
    for workpiece, towards, what in found:
        topology = f"w{''.join(reversed(workpiece))}f{''.join(towards)}(S)t"
        yield Hypothesis(
            f"the readings fit if the chain is {topology}: {what}",
            "machine",
            "topology",
            f"write {topology}",
            machine=_chained(machine, tuple(workpiece), (*towards, "S"), topology),
            price=1.0,
        )


def _chained(machine: Machine, workpiece: tuple[str, ...], tool: tuple[str, ...], topology: str) -> Machine:
    return replace(machine, workpiece_branch=workpiece, tool_branch=tool, topology=topology)
