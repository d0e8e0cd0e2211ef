"""A plan of three touches written by hand, and a controller that lives in memory: what the tests of the link share."""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import UTC, datetime, timedelta

from tango_cnc.link.client import Task
from tango_cnc.link.transport import Lost
from tango_cnc.records import Approach, Artefact, Axis, Facet, Indexation, Machine, Plan, Probe, Strategy, Touch, Turn

MARK = "5AFE0001"


def machine() -> Machine:
    def linear(name: str, *direction: float) -> Axis:
        return Axis(name, "linear", direction, travel=(-400, 400), rapid=6000, acceleration=2.0)  # type: ignore[arg-type]

    def rotary(name: str, *direction: float) -> Axis:
        return Axis(name, "rotary", direction, travel=(-7, 7), rapid=math.radians(3600), clamp_time=1.5)  # type: ignore[arg-type]

    axes = (linear("X", 1, 0, 0), linear("Y", 0, 1, 0), linear("Z", 0, 0, 1), rotary("B", 0, 1, 0), rotary("C", 0, 0, 1))
    spindle = Axis("S", "spindle", (0, 0, 1))
    return Machine("small", "wCBXfZY(S)t", (*axes, spindle), ("X", "B", "C"), ("Z", "Y", "S"), Probe(100.0, 3.0, 0.0007))


def plan() -> Plan:
    """Facet 5 is touched towards +X, 7 towards -Y, both at B0 C0; then 5 again at B30 C-90, towards -Z."""
    here, turned = (0.0, 0.0, 0.0), (math.radians(30), math.radians(-90), 0.0)
    touches = (
        Touch(1, "5", 0, (10, 0, 50, *here), (20, 0, 50, *here), (25, 0, 50, *here), (10, 0, 100, *here)),
        Touch(2, "7", 0, (0, 40, 50, *here), (0, 30, 50, *here), (0, 25, 50, *here), (0, 40, 100, *here)),
        Touch(3, "5", 1, (-5, 5, 80, *turned), (-5, 5, 70, *turned), (-5, 5, 65, *turned), (-5, 5, 100, *turned)),
    )
    turns = (
        Turn(1, (0, 0, 200, *here), (0, 0, 200, *here), first="Z"),
        Turn(3, (0, 40, 100, *here), (0, 40, 100, *turned)),
        Turn(4, (-5, 5, 200, *turned), (-5, 5, 200, *turned)),
    )
    facets = {"5": Facet("5", (0, 0, 0), (-1, 0, 0)), "7": Facet("7", (0, 0, 0), (0, 1, 0))}
    zero, other = {"B": 0.0, "C": 0.0, "S": 0.0}, dict(zip("BCS", turned, strict=True))
    strategy = Strategy("three", Approach(10, 5, 180), (Indexation(zero, ("5", "7")), Indexation(other, ("5",))))
    return Plan(machine(), Artefact("two faces", facets), strategy, touches, turns)


PROGRAM = "%\nO0001 (TANGO 5AFE0001)\nG31 X25. F180\nM30\n%\n"


def job(**changes: object) -> Task:
    values = {
        "plan": plan(),
        "program": PROGRAM,
        "mark": MARK,
        "letters": ("X", "Y", "Z", "B", "C"),
        "patience": (30.0, 30.0, 30.0, 30.0),
        "original": (1, 2, 3),
        "summed": False,
    }
    return Task(**{**values, **changes})  # type: ignore[arg-type]


class FakeClock:
    """Time that passes only when somebody waits."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def __call__(self) -> float:
        return self.seconds

    def now(self) -> datetime:
        return datetime(2024, 5, 1, 6, 0, tzinfo=UTC) + timedelta(seconds=self.seconds)


class Memory:
    """A transport whose other end is a function: bytes written so far → bytes that the controller answers, or None: it hangs up."""

    chunk = 16

    def __init__(self, clock: FakeClock, answer: Callable[[bytes], bytes | None]) -> None:
        self.clock, self.answer, self.written = clock, answer, bytearray()
        self._given = 0

    def read(self, timeout: float) -> bytes:
        whole = self.answer(bytes(self.written))
        if whole is None:
            raise Lost("the other side closed the connection")
        data = whole[self._given :]
        self._given = len(whole)
        self.clock.seconds += 0.001 if data else timeout
        return data

    def write(self, data: bytes) -> int:
        self.written += data
        return len(data)

    def close(self) -> None:
        pass
