"""One word for a plan: program, journal and readings carry it, so that nobody judges readings by another plan."""

from __future__ import annotations

import hashlib

from ..records import Plan

LENGTH = 12  # hexadecimal digits: chance agreement of two plans in 2.8e14


def plan_hash(plan: Plan) -> str:
    """plan → 12 hexadecimal digits (upper case) of the sha256 over everything that decides motion and judgement.

    Positions count to 1e-6 mm and 1e-9 rad, what rounding leaves alone.
    """
    digest = hashlib.sha256()
    machine, approach = plan.machine, plan.strategy.approach
    digest.update(f"tango-plan/1 {machine.topology} {' '.join(machine.names)}\n".encode())
    digest.update(f"{machine.probe.length:.6f} {machine.probe.tip_radius:.6f}\n".encode())
    digest.update(f"{approach.standoff:.6f} {approach.search:.6f} {approach.feed:.6f}\n".encode())
    if approach.find is not None:
        digest.update(f"{approach.find.feed:.6f} {approach.find.retreat:.6f}\n".encode())
    decimals = [6 if axis.kind == "linear" else 9 for axis in machine.axes]
    for touch in plan.touches:
        values = (f"{v + 0.0:.{d}f}" for p in (touch.standoff, touch.contact, touch.end) for v, d in zip(p, decimals, strict=True))
        digest.update(f"{touch.number} {touch.facet} {' '.join(values)}\n".encode())
    if plan.only is not None:
        ends = " ".join(f"{name}{value + 0.0:.6f}" for name, value in plan.only.target.items())
        digest.update(f"only {plan.only.kind} {ends}\n".encode())
    return digest.hexdigest()[:LENGTH].upper()
