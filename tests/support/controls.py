"""A post's program on its simulated control, with the golden cell: what came of it, and machines whose facets lie elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pytest
import yaml

from postprocessors import companions, load, program
from sim_controller.faults import faults
from sim_controller.languages import Alarm
from sim_controller.motion import Motion, Note
from sim_controller.probing import rig
from tango_cnc.files import read_cell
from tango_cnc.link.client import Begun, Ended, Touched
from tango_cnc.link.words import record
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import Artefact, Plan, World

GOLDEN = Path(__file__).parents[1] / "golden" / "cell"
OFFSETS = {"X": 11.5, "Y": -3.25, "Z": 100.25, "B": 1.5, "C": 20.0}  # mm and deg, of a work frame that changes nothing
ACTIVE: dict[str, Any] = {"g54": OFFSETS, "tool_lengths": {1: 300.0}}


@cache
def golden() -> Plan:
    """→ the plan of the golden cell."""
    return plan(read_cell(GOLDEN))


def lines_of(post: str, made: Plan, **options: Any) -> list[str]:
    """post, plan, options → the program. That of the golden plan is written once for the same options."""
    if made is not golden():
        return list(program(load(post), made, options, plan_hash(made))[2]())
    return list(_of_golden(post, repr(sorted(options.items())), lambda: program(load(post), made, options, plan_hash(made))[2]()))


WRITTEN: dict[tuple[str, str], tuple[str, ...]] = {}


def _of_golden(post: str, options: str, write: Callable[[], Iterable[str]]) -> tuple[str, ...]:
    if (post, options) not in WRITTEN:
        WRITTEN[post, options] = tuple(write())
    return WRITTEN[post, options]


def library_of(post: str, made: Plan, **options: Any) -> list[str]:
    """post, plan, options → what travels with the program: each file's name, then its lines."""
    return [line for name, lines in companions(load(post), made, options).items() for line in (name, *lines)]


@dataclass
class Ran:
    """What came of a program."""

    out: bytes = b""
    alarm: Alarm | None = None
    events: list[tuple[str, Mapping[str, Any]]] = field(default_factory=list)
    files: Mapping[str, str] = field(default_factory=dict)
    clock: Callable[[], float] = lambda: 0.0  # s of the machine
    stamps: list[float] = field(default_factory=list)  # s of the machine at each record that came

    @property
    def why(self) -> str:
        """→ the text of the alarm; empty when there was none."""
        return str(self.alarm) if self.alarm else ""

    @property
    def lines(self) -> list[str]:
        """→ what was printed."""
        return self.out.decode("ascii").splitlines()

    @property
    def stops(self) -> list[str]:
        """→ what the program said when it stopped."""
        return [data["message"] for event, data in self.events if event == "stop"]

    @property
    def messages(self) -> list[str]:
        """→ what it showed on its screen."""
        return [data["text"] for event, data in self.events if event == "message"]

    @property
    def places(self) -> list[Mapping[str, float]]:
        """→ where each motion ended, {axis: mm deg}."""
        return [data["position"] for event, data in self.events if event in ("feed", "rapid", "skip", "contact")]

    @property
    def moves(self) -> int:
        """→ how many motions there were."""
        return len(self.places)

    def records(self, made: Plan) -> list[Any]:
        """→ what the reader of the line makes of all that was printed."""
        return [record(line, made.machine.names) for line in self.lines]

    def flags(self, made: Plan) -> list[int]:
        """→ flags of the touches on record."""
        return [event.flag for event in self.records(made) if isinstance(event, Touched)]


class Control(Protocol):
    """A simulated control."""

    def run(self, lines: Iterable[str], streamed: bool) -> None:
        """Carries a program out."""


def run_on(
    build: Callable[[Motion, Callable[[bytes], None], Note], Control],
    lines: list[str],
    made: Plan,
    artefact: Artefact | None = None,
    world: World | None = None,
    fault: str | None = None,
    stuck: bool = False,
) -> Ran:
    """what builds a control, program, plan, true artefact and machine, a fault, probe deflected at first → what came of it."""
    ran = Ran()

    def note(event: str, **data: Any) -> None:
        ran.events.append((event, data))

    def punch(data: bytes) -> None:
        ran.out += data

    motion = Motion(rig(made.machine, artefact or made.artefact, world or World()), note, faults=faults([fault] if fault else []))
    motion._stuck = stuck
    control = build(motion, punch, note)
    try:
        control.run(lines, False)
    except Alarm as alarm:
        ran.alarm = alarm
    ran.files = getattr(control, "files", {})
    return ran


def shifted(made: Plan, facet: str, by: float) -> Artefact:
    """artefact whose one facet really lies `by` mm farther out than everybody thinks."""
    old = made.artefact.facets[facet]
    point = np.array(old.point) + by * np.array(old.normal)
    return replace(made.artefact, facets={**made.artefact.facets, facet: replace(old, point=tuple(point))})


def far_away(made: Plan) -> Artefact:
    """An artefact that no program comes near to."""
    facet = replace(made.artefact.facets["top"], id="far", point=(0.0, 0.0, -5000.0))
    return replace(made.artefact, facets={"far": facet}, balls={})


def untouchable(made: Plan) -> Artefact:
    """The facets of the plan where no touch finds them, as for a probe that never answers."""
    facets = {key: replace(facet, point=(0.0, 0.0, -500.0), ball=None) for key, facet in made.artefact.facets.items()}
    return replace(made.artefact, facets=facets, balls={})


def assert_as_planned(events: list[Any], made: Plan, post: str, options: Mapping[str, Any]) -> None:
    """records of a program that this post has made with these options: every touch is there, within 3 µm of where it is planned."""
    begun, *touched, ended = events
    assert begun == Begun(program(load(post), made, options, plan_hash(made))[1], len(made.touches))
    assert ended == Ended(len(made.touches), begun.mark)
    assert [(t.number, t.flag) for t in touched] == [(t.number, 1) for t in made.touches]
    for planned, found in zip(made.touches, touched, strict=True):
        for name, value in zip(made.machine.names, planned.contact, strict=True):
            if name in "XYZ":
                assert found.position[name] == pytest.approx(value, abs=0.003), (planned.number, name)
            else:
                turned = found.position[name] - math.degrees(value)
                assert math.remainder(turned, 360) == pytest.approx(0, abs=1e-6), (planned.number, name)


def assert_as_it_happened(ran: Ran, made: Plan) -> None:
    """Every touch is on record where the machine really was when the probe was met, within 0.1 µm."""
    truly = [data["at"] for event, data in ran.events if event == "contact"]
    begun, *touched, ended = ran.records(made)
    for event, touch, there in zip(touched, made.touches, truly, strict=True):
        assert isinstance(event, Touched)
        assert (event.number, event.flag) == (touch.number, 1)
        for name in "XYZ":
            assert event.position[name] == pytest.approx(there[name], abs=1e-4)
    assert isinstance(begun, Begun) and ended == Ended(len(made.touches), begun.mark)


def stating(folder: Path, **controller: object) -> Path:
    """folder of a cell, what it states of its control → the same."""
    file = folder / "tango.yaml"
    known = yaml.safe_load(file.read_text(encoding="utf-8")) | {"controller": controller}
    file.write_text(yaml.safe_dump(known), encoding="utf-8")
    return folder
