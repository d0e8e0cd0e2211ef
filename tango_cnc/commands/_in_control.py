"""A cell, a model of its machine → what a kept compensation takes away and probing programs do not see."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..compensate import loop, targets
from ..compensate.hidden import of_record, unseen
from ..compensate.space import Held, Poses
from ..iso230.poses import at_poses
from ..loaded import BACK, HELPS, changes
from ..model import Model
from ..nightly.control import Given, InControl
from ..records import Array
from ..report.days import local_day
from ..state.volume import LEVELS
from ..verify.volume import grid, set_up, setup_lever
from . import _compensate

CALCULATED = "by calculation"  # in the text of an outcome without `tcp`: the run was made without tool center point control


def in_control(folder: Path, model: Model, lever: Callable[[], Array], until: str = "") -> InControl | None:
    """cell, model of its machine, function → (m, 3, p) what unknowns do at the corners of what is touched → what parts do not have.

    `until` (UTC): of a night of the past counts what the control held then.

    None where no compensation is in the control, or where the runs see all of it: it was kept after one with tool center point
    control. Nothing is taken off for one that is only noted as written, or whose measurement was undecided, not as promised or
    no help: nobody knows that it acts. What it was made on top of, and was kept, is taken off until then: the control has at
    least its numbers. After no help even that is not known.
    """
    there = loop.holding(folder, until)
    if there is None:
        return None
    kept = {k.number: k for k in loop.found(folder)}
    seen = _seen(folder, there.proven, until)
    if there.measured and seen:
        return None
    hidden = _Hidden.of(kept[there.number], model)
    if not hidden.sizes.any():
        return None
    gone = np.zeros(lever().shape[2])
    proven = None if there.proven is None or seen else there.proven
    if proven is not None:
        gone = _Hidden.of(kept[proven], model).gone(lever())
    beneath = proven if proven != there.number else None
    return InControl(there.number, there.target, local_day(there.utc), gone, there.event, beneath)


@dataclass(frozen=True)
class _Hidden:
    """What a compensation holds in the kinematics of a control, which probing programs do not see."""

    model: Model
    held: Sequence[Held]
    sizes: Array  # (h,) mm rad

    @classmethod
    def of(cls, kept: loop.Kept, model: Model) -> _Hidden:
        """compensation, model of the machine → what it holds."""
        machine = model.touches.machine
        module = targets.load(kept.record["target"])
        limits = _compensate.volume_of(_compensate.volume_text(kept.record), machine)
        options = targets.options(module, _compensate.settings_of(kept.record))
        held = module.held(targets.Request(machine, limits, options, model.coefficients))
        present = of_record(kept.record)
        return cls(model, held, unseen(held, present.numbers, present.before(held)))

    def gone(self, flat: Array) -> Array:
        """(m, 3, p) what unknowns do at the corners of what is touched → (p,) of every unknown, what parts do not have."""
        touches = self.model.touches
        position = grid(touches.machine, touches, LEVELS, "probed")
        poses = Poses(at_poses(touches.machine, position, np.zeros_like(position)))
        moved = sum((h.lever(poses) * v for h, v in zip(self.held, self.sizes, strict=True) if v), np.zeros((len(poses), 3)))
        free = set_up(moved[:, :, None], setup_lever(poses.touches, poses.nominal), np.ones(len(poses), dtype=np.bool_))
        found = np.linalg.lstsq(flat.reshape(-1, flat.shape[2]), free.reshape(-1), rcond=1e-9)[0]
        return np.asarray(found, dtype=np.float64)


def _seen(folder: Path, number: int | None, until: str) -> bool:
    """cell, compensation that was kept, moment → whether the runs see all of it: it was measured with tool center point control."""
    event = next((e for e in reversed(loop.history(folder, until)) if e["compensation"] == number and e["event"] in HELPS), None)
    return event is not None and bool(event.get("tcp", CALCULATED not in event.get("text", "")))


def given(folder: Path, until: str = "") -> tuple[Given, ...]:
    """cell, before which moment (UTC; '': any) → when its control got another compensation, or lost one, oldest first."""
    events = changes(loop.happened(folder, until))
    return tuple(Given(e.utc, local_day(e.utc), e.number, e.target, taken_out=e.event == BACK) for e in events)
