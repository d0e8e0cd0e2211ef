"""What several tests share of dialects."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from postprocessors import companions, load, names, program
from postprocessors.heidenhain import mask
from sim_controller.motion import Motion
from sim_controller.named import stand_in
from sim_controller.probing import rig
from sim_controller.session import families, language, profile
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.link.client import Begun, Ended, Failed, Identified, Task, Touched
from tango_cnc.link.protocols.grbl import Client
from tango_cnc.link.trust import Leeway, judge
from tango_cnc.link.words import record
from tango_cnc.plan import last_motion, plan, plan_hash
from tango_cnc.records import Cell, InputError, Plan, Readings, World

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "hu40t"
GOLDEN = Path(__file__).parents[1] / "golden"
FEW = 12  # lines by which programs of relatives differ: their marks, and a word or two
PRINTED = 1e-4  # mm and deg, the last digit of a record
OFFSETS = {"X": 11.5, "Y": -3.25, "Z": 100.25}


@dataclass(frozen=True)
class ControlOf:
    """The control of a dialect: language, settings, what is stored in it, how many lines at either end are for the line."""

    family: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    library: tuple[str, ...] = ()
    frame: int = 0
    resolution: float = PRINTED  # mm and deg


@cache
def example() -> Cell:
    """→ the HU40T."""
    return read_cell(EXAMPLE)


def beside(name: str) -> tuple[str, ...]:
    """dialect → the files that have to be on its control, each with its name in front."""
    files = companions(load(name), plan(example()), {})
    return tuple(line for file, lines in files.items() for line in (file, *lines))


def printed(name: str) -> float:
    """dialect → mm and deg, the last digit of its records, as `print_format` has them where the profile says nothing."""
    form = next((str(option.default) for option in load(name).options if option.name == "print_format"), "")
    return float(10.0 ** -int(form[-1])) if form else PRINTED


def control_of(name: str) -> ControlOf:
    """dialect → the control of its language, with what the simulated control of that name has of its own."""
    family = load(name).language
    if family not in families():
        raise InputError(
            f"postprocessors/{name}.py: found language={family!r}; allowed: {', '.join(families())}, or write "
            f"sim_controller/languages/{family}.py first (docs/dialects.md, Writing one): these tests run programs on it"
        )
    spoken, made = language(family), replace(LANGUAGES.get(family, ControlOf(family)), resolution=printed(name))
    library = beside(name) if family in BESIDE else made.library
    own = stand_in(name)
    if own is None:
        return replace(made, library=library)
    settled = profile(spoken, example().machine, own.settings)
    settings = {**made.settings, **{key: getattr(settled, key) for key in own.settings}}
    return replace(made, settings=settings, library=own.stored or library)


@cache
def klartext(name: str) -> bool:
    """dialect → whether its blocks are numbered, and its tables lie under TNC:\\."""
    return load(name).language == "klartext"


LENGTH = {"tool_lengths": {1: 326.674}}
LANGUAGES = {  # what all controls of a language have: a relative under another name has it, too
    "macro_b": ControlOf("macro_b", frame=1),
    "klartext": ControlOf("klartext", LENGTH, ("TNC:\\TANGO.A", *mask())),
    "fagor": ControlOf("fagor", LENGTH),
    "osp": ControlOf("osp", LENGTH),
    "siemens": ControlOf("siemens", LENGTH),
}
BESIDE = ("mach3", "mach4")  # languages whose programs do not run without the files that come with them
DRIVEN = {  # no logic of its own: its driver decides and records
    name: ControlOf("grbl", resolution=1e-3) for name in names() if load(name).language == "grbl"
}
QUICK = ("fanuc", "grbl", "heidenhain", "linuxcnc", "siemens")  # one of each way to speak; the others are many seconds together
ALONE = {name: control_of(name) for name in names() if name not in DRIVEN}  # who carry a program out by themselves
EVERY = {**ALONE, **DRIVEN}


def alike(name: str, other: str) -> bool:
    """dialects → whether the golden programs of two different ones are the same text but for a few lines."""

    def lines(dialect: str) -> set[str]:
        files = [file for file in (GOLDEN / dialect).glob("*") if file.is_file()]
        return {re.sub(r"\([^)]*\)", "", line).strip() for file in files for line in file.read_text("utf-8").splitlines()}

    return name != other and len(lines(name) ^ lines(other)) <= FEW


@pytest.fixture(scope="module")
def cell() -> Cell:
    """The HU40T, of whose strategy every facet is touched at some indexations: enough for S3."""
    whole = read_cell(EXAMPLE)
    some = [i for i in whole.strategy.indexations if len(i.facets) > 1][::3]
    thin = [replace(i, facets=i.facets[k % 3 :: 3] if len(i.facets) > 6 else i.facets) for k, i in enumerate(some)]
    spindle = [i for i in whole.strategy.indexations if abs(i.position.get("S", 0.0)) > 0]
    return replace(whole, strategy=replace(whole.strategy, indexations=(*thin, *spindle)))


@pytest.fixture(scope="module")
def world() -> World:
    return replace(read_world(EXAMPLE / "world.yaml"), noise=0.0)


def s3(cell: Cell, readings: Readings) -> dict[str, float]:
    result = estimate(cell.machine, cell.artefact, readings, ["S3"])
    return {name: p.value for name, p in {**result.parameters, **result.setup, **result.facets}.items()}


def driven(made: Plan, control: Any) -> list[Any]:
    """plan, control that answers line by line → what its driver makes of the answers: start mark, touches, end mark."""
    numbers = tuple(touch.number for touch in made.touches)
    client = Client(Task(made, "", "M", made.machine.names, (99.0,) * (len(numbers) + 1), numbers), {"orient": "m19"})
    events: list[Any] = []
    while not any(isinstance(event, Ended | Failed) for event in events):
        asked = client.bytes_to_send(1 << 16).decode("ascii")
        answer = control.report() if asked == "?" else control.line(asked.strip())
        events += client.receive("".join(f"{line}\r\n" for line in answer).encode("ascii"))
    return [event for event in events if not isinstance(event, Identified)]


def measured(made: Plan, name: str, world: World, options: Mapping[str, Any] = MappingProxyType({})) -> Readings:
    """plan, dialect, true machine, options of its profile → what its records say."""
    known = EVERY[name]
    spoken = language(known.family)
    lines = list(program(load(name), made, options, plan_hash(made))[2]())
    lines = lines[known.frame : len(lines) - known.frame]
    punched: list[bytes] = []
    settled = replace(spoken.default_profile(made.machine), g54=OFFSETS, **known.settings)
    motion = Motion(rig(made.machine, made.artefact, world))
    control = spoken.Control(motion, settled, punched.append, lambda event, **data: None, known.library)
    if name in DRIVEN:
        begun, *touched, ended = driven(made, control)
    else:
        control.run(lines, False)
        text = b"".join(punched).decode("ascii").replace("\x12", "").replace("\x14", "")
        begun, *touched, ended = [record(line, made.machine.names) for line in text.splitlines()]
    assert isinstance(begun, Begun)
    assert isinstance(ended, Ended) and ended.count == len(made.touches) and ended.mark in ("", begun.mark)
    judged = []
    for planned, event in zip(made.touches, touched, strict=True):
        assert isinstance(event, Touched)
        assert event.number == planned.number
        judged.append(judge(event, planned, made.machine, Leeway()))
    count = len(judged)
    return Readings(
        made.machine.names,
        np.arange(1, count + 1),
        np.zeros(count),
        tuple(t.facet for t in made.touches),
        np.array([j.position for j in judged]),
        last_motion(made),
        tuple(j.status for j in judged),
        np.ones(count, dtype=np.int64),
        np.ones(count, dtype=np.int64),
        np.full(count, made.strategy.approach.feed),
    )
