"""SINUMERIK 840D sl and ONE: kinematics (TOOLCARRIER fine offsets or TRAORI), CEC tables, ENC_COMP, reversal values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...records import InputError
from ..space import Held
from . import COMPARE, SIGN_TRIAL, Derived, Fact, Option, Request
from ._parts import HALVES, MODULO, across, centre, in_file, point_of, reversal, rotary_order, rows, tables, tilt, trims

TEXT = "SINUMERIK 840D sl, ONE: TOOLCARRIER fine offsets with TRAORI machine data, CEC tables, ENC_COMP, reversal values"
IM9 = "SINUMERIK 840D sl Commissioning Manual IM9 12/2017, p. 572"
IM9_2013 = "SINUMERIK Operate (IM9) Commissioning Manual 03/2013, p. 502"
K3 = "SINUMERIK Function Manual K3 03/2013, p. 242, 249"
FACTS = (
    Fact("$TC_CARR1..3 = I1, 4..6 = I2, 15..17 = I3, 18..20 = I4; fine offsets are 40 higher", IM9),
    Fact("a tool carrier and TRAORI keep the same vectors in two places (table of IM9): both are written, or none", IM9),
    Fact("T: I1 = -(I2+I3); P: I4 = -(I2+I3); M: I1 = -I2, I4 = -I3", IM9),
    Fact("T: I3 leads from the tool adapter to rotary axis 2, I2 from there to rotary axis 1", IM9_2013),
    Fact("P: I2 leads from the reference point of the machine to rotary axis 1, I3 from there to rotary axis 2", IM9_2013),
    Fact(
        "M: I2 leads from the tool adapter to rotary axis 1, I3 from the reference point of the machine to rotary axis 2", IM9_2013
    ),
    Fact("axis vectors of a table are entered reversed", IM9),
    Fact("$AN_CEC[t,i], INPUT_AXIS, OUTPUT_AXIS, STEP, MIN, MAX, DIRECTION 0 1 -1, IS_MODULO; M17 ends the file", K3),
    Fact("$AA_ENC_COMP[0,i,AX] in mm or degrees with _STEP _MIN _MAX _IS_MODULO", K3),
    Fact(
        "$AN_CEC_MULT_BY_TABLE[t] = index + 1 of another table adds the product of both to their axis: errors of two axes at "
        "once, such as the tilt of one times the place of another. Page 249 calls it an additional value, in the example of page "
        "252 it is all that acts. If the factors' own values stay, a place in mm as a factor moves the axis by as much: no "
        "product is written, and angles of linear axes stay",
        "SINUMERIK Function Manual K3 03/2013, p. 245, 249, 252",
        confirmed=False,
    ),
    Fact(
        "a rotary axis without limits counts 0 to 360 (modulo axis): its tables go from 0 to 360, both ends are the same, "
        "IS_MODULO = 1. One whose travel is a turn or more counts on, and its tables cover its travel: IS_MODULO = 0",
        "memory",
        confirmed=False,
    ),
    Fact("the sum of the CEC tables is added to the commanded position", K3, confirmed=False),
    Fact("ENC_COMP is added to the position that the encoder gives", K3, confirmed=False),
    Fact("MD32450 is the whole reversal value, positive where the encoder is ahead of the table", "memory", confirmed=False),
    HALVES,
    Fact("fine offsets act when SD42974 is 1 and stay within MD20188", "memory", confirmed=False),
    Fact("CEC acts when MD32710 of the axis and SD41300 of the table are set", "memory", confirmed=False),
)
UNIT_BESIDE = False
OPTIONS = {
    "points": Option(
        17, "points of each table over the volume, more where an axis turns further; MD18342 and MD38000 have to allow them"
    ),
    "kinematics": Option("yes", "write the centers of the rotary axes", ("yes", "no")),
    "directions": Option("yes", "write the directions of the rotary axes V1, V2", ("yes", "no")),
    "tables": Option("yes", "write CEC and ENC_COMP", ("yes", "no")),
    "rotary_tables": Option("yes", "CEC with a rotary axis as input", ("yes", "no")),
    "carrier": Option(1, "number of the tool carrier", within=(1, 9999)),
    "sign_cec": Option(-1, "-1: correction, added to the command; 1: as a sign trial may find", (1, -1)),
    "sign_enc": Option(1, "1: error, added to the encoder; -1: as a sign trial may find", (1, -1)),
    "only": Option(
        "both", "both, or one of the two places of the vectors: then the other one is yours", ("both", "carrier", "traori")
    ),
}
LEADS = {
    "T": "I3 leads from the tool adapter to {1}, I2 from there to {0}, I1 closes the chain",
    "P": "I2 leads from the reference point of the machine to {0}, I3 from there to {1}, I4 closes the chain",
    "M": "I2 leads from the tool adapter to {0}, I3 from the reference point of the machine to {1}, I1 and I4 close the chains",
}
CARRIER = {"I1": 1, "I2": 4, "I3": 15, "I4": 18}
TRAORI = {
    "T": {
        "I1": "MD24500 $MC_TRAFO5_PART_OFFSET_1",
        "I2": "MD24560 $MC_TRAFO5_JOINT_OFFSET_1",
        "I3": "MD24550 $MC_TRAFO5_BASE_TOOL_1",
    },
    "P": {
        "I2": "MD24550 $MC_TRAFO5_BASE_TOOL_1",
        "I3": "MD24558 $MC_TRAFO5_JOINT_OFFSET_PART_1",
        "I4": "MD24500 $MC_TRAFO5_PART_OFFSET_1",
    },
    "M": {
        "I1": "MD24560 $MC_TRAFO5_JOINT_OFFSET_1",
        "I2": "MD24550 $MC_TRAFO5_BASE_TOOL_1",
        "I3": "MD24558 $MC_TRAFO5_JOINT_OFFSET_PART_1",
        "I4": "MD24500 $MC_TRAFO5_PART_OFFSET_1",
    },
}


def kind(request: Request) -> str:
    """job → T head, P table, M mixed."""
    work, tool = rotary_order(request.machine)
    return "M" if work and tool else "P" if work else "T"


def order(request: Request) -> list[str]:
    """job → rotary axes in the order of the vectors: of a head from the machine to the tool, of a table likewise."""
    work, tool = rotary_order(request.machine)
    return [*tool, *work]


def check(request: Request) -> None:
    """job → nothing. Raises InputError for one rotary axis, which no vector set here describes."""
    if request.options["kinematics"] == "yes" and len(request.machine.rotary) == 1:
        raise InputError(
            "--target siemens: found one rotary axis; allowed: none or two; use --set kinematics=no --set directions=no"
        )


def held(request: Request) -> list[Held]:
    """job → centres and directions of the rotary axes, CEC from every axis to every other one, ENC_COMP, reversal values."""
    machine, result = request.machine, []
    if machine.rotary and request.options["kinematics"] == "yes":
        for i, axis in enumerate(order(request)):
            for c in across(machine, axis):
                place = f"rotary axis {i + 1} ({axis}), {'XYZ'[c]} of its centre"
                result.append(centre(machine, axis, c, place, "centres", base=machine.axis(axis).point[c], increment=1e-4))
    if machine.rotary and request.options["directions"] == "yes":
        for i, axis in enumerate(order(request)):
            for c in across(machine, axis):
                place = f"V{i + 1} ({axis}), {'XYZ'[c]}"
                result.append(tilt(machine, axis, c, place, "directions", base=machine.axis(axis).direction[c]))
    if request.options["tables"] == "yes":
        axes = (*machine.linear, *machine.rotary)
        points = int(request.options["points"])
        for axis in axes:
            result += trims(request, f"ENC_COMP {axis}", axis, axis, points, sign=int(request.options["sign_enc"]), turning=MODULO)
        for by in axes:
            if by in machine.rotary and request.options["rotary_tables"] == "no":
                continue
            for out in machine.linear:
                if out != by:
                    sign = int(request.options["sign_cec"])
                    result += trims(request, f"CEC {by} to {out}", out, by, points, sign=sign, turning=MODULO)
        for axis in axes:
            result.append(reversal(request, f"MD32450 $MA_BACKLASH[0] of {axis}", axis))
    return result


def files(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, str]:
    """job, entries, numbers → cec.ini, enc_comp.ini, kinematics.mpf, reversal.txt."""
    machine, result = request.machine, {}
    names = {axis: f"AX{i + 1}" for i, axis in enumerate((*machine.linear, *machine.rotary))}
    cec, enc = [], []
    count = 0
    for table in tables(held):
        entries = rows(held, table)
        if table.startswith(("CEC", "ENC_COMP")):
            by = entries[0].axis
            assert by is not None
            placed = in_file(request, by, entries, int(request.options["points"]), MODULO)
            ats, entries = [at for at, _ in placed], [h for _, h in placed]
            modulo = int(by in machine.rotary and machine.axis(by).travel is None)
            step = (ats[-1] - ats[0]) / (len(ats) - 1)
            frame = {"STEP": step, "MIN": ats[0], "MAX": ats[-1]}
            if table.startswith("CEC"):
                cec += [f"$AN_CEC[{count},{i}]={numbers[h.place]:.6f}" for i, h in enumerate(entries)]
                cec += [f"$AN_CEC_INPUT_AXIS[{count}]=({names[by]})", f"$AN_CEC_OUTPUT_AXIS[{count}]=({names[table.split()[-1]]})"]
                cec += [f"$AN_CEC_{key}[{count}]={value:.9f}" for key, value in frame.items()]
                cec += [
                    f"$AN_CEC_DIRECTION[{count}]=0",
                    f"$AN_CEC_MULT_BY_TABLE[{count}]=0",
                    f"$AN_CEC_IS_MODULO[{count}]={modulo}",
                ]
                count += 1
            else:
                enc += [f"$AA_ENC_COMP[0,{i},{names[by]}]={numbers[h.place]:.6f}" for i, h in enumerate(entries)]
                enc += [f"$AA_ENC_COMP_{key}[0,{names[by]}]={value:.9f}" for key, value in frame.items()]
                enc.append(f"$AA_ENC_COMP_IS_MODULO[0,{names[by]}]={modulo}")
    if cec:
        result["cec.ini"] = _file("%_N_NC_CEC_INI", cec)
    if enc:
        result["enc_comp.ini"] = _file("%_N_AX_EEC_INI", enc)
    if any(h.table in ("centres", "directions") for h in held):
        result["kinematics.mpf"] = _kinematics(request, held, numbers)
    if reversals := rows(held, "reversal values"):
        result["reversal.mpf"] = "".join(f"$MA_BACKLASH[0,{names[h.place[-1]]}]={numbers[h.place]:.6f}\n" for h in reversals)
    return result


def _file(head: str, lines: Sequence[str]) -> str:
    return "\n".join([head, "CHANDATA(1)", *lines, "M17"]) + "\n"


def vectors(request: Request, shift: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
    """job, by how much the centres of the rotary axes have moved (mm) → what is added to I1 … I4."""
    one, two = shift
    if kind(request) == "T":
        return {"I2": one - two, "I3": two, "I1": -one}
    if kind(request) == "P":
        return {"I2": one, "I3": two - one, "I4": -two}
    return {"I1": -one, "I2": one, "I3": two, "I4": -two}


def _vectors(request: Request, numbers: Mapping[str, float]) -> dict[str, np.ndarray]:
    """job, numbers → what is added to I1 … I4, mm; nothing has no sign."""
    machine, shift = request.machine, []
    for i, axis in enumerate(order(request)):
        moved = np.zeros(3)
        for c in range(3):
            place = f"rotary axis {i + 1} ({axis}), {'XYZ'[c]} of its centre"
            if place in numbers:
                moved[c] = numbers[place] - point_of(machine, axis)[c]
        shift.append(moved)
    return {name: vector + 0.0 for name, vector in vectors(request, shift).items()}


def derived(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, Derived]:
    """job, entries, numbers → the vectors between the centers, by their places in the tool carrier and in TRAORI."""
    if not any(h.table == "centres" for h in held):
        return {}
    found, carrier = {}, int(request.options["carrier"])
    for name, vector in sorted(_vectors(request, numbers).items()):
        for c in range(3):
            where = f"$TC_CARR{40 + CARRIER[name] + c}[{carrier}]"
            if request.options["only"] == "traori":
                where = TRAORI[kind(request)][name]
            found[f"{where}, {name} {'XYZ'[c]}"] = Derived(float(vector[c]), "mm")
    return found


def _kinematics(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> str:
    machine, number = request.machine, int(request.options["carrier"])
    axes = order(request)
    lines = [f"; centres of {' and '.join(axes)} against machine.yaml, type {kind(request)}; mm in machine coordinates"]
    lines.append(f"; {LEADS[kind(request)].format(*axes)}")
    found = _vectors(request, numbers)
    if request.options["only"] in ("both", "carrier"):
        for name, vector in sorted(found.items()):
            lines += [
                f"$TC_CARR{40 + CARRIER[name] + c}[{number}]={vector[c]:.6f} ; fine offset of {name}, {'XYZ'[c]}" for c in range(3)
            ]
    if request.options["only"] in ("both", "traori"):
        lines.append("; TRAORI keeps the same vectors: add to the machine data (they have no fine offset)")
        for name, vector in sorted(found.items()):
            lines.append(f"; {TRAORI[kind(request)][name]} += {vector[0]:.6f}, {vector[1]:.6f}, {vector[2]:.6f}")
    for i, axis in enumerate(axes):
        table = axis in machine.workpiece_branch
        direction = np.array(machine.axis(axis).direction)
        for c in range(3):
            place = f"V{i + 1} ({axis}), {'XYZ'[c]}"
            direction[c] = numbers.get(place, direction[c])
        if f"V{i + 1} ({axis}), " not in "".join(numbers):
            continue
        entered = -direction if table else direction
        first = 7 + 3 * i
        lines += [f"$TC_CARR{first + c}[{number}]={entered[c]:.9f} ; V{i + 1} {axis}, {'XYZ'[c]}" for c in range(3)]
        lines.append(f"; MD2457{2 * i} $MC_TRAFO5_AXIS{i + 1}_1 = {entered[0]:.9f}, {entered[1]:.9f}, {entered[2]:.9f}")
    return "\n".join([*lines, "M17"]) + "\n"


def steps(request: Request) -> list[str]:
    """job → what a person does with the files."""
    result = ["Save an archive of the NC data first.", COMPARE, SIGN_TRIAL]
    if request.machine.rotary and (request.options["kinematics"], request.options["directions"]) != ("no", "no"):
        result += [
            "Run kinematics.mpf once in channel 1; it sets the fine offsets of the tool carrier.",
            "Enter the machine data that its comments name: a carrier and TRAORI that differ make a systematic error.",
        ]
    if request.options["tables"] == "yes":
        result += [
            "Switch SD41300 and MD32710 off, load cec.ini and enc_comp.ini, set MD32450 as reversal.mpf has it.",
            "Switch SD41300 and MD32710 on again.",
        ]
    return [*result, "Reset, approach the reference points, move every axis a little at low feed."]
