"""What several tests share of gate."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

from postprocessors import companions, load, program
from sim_controller.languages import Alarm
from sim_controller.motion import Motion
from sim_controller.probing import rig
from sim_controller.session import language
from support.controls import Ran
from support.dialects import EVERY, klartext
from tango_cnc.link.client import Asked, Begun, Ended, Failed, Task, Touched
from tango_cnc.link.protocols.grbl import Client
from tango_cnc.plan import plan_hash
from tango_cnc.records import Artefact, Machine, Plan, World

NEAR = ("contact", "collision")  # what must not happen where nobody has proven the probe alive


@dataclass(frozen=True)
class _Itself:
    """A plan that equals no other, with its options: two sets of options are the same where their texts are."""

    made: Plan = field(compare=False)
    options: Mapping[str, Any] = field(compare=False)
    which: int


@lru_cache(maxsize=64)  # what many tests run is written once; a record of a plan is known again by itself
def _written(name: str, made: _Itself, options: str) -> tuple[str, ...]:
    return tuple(program(load(name), made.made, made.options, plan_hash(made.made))[2]())


def written(name: str, made: Plan, options: Mapping[str, Any]) -> list[str]:
    """dialect, plan, options of its profile → the lines of the program."""
    return list(_written(name, _Itself(made, options, id(made)), repr(sorted(options.items()))))


def ran(
    name: str,
    made: Plan,
    options: Mapping[str, Any] | None = None,
    habits: Mapping[str, Any] | None = None,
    truly: Machine | None = None,
    brake: int | None = None,
    really: Artefact | None = None,
    lacks: str = "",
    **who: Any,
) -> Ran:
    """dialect, plan, options of its profile, who is there and how the probe is wired → what came of the program.

    `habits`: of the control, beside its usual ones; `truly`: the machine that really moves; `really`: the artefact on it;
    `brake`: M code that opens it; `lacks`: a word that this control does not know, as its alarm says.
    """
    spoken, found = EVERY[name], Ran()
    family = language(spoken.family)
    lines = written(name, made, options or {})
    lines = lines[spoken.frame : len(lines) - spoken.frame]
    if lacks:
        lines = [line.replace(lacks, _unknown(lacks)) for line in lines]
    library = [line for file, text in companions(load(name), made, options or {}).items() for line in (file, *text)]
    machine = truly or made.machine
    motion = Motion(rig(machine, really or made.artefact, World()), lambda event, **data: found.events.append((event, data)), **who)
    profile = replace(family.default_profile(machine), **{**spoken.settings, **(habits or {})})

    def note(event: str, **data: Any) -> None:
        found.events.append((event, data))
        if event == "m" and brake is not None and re.search(rf"\b{brake}\b", str([*data.values()]).replace("M", "M ")):
            motion.freed()

    def punched(data: bytes) -> None:
        found.out += data
        many = sum(line.lstrip().startswith(b"P") for line in re.split(rb"[\r\n]+", found.out)[:-1])
        found.stamps += [motion.time] * (many - len(found.stamps))

    control = family.Control(
        motion,
        profile,
        punched,
        note,
        spoken.library if klartext(name) or not library else library,
    )
    found.clock = lambda: motion.time
    if spoken.family == "grbl":
        numbers = tuple(touch.number for touch in made.touches)
        wait = (99.0,) * (len(numbers) + 1)
        misses = len(numbers) + 1 if made.touches[0].facet == "air" else 3  # as 'tango commission' asks for
        job = Task(made, "\n".join(lines), "M", made.machine.names, wait, numbers, misses=misses)
        client = Client(job, {"orient": "m19"})
        while not client._over:
            asked = client.bytes_to_send(1 << 16).decode("ascii")
            answer = control.report() if asked == "?" else control.line(asked.strip())
            for event in client.receive("".join(f"{line}\r\n" for line in answer).encode("ascii")):
                if isinstance(event, Begun):
                    found.out += b"TANGO START \n"
                if isinstance(event, Touched):
                    punched(f"{event.text}\n".encode())
                if isinstance(event, Ended):
                    found.out += b"TANGO END \n"
                if isinstance(event, Failed):
                    found.alarm = Alarm("driver", event.why)
                if isinstance(event, Asked):
                    found.events.append(("message", {"text": event.text}))
        return found
    try:
        control.run(lines, False)
    except Alarm as alarm:
        shown = vars(alarm).values()
        found.alarm = Alarm(*(str(part).replace(_unknown(lacks), lacks) for part in shown)) if lacks else alarm
    return found


def _unknown(word: str) -> str:
    """word → another one in its place, which no control knows."""
    return re.sub(r"(?<=[A-Z#])(\d+)$", r"\g<1>9", word) if word[-1].isdigit() else f"{word[:-1]}XQ"
