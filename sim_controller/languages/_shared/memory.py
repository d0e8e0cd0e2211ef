"""What a control stores before it executes it: a program that is longer than its free memory is refused as it comes."""

from __future__ import annotations

from collections.abc import Callable, Iterable

KB = 1000  # characters


def stored(lines: Iterable[str], room: int, full: Callable[[str], Exception]) -> list[str]:
    """lines as they come, kB of free memory (0: a disk), {where it was full → the alarm} → all of them.

    The end of a block is one character (LF). Raises the alarm at the block that no longer fits: nothing has been executed then.
    """
    kept: list[str] = []
    taken = 0
    for line in lines:
        taken += len(line) + 1
        if room and taken > room * KB:
            raise full(f"block {len(kept) + 1}: more than {room} kB")
        kept.append(line)
    return kept
