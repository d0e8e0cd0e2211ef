"""Readings that contradict what is stated of them: only with another state of the control they are as promised."""

from __future__ import annotations

from collections.abc import Sequence

from ..estimate import Estimate
from .either import CERTAIN
from .loop import Kept
from .outcome import promises, ran
from .promise import Figure
from .space import Held

FAR_LESS = 0.5  # of what is left as it was stated: a machine that has changed leaves so little the other way only by chance


def contradicted(kept: Kept, result: Estimate, held: Sequence[Held], *, tcp: bool, odds: float | None = None) -> str:
    """compensation in the control, estimate of readings made with it, what its target holds → what the readings say instead.

    `odds`: ln how much likelier the answer about tool center point control is than the other one, by what the machine would have
    changed; None: not known. '' where they agree with the promise, and where nothing else does: then the machine itself may have
    changed.
    """
    promised = promises(kept.record)[1]
    run = ran(kept, result, held, tcp=tcp)
    left = run.left()
    was, meant = ("off", "--no-tcp") if tcp else ("on", "--tcp")
    if odds is not None and odds <= -CERTAIN:
        other = ran(kept, result, held, tcp=not tcp).left()
        return (
            f"made with tool center point control {'on' if tcp else 'off'}, they leave {_size(left)} µm; made with it {was}, they "
            f"leave {_size(other)}, and the machine has changed by less since {kept.folder.name} was made, or in fewer places. "
            f"That is at least a thousand times likelier. Find out how they were made; allowed: {meant} when it was {was}"
        )
    if left.low <= promised.high:
        return ""
    stated = f"they leave {_size(left)} µm, and no more than {promised.high:.2f} were promised"
    other = ran(kept, result, held, tcp=not tcp).left() if any(h.tcp for h in held) else left
    stated_tcp = f"made with tool center point control {'on' if tcp else 'off'}, {stated}; made with it {was}, they leave"
    if odds is None and other.low <= promised.high:
        return f"{stated_tcp} {_size(other)}, as promised. Find out how they were made; allowed: {meant} when it was {was}"
    without = run.left(loaded=False)
    if without.low <= promised.high:
        return (
            f"made with {kept.folder} in the control, {stated}; made without it, it would leave {_size(without)}, as promised. "
            "What it takes away would be taken away twice; allowed: readings made with it. When it is not in the control any "
            "more, note that (--rolled-back), and give what is there"
        )
    if odds is None and other.high < FAR_LESS * left.low:
        return (
            f"{stated_tcp} {_size(other)}, far less. So the machine has changed, and it was most likely {was}. Find out how they "
            f"were made; allowed: {meant} when it was {was}"
        )
    return ""


def _size(figure: Figure) -> str:
    return f"{figure.value:.2f} ({figure.low:.2f} to {figure.high:.2f})"
