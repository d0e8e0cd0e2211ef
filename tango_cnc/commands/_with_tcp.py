"""Whether the answer about tool center point control (`--tcp`, `--no-tcp`) is proven: by the readings, or by their record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..compensate import loop
from ..compensate.contradicted import contradicted
from ..compensate.either import CERTAIN, likelier
from ..compensate.proposal import Proposal
from ..estimate import Estimate, estimate
from ..files import read_readings, read_terms
from ..files.origin import current
from ..noise import honest
from ..program.tcp_off import switched_off
from ..records import Cell, InputError, TangoError
from ._present import days_between, ended
from ._short_check import as_then


def as_answered(cell: Cell, result: Estimate, proposal: Proposal, last: Mapping[str, Any], options: dict[str, Any]) -> bool:
    """cell, estimate, proposal, record of what is in the control (empty: a file has it), options → whether the answer is proven;
    True where none counts.

    Raises InputError where the readings, or their record, contradict what is stated of them.
    """
    kept, tcp, readings = loop.Kept(0, options["present"], dict(last)), options["tcp"], current(cell.folder, options["file"])
    off = tcp is not None and any(h.tcp for h in proposal.held) and switched_off(cell, readings)
    if off and tcp:
        raise InputError(
            f"--tcp: found {readings}, which 'tango run' measured with a program that switches tool center point control off. "
            "Allowed: --no-tcp; --despite where that program was changed, and it was on"
        )
    if not last:  # numbers of a file: no run that they were made from is on record
        return off or tcp is None
    odds = None
    if tcp is not None and (first := _full_run(cell, kept, options)) is not None:
        days = days_between(kept, ended(readings))
        odds = likelier(kept, first, result, proposal.held, tcp=tcp, days=days)
    if why := contradicted(kept, result, proposal.held, tcp=tcp is not False, odds=CERTAIN if off else odds):
        raise InputError(f"--readings: found {readings}: {why}; --despite where the machine is really so")
    return off or tcp is None or (odds is not None and odds >= CERTAIN)


def _full_run(cell: Cell, kept: loop.Kept, options: Mapping[str, Any]) -> Estimate | None:
    """cell, compensation, options → estimate of the run that it was made from; None where that is not on record, or where what
    errors are counted from has changed since."""
    if "made_from" not in kept.record:
        return None
    terms = cell.terms if options["terms"] is None else read_terms(options["terms"], cell.folder)
    try:
        then = as_then(cell, kept)
        readings = read_readings(kept.folder / loop.MADE_FROM, then.machine, then.artefact)
        return honest(estimate(then.machine, then.artefact, readings, terms, options["degree"]))
    except TangoError:
        return None
