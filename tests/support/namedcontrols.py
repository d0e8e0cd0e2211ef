"""What the simulated control of a dialect has to be, beside what its file in `sim_controller/controls/` says that it is.

The simulated control never reads a post. A command writes the file of a new one from the defaults of its post, once; then a person
looks them up in the manual of the control. So a number that is wrong in the post is found there, or by the programs that stop.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from typing import Any

from postprocessors import load
from sim_controller.named import FOLDER, StandIn, controls, stand_in
from sim_controller.session import families, language
from support.rows import ROOT, command
from tango_cnc.records import InputError

NOBODY = "unconfirmed"  # what stands under `manual` where nobody has seen one
OPEN = "not looked up yet"  # what the command writes there
CALLED = re.compile(r"(?:G65|M98) P(\d+)")  # a program that the control has stored


def missing(name: str) -> bool:
    """dialect → whether its language has a simulated control, and its own control has no file yet."""
    return load(name).language in families() and name not in controls()


def numbered(numbers: Mapping[str, int]) -> str:
    """{letter of an axis: its number} → the letters in the order of the numbers, - where no axis has one."""
    letters = {number: letter for letter, number in numbers.items()}
    return "".join(letters.get(number, "-") for number in range(1, max(letters) + 1))


def setting(shown: Any, default: Any) -> tuple[str, str]:
    """which fields of a control stand beside an option, default of that option → the field and its text, as `--set` takes them."""
    if isinstance(default, Mapping):
        return shown.fields[0], numbered(default)
    if "macros_ahead" in shown.fields and str(default).startswith("G103"):
        return "macros_ahead", "true"
    return shown.fields[0], str(default).split()[-1] if shown.fields == ("orient",) else str(default)


@cache
def usual(name: str) -> dict[str, tuple[str, ...]]:
    """dialect → {option: defaults, as Python shows them, that go with a control of its language that has nothing of its own}."""
    spoken = load(name).language
    known = {relative: stand_in(relative) for relative in controls()}
    plain = [load(n) for n, row in known.items() if row and row.language == spoken and not row.settings and n != name]
    options = [option for post in plain for option in post.options]
    return {option.name: tuple(repr(o.default) for o in options if o.name == option.name) for option in options}


def wanted(name: str) -> dict[str, tuple[str, str, str, str]]:
    """dialect → {option with another default than its relatives: (default, field of its control, text of it, where to look)}."""
    shown_by, known = language(load(name).language).CONTROLS.shown_by, usual(name)
    return {
        option.name: (repr(option.default), *setting(shown_by[option.name], option.default), shown_by[option.name].look)
        for option in load(name).options
        if known and option.name in shown_by and repr(option.default) not in known.get(option.name, ())
    }


def called(name: str) -> tuple[str, ...]:
    """dialect → lines of the programs that its words for the probe call, which do nothing on the simulated control."""
    words = [option.default for option in load(name).options if option.name in ("probe_on", "probe_off")]
    numbers = list(dict.fromkeys(number for word in words for number in CALLED.findall(str(word))))
    return tuple(line for number in numbers for line in (f"O{number}", "M99"))


def _texts(name: str) -> dict[str, str]:
    """dialect → {field: text} of what its control has to state."""
    return {field: text for _, field, text, _ in wanted(name).values()}


def first(name: str) -> str:
    """dialect → the file of its control as the command writes it: what its post assumes, and room for the source."""
    said = [f"  {field}: {text!r}" for field, text in _texts(name).items()]
    return "\n".join(
        [
            f"# The simulated control {name}. A command has written this file from the defaults of postprocessors/{name}.py, once.",
            "# Look each line up in the manual of the control, correct what is otherwise, and state the source under `manual`.",
            f"language: {load(name).language}",
            *(["settings:", *said] if said else []),
            *([f"stored: [{', '.join(called(name))}]"] if called(name) else []),
            *([f"manual: {OPEN}"] if said or called(name) else []),
            "",
        ]
    )


def wrong(name: str) -> list[str]:
    """dialect → what its control and its post say otherwise, each with where a manual says which of them is right."""
    row = stand_in(name) or StandIn(load(name).language)
    found = []
    shown_by, asked = language(load(name).language).CONTROLS.shown_by, wanted(name)
    for option, shown in shown_by.items():
        stated = {field: row.settings[field] for field in shown.fields if field in row.settings}
        default, field, text, look = asked.get(option, ("the usual one", shown.fields[0], "", shown.look))
        if stated != ({field: text} if text else {}):
            said = ", ".join(f"{key}: {value!r}" for key, value in stated.items()) or f"no {field}"
            found.append(f"{option} of the post is {default}, so {field}: {text!r}; the control says {said} ({look})")
    if called(name) and row.stored != called(name):
        found.append(f"the post calls {called(name)}, the control has stored {row.stored} (programs of the builder or of Renishaw)")
    return found


def unsaid(name: str) -> str:
    """dialect → what a person has to look up before the file of its control counts, "" where a source is stated."""
    row = stand_in(name)
    if row is None or row.manual not in ("", OPEN) or not (row.settings or row.stored):
        return ""
    looked = {field: f"{field}: {text!r} ({look})" for _, field, text, look in wanted(name).values()}
    said = [looked.get(field, f"{field}: {text!r}") for field, text in row.settings.items()]
    said += [f"stored: {row.stored} (the programs that switch the probe on and off)"] if row.stored else []
    return (
        f"{_file(name)}: nobody has looked it up. In the manual of this control, and not in the post, look up {'; '.join(said)}. "
        f"Correct what is otherwise, here and in the post, and state the manual and its page under manual; write {NOBODY} where "
        "nobody has seen a manual"
    )


def complaint(name: str) -> str:
    """dialect → why its control does not count yet, "" where it does; also of a file that cannot be read."""
    try:
        return differs(name) if missing(name) or unsaid(name) or wrong(name) else ""
    except InputError as error:
        return str(error)


def _file(name: str) -> str:
    return f"{FOLDER.relative_to(ROOT)}/{name}.yaml"


def differs(name: str) -> str:
    """dialect → which file says what its simulated control is, what is wrong with it, and the command that writes a first one."""
    said = f"postprocessors/{name}.py: its programs run on the simulated control that {_file(name)} says it is. "
    if missing(name):
        written = ", ".join(f"{field}: {text!r}" for field, text in _texts(name).items()) or "its language"
        write = command("tests/contracts/test_posts.py")
        return f"{said}It is missing; write it with: {write} -k {name}. It will say {written}, and you look that up in the manual"
    return said + (unsaid(name) or "; ".join(wrong(name)) or "Where that control is otherwise than its relatives, it says so there")
