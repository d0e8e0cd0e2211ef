"""A learned shape and parameters of the machine that share what these touches see: how much is whose, nobody measured."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..estimate import Estimate
from ..texts import say
from .data import Remark

MOVED = 2.0  # standard deviations by which a parameter may move when the shape is taken out of the terms


def learned(result: Estimate) -> Iterator[Remark]:
    """estimate → a remark for every learned shape without which parameters of the machine would be others.

    A shape was found in touches of this machine, beside its parameters: what both could make went to either by the prior of the
    smooth functions alone, so that a shape holds slopes and products which may be the machine's. To first order a parameter
    moves by the part of the shape's column that its own makes up for (Frisch & Waugh 1933).
    """
    model = result.model
    shapes = [i for i, c in enumerate(model.coefficients) if c.name.startswith("learned[")]
    if not shapes:
        return
    rest = np.setdiff1d(np.arange(result.jacobian.shape[1]), shapes)
    used = np.where(result.unused, 0.0, 1.0)
    weighted = result.jacobian * np.concatenate([used, result.known_weights])[:, None]
    std = result.std
    for i in shapes:
        moved = np.linalg.lstsq(weighted[:, rest], weighted[:, i] * result.values[i], rcond=1e-12)[0]
        names = [
            (abs(float(by)) / float(std[j]), model.coefficients[j].name)
            for j, by in zip(rest, moved, strict=True)
            if j < len(model.coefficients) and std[j] > 0 and abs(by) > MOVED * std[j]
        ]
        if names:
            ordered = [name for _, name in sorted(names, reverse=True)]
            name = model.coefficients[i].name.removeprefix("learned[").removesuffix("]")
            text = say("plausible.learned.shares", name=name, names=", ".join(ordered))
            yield Remark("trustworthy", text, moves=tuple(ordered))
