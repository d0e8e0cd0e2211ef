"""A compensation made from a full run of a simulated machine, and the short check that is to judge it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from sim_controller.compensation import read
from sim_controller.simulate import simulate
from sim_controller.world import Control
from support.closing import SETTINGS
from support.compensated import drawn, example, write
from tango_cnc.commands.check import positioning_feed
from tango_cnc.commands.design import gate_of
from tango_cnc.compensate import Proposal, loop, propose
from tango_cnc.compensate.loads import files_of
from tango_cnc.compensate.look import Look, look
from tango_cnc.compensate.outcome import Outcome
from tango_cnc.compensate.shares import Before
from tango_cnc.compensate.short import Short, short_outcome
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.noise import honest
from tango_cnc.records import Cell, World
from tango_cnc.touches import from_readings


@cache
def before(name: str, seed: int) -> tuple[Cell, World, Estimate]:
    """Example, seed → cell, a true machine with errors of its size (below 0: that of the example), estimate with scatter."""
    cell, world = example(name)
    true = world if seed < 0 else drawn(cell, world, seed)
    readings = simulate(cell.machine, cell.artefact, cell.strategy, true, seed=1000 + seed)
    return cell, true, honest(estimate(cell.machine, cell.artefact, readings, cell.terms))


@dataclass(frozen=True)
class Loaded:
    """A compensation that a check is to judge, the check, and where files are written."""

    cell: Cell
    true: World
    proposal: Proposal
    asked: Short
    look: Look
    folder: Path

    def control(self, numbers: dict[str, float], name: str) -> Control:
        """Numbers by place → what a control with them does."""
        made = replace(self.proposal, numbers=numbers)
        return read(write(made, self.folder / name), self.cell.machine, tcp=self.asked.tcp)

    def without(self, tables: set[str], name: str) -> Control:
        """Tables or single places that are not loaded → the control with all others."""
        held, p = self.proposal.held, self.proposal
        return self.control({h.place: (p.present if {h.table, h.place} & tables else p.numbers)[h.place] for h in held}, name)

    def judged(self, control: Control | None, seed: int, world: World | None = None) -> Outcome:
        """What the control has, seed, the machine if it is another one by now → what the check says."""
        cell = self.cell
        few = simulate(cell.machine, cell.artefact, self.look.cell.strategy, world or self.true, seed=seed, control=control)
        return short_outcome(self.asked, from_readings(cell.machine, cell.artefact, few))


def loaded(name: str, target: str, seed: int, folder: Path, *, tcp: bool, minutes: float | None = None) -> Loaded:
    """Example, target, seed, folder, minutes at most → a compensation made from a full run, and its short check."""
    cell, true, result = before(name, seed)
    proposal = propose(result, target, SETTINGS.get(target, ()))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "tango.yaml").write_text("tango: 1\n")
    kept = loop.store(folder, proposal, "2026-01-01T00:00:00Z")
    files = files_of(proposal.module, proposal.request, proposal.held, proposal.present, proposal.numbers)
    asked = Short(kept, Before(result, 1.0), proposal.held, tcp, False, files)
    chosen = look(asked, cell, proposal.fit.rms_before, positioning_feed(cell), gate_of(cell), minutes)
    return Loaded(cell, true, proposal, asked, chosen, folder)
