"""The chain of axes in `topology` is another: two neighbours exchanged, or a rotary axis on the other side of the foundation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from ...records import Machine
from ...texts import say
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
                    found.append((*pair, say("mistake.chain_order.change_places", branch=branch[i], branch2=branch[j])))
    for name in machine.rotary:
        if name in work:
            rest = [n for n in work if n != name]
            found += [
                (rest, [*tool[:k], name, *tool[k:]], say("mistake.chain_order.carries_tool", name=name))
                for k in range(len(tool) + 1)
            ]
        else:
            rest = [n for n in tool if n != name]
            found += [
                ([*work[:k], name, *work[k:]], rest, say("mistake.chain_order.carries_workpiece", name=name))
                for k in range(len(work) + 1)
            ]
    for workpiece, towards, what in found:
        topology = f"w{''.join(reversed(workpiece))}f{''.join(towards)}(S)t"
        yield Hypothesis(
            say("mistake.chain_order.readings_fit_chain", topology=topology, what=what),
            "machine",
            "topology",
            say("mistake.chain_order.write", topology=topology),
            machine=_chained(machine, tuple(workpiece), (*towards, "S"), topology),
            price=1.0,
        )


def _chained(machine: Machine, workpiece: tuple[str, ...], tool: tuple[str, ...], topology: str) -> Machine:
    return replace(machine, workpiece_branch=workpiece, tool_branch=tool, topology=topology)
