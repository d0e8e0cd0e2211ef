"""A cell, a model of its machine → what a kept compensation takes away and probing programs do not see."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..compensate import loop, targets
from ..compensate.hidden import of_record, unseen
from ..compensate.space import Poses
from ..iso230.poses import at_poses
from ..model import Model
from ..nightly.control import Given, InControl
from ..records import Array
from ..report.days import local_day
from ..state.volume import LEVELS
from ..verify.volume import grid, set_up, setup_lever
from . import _compensate

CALCULATED = "by calculation"  # in the text of an outcome without `tcp`: the run was made without tool center point control


def in_control(folder: Path, model: Model, lever: Callable[[], Array]) -> InControl | None:
    """cell, model of its machine, function → (m, 3, p) what unknowns do at the corners of what is touched → what parts do not have.

    None where no compensation is in the control, or where the runs see all of it: it was kept after one with tool center point
    control. Nothing is taken off for one that is only noted as written, or whose measurement was undecided, not as promised or
    no help: nobody knows that it acts. Where it was made on top of one that was kept, that one counts until then: the control
    has at least its numbers. After no help even that is not known.
    """
    kept = loop.in_control(folder)
    if kept is not None and loop.state(folder, kept.number) != "no help":
        kept = _proven(folder) or kept
    state = "" if kept is None else loop.state(folder, kept.number)
    if kept is None or state not in loop.IN_CONTROL:
        return None
    event = next(e for e in reversed(loop.history(folder)) if e["compensation"] == kept.number and e["event"] == state)
    if state == "kept" and event.get("tcp", CALCULATED not in event.get("text", "")):
        return None
    machine = model.touches.machine
    module = targets.load(kept.record["target"])
    limits = _compensate.volume_of(_compensate.volume_text(kept.record), machine)
    options = targets.options(module, _compensate.settings_of(kept.record))
    held = module.held(targets.Request(machine, limits, options, model.coefficients))
    present = of_record(kept.record)
    sizes = unseen(held, present.numbers, present.before(held))
    if not sizes.any():
        return None
    day = local_day(event["utc"])
    if state != "kept":
        return InControl(kept.number, kept.record["target"], day, np.zeros(lever().shape[2]), state)
    position = grid(machine, model.touches, LEVELS, "probed")
    poses = Poses(at_poses(machine, position, np.zeros_like(position)))
    moved = sum((h.lever(poses) * v for h, v in zip(held, sizes, strict=True) if v), np.zeros((len(poses), 3)))
    free = set_up(moved[:, :, None], setup_lever(poses.touches, poses.nominal), np.ones(len(poses), dtype=np.bool_))
    flat = lever()
    gone = np.linalg.lstsq(flat.reshape(-1, flat.shape[2]), free.reshape(-1), rcond=1e-9)[0]
    return InControl(kept.number, kept.record["target"], day, np.asarray(gone, dtype=np.float64))


def given(folder: Path) -> tuple[Given, ...]:
    """cell → moments at which its control got another compensation, or lost one, oldest first."""
    events = [e for e in loop.history(folder) if e["event"] in ("written", "rolled back")]
    return tuple(
        Given(e["utc"], local_day(e["utc"]), e["compensation"], e["target"], taken_out=e["event"] == "rolled back") for e in events
    )


def _proven(folder: Path) -> loop.Kept | None:
    """cell → the last compensation that was kept, of the target that is in the control; None where nothing was."""
    last = loop.in_control(folder)
    same = [k for k in loop.found(folder) if last is not None and k.record["target"] == last.record["target"]]
    return next((k for k in reversed(same) if loop.state(folder, k.number) == "kept"), None)
