"""LinuxCNC: `COMP_FILE` of every joint, and pins or parameters of its kinematics module."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ... import kinematics
from ...kinematics import Slot
from ...records import InputError, Machine
from ..space import Held, Lever, by_slot
from . import COMPARE, Fact, Option, Request, none_derived
from ._parts import BOTH_WAYS, Turning, centre, counting_on, in_file, rotary_order, rows, scale_of, tables, trims

TEXT = "LinuxCNC: COMP_FILE of every joint; pins of xyzac-trt-kins or xyzbc-trt-kins; parameters of matrixkins"
SOURCE_COMP = "LinuxCNC docs/src/config/ini-config.adoc; src/emc/motion/usrmotintf.cc, command.c, control.c"
SOURCE_TRT = "LinuxCNC src/emc/kinematics/trtfuncs.c"
FACTS = (
    Fact("a COMP_FILE has lines 'nominal up down', ascending, at most 256; type 0: positions really reached", SOURCE_COMP),
    Fact("the loader stops at the first line that is not three numbers: no comment, no blank line in the file", SOURCE_COMP),
    Fact("below the first point and above the last the trim of that point holds", SOURCE_COMP),
    Fact("a joint with a COMP_FILE ignores its BACKLASH; probed positions are corrected, too", SOURCE_COMP),
    Fact("xyzac-trt-kins and xyzbc-trt-kins know centers of the axes, and neither tilt nor squareness", SOURCE_TRT),
    Fact(
        "matrixkins: joints = C × axes, three scales and six skews; needs coordinates XYZ first",
        "src/hal/components/matrixkins.comp",
    ),
    Fact(
        "5axiskins: tip = joints + pivot-length (sin B cos C, sin B sin C, 1 - cos B): a longer pivot is a longer tool and a shift "
        "of the workpiece, which the set-up takes out; nothing is written",
        "LinuxCNC src/emc/kinematics/5axiskins.c",
    ),
    Fact("BACKLASH of every joint was 0 while the readings were made", "your .ini file", confirmed=False),
    Fact(
        "the machine frame of machine.yaml is that of G53, and the pins are 0 or as given with --present", "your .hal file", False
    ),
    Fact("conventional-directions is 0 where the module has that pin", "LinuxCNC pull request 3482", confirmed=False),
)
KINEMATICS = ("auto", "trivkins", "matrixkins", "xyzac-trt-kins", "xyzbc-trt-kins", "5axiskins")
UNIT_BESIDE = False
TURNING = Turning(BOTH_WAYS, most=256)
OPTIONS = {
    "kinematics": Option("auto", "kinematics module; auto: by the topology", KINEMATICS),
    "joints": Option("", "letters of the joints in order, e.g. XYZAC; default: X Y Z and the rotary axes"),
    "points": Option(33, "points of each COMP_FILE, at most 256"),
    "comp": Option("yes", "write COMP_FILEs", ("yes", "no")),
}
derived = none_derived


def module(request: Request) -> str:
    """job → name of the kinematics module that the file is for."""
    chosen = str(request.options["kinematics"])
    if chosen != "auto":
        return chosen
    work, tool = rotary_order(request.machine)
    if not work and not tool:
        return "matrixkins"
    trt = {"AC": "xyzac-trt-kins", "BC": "xyzbc-trt-kins"}.get("".join(work), "trivkins") if not tool else "trivkins"
    return trt if _usual(request.machine) else "trivkins"


def _usual(machine: Machine) -> bool:
    """machine → whether its axes move as trt-kins has it: tool along +x +y +z of the table, table turning about +x … +z."""
    chain = kinematics.chain(machine)
    still = np.zeros((1, len(machine.names)))
    way = [
        kinematics.tip(chain, still + np.eye(len(machine.names))[machine.column(a)]) - kinematics.tip(chain, still) for a in "XYZ"
    ]
    turning = all(max(machine.axis(a).direction) > 1 - 1e-9 for a in machine.rotary)
    return bool(np.allclose(np.vstack(way), np.eye(3), atol=1e-9)) and turning


def joints(request: Request) -> str:
    """job → letters of the joints in order."""
    return str(request.options["joints"]) or "".join((*request.machine.linear, *request.machine.rotary))


def check(request: Request) -> None:
    """job → nothing. Raises InputError for a module that is for another machine, and joints that are not its axes."""
    machine, name = request.machine, module(request)
    work, tool = rotary_order(machine)
    fits = {
        "xyzac-trt-kins": (work, tool) == (["A", "C"], []),
        "xyzbc-trt-kins": (work, tool) == (["B", "C"], []),
        "5axiskins": (work, tool) == ([], ["C", "B"]),
    }
    if not fits.get(name, True) or (name.endswith("trt-kins") and not _usual(machine)):
        raise InputError(
            f"--set: kinematics: found {name}, which is not for {machine.topology}; allowed: "
            "xyzac-trt-kins for a table C on a cradle A, xyzbc-trt-kins for C on B, 5axiskins for a head with C and B; with these "
            "the tool moves along +x +y +z of the table and the table turns about +x +y +z; else trivkins"
        )
    if sorted(joints(request)) != sorted((*machine.linear, *machine.rotary)):
        raise InputError(
            f"--set: joints: found {joints(request)!r}; allowed: {' '.join((*machine.linear, *machine.rotary))} once each"
        )
    if request.options["points"] > 256:
        raise InputError(f"--set: points: found {request.options['points']}; allowed: 2 to 256, as many as a COMP_FILE may have")


def held(request: Request) -> list[Held]:
    """job → trims of the joints, and what the kinematics module has."""
    machine, result = request.machine, []
    if request.options["comp"] == "yes":
        for letter in joints(request):
            table = f"joint_{joints(request).index(letter)}.comp ({letter})"
            points = int(request.options["points"])
            for h in trims(request, table, letter, letter, points, senses=(1, -1), turning=TURNING):
                assert h.at is not None
                nominal = round(h.at * scale_of(machine, letter), 6)
                result.append(replace(h, base=nominal))
    name = module(request)
    if name == "matrixkins":
        for out in range(3):
            for by in range(3):
                result.append(_matrix(request, out, by))
    if name.endswith("trt-kins"):
        cradle = "A" if "xyzac" in name else "B"
        side = 1 if cradle == "A" else 0
        zero = machine.spindle.point
        for i in (0, 1):
            base = machine.axis("C").point[i] - zero[i]
            pin = centre(machine, "C", i, f"{name}.{'xy'[i]}-rot-point", name, increment=1e-6, base=base)
            if i == side:  # the control counts the offset from this point, so the cradle goes with it
                pin = replace(pin, lever=_both(pin.lever, centre(machine, cradle, i, "", "").lever))
            result.append(pin)
        base = machine.axis(cradle).point[side] - machine.axis("C").point[side]
        offset = centre(machine, cradle, side, f"{name}.{'xy'[side]}-offset", name, increment=1e-6, base=base)
        result.append(replace(offset, between=True))
        base = machine.axis(cradle).point[2] - zero[2]
        result.append(centre(machine, cradle, 2, f"{name}.z-rot-point", name, increment=1e-6, base=base))
    return result


def _both(one: Lever, other: Lever) -> Lever:
    return lambda poses: one(poses) + other(poses)


def _matrix(request: Request, out: int, by: int) -> Held:
    letters = "XYZ"
    lever = by_slot(Slot(letters[out], "motion"), lambda t: t.axis(letters[by]))
    place = f"matrixkins.C_{'xyz'[out]}{'xyz'[by]}"
    return Held(place, "matrixkins", "1", "ratio", 1e-9, lever, 1.0, -1, float(out == by))


def files(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, str]:
    """job, entries, the control's numbers → COMP_FILEs, lines for the .ini file, a .hal file."""
    result: dict[str, str] = {}
    ini = []
    for table in (t for t in tables(held) if t.endswith(")") and ".comp" in t):
        name, letter = table.split()[0], table[-2]
        entries = rows(held, table)
        half, points = len(entries) // 2, int(request.options["points"])
        ups, downs = (in_file(request, letter, part, points, TURNING) for part in (entries[:half], entries[half:]))
        lines = []
        for (place, up), (_, down) in zip(ups, downs, strict=True):
            at = round(place, 6) + 0.0  # of an entry that comes again with each turn: its number there, and as much beside it
            lines.append(f"{at:.6f} {at + numbers[up.place] - up.base:.6f} {at + numbers[down.place] - down.base:.6f}")
        result[name] = "".join(f"{line}\n" for line in lines)
        ini += [f"[JOINT_{joints(request).index(letter)}]", f"COMP_FILE = {name}", "COMP_FILE_TYPE = 0", ""]
    if ini:
        result["compensation.ini"] = "\n".join(ini)
    pins = [h for h in held if h.table in KINEMATICS]
    lines = [f"setp {h.place} {numbers[h.place]:.9f}" for h in pins]
    if module(request).endswith("trt-kins"):
        lines.append(f"setp {module(request)}.z-offset 0.000000000")
    if lines:
        result["compensation.hal"] = "".join(f"{line}\n" for line in lines)
    return result


def steps(request: Request) -> list[str]:
    """job → what a person does with the files."""
    result = ["Switch the machine off and end LinuxCNC.", COMPARE]
    if request.options["comp"] == "yes":
        result += [
            *counting_on(request.machine),
            "Copy the .comp files into the folder of the configuration.",
            "Add the lines of compensation.ini to the [JOINT_n] sections of the .ini file, and take BACKLASH out of them.",
        ]
    if module(request) == "5axiskins":
        result.append(
            "Leave 5axiskins.pivot-length as it was when tools were measured: its error is an error of every tool's length. "
            "This target corrects the joints only, not the pivots of a head."
        )
    elif module(request) != "trivkins":
        result.append(
            "Add the lines of compensation.hal to the .hal file after the line that loads the kinematics, in place of lines that "
            "set the same pins."
        )
    return [*result, "Start LinuxCNC, home, and move every axis a little at low feed before anything else."]
