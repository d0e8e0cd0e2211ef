"""Variables of Custom Macro B: vacant, local, common; system variables are asked of the control."""

from __future__ import annotations

from collections.abc import Callable

from .alarms import alarm

VACANT = 0
LOCAL = range(1, 34)
COMMON = (range(100, 200), range(500, 1000))
ARGUMENTS = dict(
    zip(
        "ABCDEFHIJKMQRSTUVWXYZ",
        (1, 2, 3, 7, 8, 9, 11, 4, 5, 6, 13, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26),
        strict=True,
    )
)


class Variables:
    """#1–#33 of the running level, #100–#199 and #500–#999; the rest goes to `system` and `set_system`."""

    def __init__(self, system: Callable[[int], float | None], set_system: Callable[[int, float | None], None]) -> None:
        self._common: dict[int, float] = {}
        self._levels: list[dict[int, float]] = [{}]
        self._system, self._set_system = system, set_system

    def get(self, number: int) -> float | None:
        """number → value, None when vacant. Raises Alarm for a variable that does not exist."""
        if number == VACANT:
            return None
        if number in LOCAL:
            return self._levels[-1].get(number)
        if any(number in part for part in COMMON):
            return self._common.get(number)
        return self._system(number)

    def set(self, number: int, value: float | None) -> None:
        """number, value (None makes it vacant). Raises Alarm for #0 and for what cannot be written."""
        if number == VACANT:
            raise alarm("PS0116", "#0")
        if number not in LOCAL and not any(number in part for part in COMMON):
            self._set_system(number, value)
            return
        store = self._levels[-1] if number in LOCAL else self._common
        if value is None:
            store.pop(number, None)
        else:
            store[number] = value

    def enter(self, arguments: dict[int, float]) -> None:
        """{number: value} → a new level of local variables (G65)."""
        self._levels.append(dict(arguments))

    def leave(self) -> None:
        """Back to the locals of the caller."""
        self._levels.pop()

    def reset(self) -> None:
        """RESET or the end of the program: locals are vacant; the common ones stay."""
        self._levels = [{}]
