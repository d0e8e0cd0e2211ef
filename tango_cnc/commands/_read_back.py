"""What the files of a proposal take away, read back by the reader of their control: a promise is of the files, not of numbers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..compensate.space import Poses
from ..compensate.targets import Request
from ..records import Array, InputError, World

SIGNS = "sign"  # options that begin so are of a control whose sign a trial has found to be another one than the reader's
FARTHEST = 1.0  # mm: numbers that move the tip farther are counted from another zero than that of machine.yaml


def taken(
    target: str, defaults: Mapping[str, object], request: Request, files: Mapping[str, str], undo: Mapping[str, str], at: Poses
) -> Array | None:
    """target, {option: its default}, its job, files and those of before, poses → (3n,) mm of error that the files take away more.

    None where no reader is of such a control: another sign than the sources have, another number of its kinematics, or centers
    counted from another zero. Raises InputError where the control would refuse files of the usual settings.
    """
    from sim_controller.compensation import targets

    others = [name for name, value in request.options.items() if value != defaults[name]]
    if target not in targets() or any(name.startswith(SIGNS) for name in others):
        return None
    try:
        new, old = (_moved(target, texts, at) for texts in (files, undo))
    except InputError:
        if others:
            return None
        raise
    if max(np.abs(new).max(), np.abs(old).max()) > FARTHEST:
        return None
    return old - new


def _moved(target: str, texts: Mapping[str, str], at: Poses) -> Array:
    """target, {name: text}, poses → (3n,) mm by which a control with these files moves the tip of the nominal machine."""
    from sim_controller.compensation import read
    from sim_controller.world import tip_in_table, true_machine

    position, direction = at.touches.position, at.touches.direction
    with TemporaryDirectory() as name:
        for file, text in texts.items():
            Path(name, file).write_text(text, encoding="utf-8", newline="")
        Path(name, "compensation.json").write_text(json.dumps({"target": target}), encoding="utf-8")
        machine = true_machine(at.machine, World(), read(Path(name), at.machine))
        return np.asarray((tip_in_table(machine, position, direction) - at.nominal).ravel())
