"""Programs read back as text: the right ones pass, and one with anything dangerous in it is refused with the line that is wrong."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.blockcell import NORMALS, block, cell, machine
from support.readback import GOLDEN, bare, changed, counted, golden, lines_of, read_back, refused, renumbered

from postprocessors import load, names
from tango_cnc.cli import guarded, tango
from tango_cnc.plan import part, plan
from tango_cnc.readback import check
from tango_cnc.records import InputError, Plan, Turn

READ = names()


# What passes


@pytest.mark.few(5)
@pytest.mark.parametrize("post", READ)
def test_what_the_posts_write_passes(post: str) -> None:
    assert read_back(lines_of(post, golden()), golden(), post)


@pytest.mark.few(5)
@pytest.mark.parametrize(
    ("post", "options"),
    [
        ("fanuc", {"macros": "called"}),
        ("fanuc", {"decimals": 4, "rollover": "never", "misses": 5}),
        ("fanuc", {"rollover": "always", "unclamp": {"B": "M11"}, "clamp": {"B": "M10"}, "probe_on": "G65 P9832"}),
        ("haas", {"axis_numbers": {"X": 3, "Y": 1, "Z": 2, "B": 5, "C": 4}}),
        ("siemens", {"output": "_N_TANGO_MPF", "alarm": 0, "rotary": "AC", "decimals": 4}),
        ("siemens", {"probe_state": False, "trafoof": False, "probe_input": 2, "unclamp": {"B": "M11"}, "clamp": {"B": "M10"}}),
        ("heidenhain", {"shortest": False, "plane_reset": False, "tcpm_reset": False, "decimals": 3, "misses": 5}),
        ("heidenhain", {"axis_numbers": {"X": 1, "Y": 2, "Z": 3, "B": 4, "C": 5}, "unclamp": {"B": "M11"}, "clamp": {"B": "M10"}}),
        ("heidenhain", {"output": "TNC:\\A\\B.TXT", "positioning_feed": 999.5, "probe_on": "M64", "probe_off": "M65"}),
        ("fanuc", {"rollover": "signed"}),
        ("fanuc", {"probe_state": 1004}),
        ("haas", {"probe_state": 1028, "macros": "called"}),
        ("linuxcnc", {"unclamp": {"B": "M64 P2", "C": "M64 P3"}, "clamp": {"B": "M65 P2", "C": "M65 P3"}}),
        ("linuxcnc", {"wrapped": True, "probe_on": "M64 P1", "probe_off": "M65 P1"}),
    ],
)
def test_options_of_the_profile_pass(post: str, options: dict[str, Any]) -> None:
    assert read_back(lines_of(post, golden(), **options), golden(), post, **options)


@pytest.mark.few(4)
@pytest.mark.parametrize("post", READ)
def test_the_rest_of_a_run_passes(post: str) -> None:
    rest = part(golden(), [3, 5, 6])
    assert read_back(lines_of(post, rest), rest, post)


@pytest.mark.parametrize(
    "options", [{"clamp": {"B": "G91"}}, {"probe_on": "M17G20"}, {"probe_off": "G 68"}, {"orient": "G91 M19 R"}]
)
def test_words_of_the_profile_that_change_what_moves_mean_are_refused_whatever_the_post_says(options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="in the profile; allowed: words that switch something"):
        read_back(lines_of("fanuc", golden()), golden(), "fanuc", **options)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("IF[#1004NE0]GOTO9007\n", "", "moves without having asked whether the probe is deflected"),
        ("IF[#1004NE0]", "IF[#1004NE1]", "without having asked|stops the program though"),
        ("IF[#1004NE0]GOTO9007", "IF[#1004NE0]THEN#149=87", "goes on although the probe is deflected"),
    ],
)
def test_the_probe_is_asked_before_it_is_trusted(old: str, new: str, words: str) -> None:
    told = refused(changed(lines_of("fanuc", golden(), probe_state=1004), old, new), "fanuc", probe_state=1004)
    assert re.search(words, told), told


def test_the_probe_is_asked_when_the_axes_stand() -> None:
    lines = lines_of("fanuc", golden(), probe_state=1004)
    first = next(i for i, line in enumerate(lines) if line.startswith("G1 "))  # back from the first contact
    wait = next(i for i in range(first, len(lines)) if lines[i] == "G53")
    told = refused([*lines[:wait], *lines[wait + 1 :]], "fanuc", probe_state=1004)
    assert "#1004 is read before anything has waited for the axes to stand" in told


@pytest.mark.parametrize("before", ["SUPA D0 G1 X=$AA_IM", "SUPA D0 G1 MEAS=1 ", "SUPA D0 G0 B="], ids=["free", "guarded", "turn"])
def test_siemens_asks_the_probe_once_more_after_every_move(before: str) -> None:
    """The answer of before is of another place."""
    lines = lines_of("siemens", golden())
    moved = next(i for i, line in enumerate(lines) if line.startswith(before))
    asked = next(i for i in range(moved, len(lines)) if lines[i].startswith("IF $A_PROBE"))
    told = refused([*lines[:asked], *lines[asked + 1 :]], "siemens")
    assert "moves without having asked whether the probe is deflected" in told


def test_a_reset_line_that_states_no_plane_is_refused() -> None:
    reset = {"reset": "G40 G49 G69 G80 G90 G94 M5"}
    assert "something moves before G17 is stated, see controller.reset" in refused(lines_of("fanuc", golden(), **reset), **reset)


def test_a_dialect_that_nobody_reads_is_said_to_be_unread() -> None:
    assert check(lambda: iter(["; SOMETHING", "L Z+100 R0 FMAX"]), golden(), {}) == ("the program",)


ANGLES = [-180, -120, -90, -45, -30, 0, 15, 30, 60, 90, 135, 180, 270]
TOPOLOGIES = ("wCBXfZY(S)t", "wCAfYXZ(S)t", "wCXYfZ(S)t", "wXYfZ(S)t", "wXYfZCB(S)t", "wXYfZCA(S)t", "wCXYfZB(S)t")


def random_plans(seed: int, count: int) -> Iterator[Plan]:
    """seed → plans of machines, tables and strategies that nobody has thought of."""
    rng = np.random.default_rng(seed)
    while count:
        topology = str(rng.choice(TOPOLOGIES))
        rotary = sorted(set("ABC") & set(topology))
        point = tuple(rng.uniform(-150, 150, 3).round(3).tolist())
        m = machine(topology, {rotary[-1]: point} if rotary and rotary[-1] in topology.split("f")[0] else None)
        places = {name: rng.uniform(-1, 1, 3) for name in NORMALS}
        poses = [{n: float(rng.choice(ANGLES)) for n in (*rotary, "S")} for _ in range(rng.integers(1, 4))]
        whole = cell(m, block(rng.uniform(-150, 150, 3).round(3).tolist(), places), poses, standoff=float(rng.uniform(2, 25)))
        try:
            made = plan(whole, "leave-out")
        except InputError:
            continue
        count -= 1
        yield made


def random_plans_pass(seed: int, count: int) -> None:
    """Every plan in one dialect, one after the other."""
    for i, made in enumerate(random_plans(seed, count)):
        post = READ[i % len(READ)]
        assert read_back(lines_of(post, made), made, post)


@pytest.mark.few(0)
def test_random_plans_pass() -> None:
    random_plans_pass(1, len(READ))


@pytest.mark.campaign
def test_a_thousand_random_plans_pass() -> None:
    random_plans_pass(2, 1000)


# What does not


@pytest.mark.few(5)
@pytest.mark.parametrize("post", READ)
def test_nothing_happens_behind_the_marks_of_a_program_and_its_plan(post: str) -> None:
    lines = [f"{line} G0 Z-50" if "PROGRAM " in line else line for line in lines_of(post, golden())]
    assert refused(lines, post)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("#33=383.-#103\nG31 X#31 Y#32 Z#33 F3000.", "#33=383.-#103\nG0 X#31 Y#32 Z#33", "no line that a program of this kind"),
        ("G31 X#31 Y#32 Z#33 F3000.", "G1 X#31 Y#32 Z#33 F3000.", "found an unprotected move; allowed: one off the facet"),
        ("G1 X[#5021-1.5-#101] F3000.(OFF)\n", "", "the probe is at a facet|3 touches in a row that found nothing"),
        ("(BACK)\n#31=-113.-#101", "(BACK)\n#31=#5061-10.", "depends on where the probe was met"),
        ("[#5021-1.5-#101]", "[#5021+1.5-#101]", "found an unprotected move of 1.500 mm; allowed: .* straight off the facet"),
        ("[#5021-1.5-#101]", "[#5021-15.-#101]", "found an unprotected move of 15.000 mm; allowed: 1.5 mm"),
        ("[#5021-1.5-#101]", "[#5021-1.5]", "found an unprotected move of .* mm; allowed: 1.5 mm"),
        ("[#5021-1.5-#101]", "[-104.5-#101]", "found an unprotected move of .* mm; allowed: 1.5 mm"),  # of the nominal contact
        ("F3000.(OFF)\n", "F3000.(OFF)\nG1 X[#5021-1.5-#101] F3000.\n", "right after a measuring move|#5021 is read before"),
        ("(BACK)\n#31=-113.-#101", "(BACK)\n#31=-103.-#101", "found X -103.000 mm; the plan goes to X -113.000 mm"),
        ("#33=280.-#103", "#33=-280.-#103", r"found Z -280.000 mm; the plan goes to Z 280.000 mm"),
        ("#33=280.-#103", "#33=280.", r"found Z 483.500 mm"),
        ("GT0.02]GOTO9001", "GT200.]GOTO9001", r"the program goes on although a protected move has been stopped short in"),
        ("GE3]GOTO9003", "GE300]GOTO9003", "goes on after 3 touches in a row that found nothing"),
        ("LT0.02]THEN#110=0", "LT0.2]THEN#110=0", "the flag is 0 where the contact came at the end of the search zone"),
        ("LT0.02]THEN#110=0", "LT0.02]THEN#110=1", "3 touches in a row that found nothing"),
        ("LT5.]THEN#110=2", "LT4.]THEN#110=2", "just before the search zone"),
        ("GT0.005]GOTO9002", "GT9.]GOTO9002", "the work offset of X has changed"),
        ("G90 G53 G0 B-30.", "G90 G53 G0 B30.", "found B 30 deg; the plan turns to B -30 deg"),
        ("G90 G53 G0 B-30.", "G90 G53 G0 B-390.", r"found B -390.000; travel -95 … 95"),
        ("G90 G53 G0 B-30.", "G53 G0 B-30.", "no line that a program of this kind"),
        ("F180.", "F1800.", "the feed is 1800; allowed: 180 mm/min"),
        ("F3000.", "F30000.", "the feed is 30000; allowed: 3000 mm/min"),
        ("\nG21\n", "\nG20\n", "no line that a program of this kind"),
        ("IF[#4008NE49]THEN#3000=85(CANCEL TOOL LENGTH FIRST)\n", "", "G49 by itself may move Z by a tool length"),
        ("IF[#4022EQ51.1]", "IF[#4021EQ51.1]", r"before IF\[#4022EQ51.1\]THEN#3000=… has asked, see controller.must_be_off"),
        ("IF[#4011EQ51]THEN#3000=86(CANCEL G51 FIRST)\n", "", r"before IF\[#4011EQ51\]THEN#3000=… has asked"),
        ("IF[#4008NE49]", "IF[#4007NE49]", "#4007 is read before it has a value"),
        ("(NO WORDS STATED THAT SWITCH THE PROBE ON)", "M711", "no line that a program of this kind"),
        ("#110=6", "#110=7", "the start mark is"),
        ("#20=2.", "#20=3.", "the record is of touch 3; this is touch 2"),
        ("*Y#112[44]", "*Y#113[44]", "the record has Y"),
        ("G53\n#31=ABS[#5024", "#31=ABS[#5024", "#5024 is read before anything has waited"),
        ("M19 R90.", "M19 R180.", "found S 180 deg; the plan turns to S 90 deg"),
        ("M19 R0.", "M3 S1000", "no line that a program of this kind"),
        ("#20=1.", "#5221=1.", "found #5221 given a value"),
        ("PCLOS\n", "", "the program ends without end mark, PCLOS"),
        ("POPEN\n", "POPEN\nPOPEN\n", "a second POPEN"),
        ("PCLOS\n", "PCLOS\nPCLOS\n", "a second PCLOS"),
    ],
)
def test_what_is_dangerous_is_named(old: str, new: str, words: str) -> None:
    told = refused(changed(lines_of("fanuc", golden()), old, new))
    assert re.search(words, told), told
    assert re.match(r"program line \d+ '", told) and "The program is not the plan" in told


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (" G61 ", " G64 ", "G61 is missing"),
        ("G53 G1 X-113. Y-10. Z383. F3000.\n(TOUCH 1", "G0 Z383.\n(TOUCH 1", "no line that a program of this kind"),
        ("O<tango_free> CALL [-113.] [-10.] [318.] [3000.]\n", "", "the plan has a protected move .retract. here"),
        ("O<tango_free> CALL [-113.] [-10.] [318.] [3000.]", "G53 G1 Z318. F3000.", "the plan has a protected move .retract. here"),
        ("O<tango_free> CALL [-113.] [-10.] [318.]", "O<tango_free> CALL [-113.] [-10.] [-318.]", "found Z -318.000 mm"),
        ("(ABORT,PROBE MET SOMETHING ON ITS WAY)\n", "", "although a protected move has been stopped short in Z"),
        ("[-98.]", "[98.]", "found X 98.000 mm"),
        ("G53 G1 X-113. Y-10. Z383.", "G53 G1 X-113. Z-10. Z383.", "allowed: every axis once"),
        ("(ABORT,WORK OFFSET CHANGED)\n", "", "the work offset of X has changed"),
        ("(ABORT,THE WORK FRAME IS ROTATED)\n", "", "the work frame is rotated"),
        ("(ABORT,THE PROBE IS DEFLECTED)\n", "", "although the probe is deflected"),
        ("M66 E0 L0\n", "", "is read before M66 E0 L0"),
        ("(ABORT,NO CONTACT. IS THE PROBE ALIVE)\n", "", "3 touches in a row"),
        ("G38.3", "G38.2", "no line that a program of this kind"),
        ("#<_tango_flag> = 0", "#<_tango_flag> = 1", "the flag is 1 where nothing was touched; it"),
        ("G53 G0 C265.", "G53 G0 C-265.", "found C -265 deg; the plan turns to C 265 deg"),
        ("G90 G94", "G91 G94", "found the word G91"),
        ("O<tango_free> CALL [60.] [-40.] [412.3568] [3000.]\n", "", "the plan has the retract move"),
        ("M2", "M2\nG53 G0 Z0.", "after the end of the program"),
    ],
)
def test_what_is_dangerous_on_linuxcnc_is_named(old: str, new: str, words: str) -> None:
    told = refused(changed(lines_of("linuxcnc", golden()), old, new), "linuxcnc")
    assert re.search(words, told), told


SUMMED = "TG_SUM=TG_X+TG_Y+TG_Z+TG_B+TG_C+0.0000"
SHOWN = 'TG_TEXT=SPRINT("P2 H%D X%.4F Y%.4F Z%.4F B%.4F C%.4F S0.0000 K%.4F",TG_FLAG,TG_X,TG_Y,TG_Z,TG_B,TG_C,TG_SUM)'


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("TRAFOOF\n", "", "something moves before TRAFOOF"),
        ("CYCLE800()\n", "", r"something moves before CYCLE800\(\)"),
        ("G500\n", "", "something moves before G500"),
        ("TRANS\n", "", "something moves before TRANS"),
        ("MEAS=1 X-118.", "MEAS=2 X-118.", "found MEAS=2; the probe is at input 1"),
        ("IF $A_PROBE[1]", "IF $A_PROBE[2]", r"found \$A_PROBE\[2; the probe is at input 1"),
        ("($AC_MEA[1]<>0)", "($AC_MEA[2]<>0)", r"found \$AC_MEA\[2"),
        ("G1 MEAS=1 X-113. Y-10. Z280.", "G1 X-113. Y-10. Z280.", "found an unprotected move; allowed: one off the facet"),
        ("SUPA D0 G1 X=$AA_IM[X]-1.5 F3000.\n", "", "the probe is at a facet, and this does not take it off first"),
        ("X=$AA_IM[X]-1.5", "X=$AA_IM[X]+1.5", "found an unprotected move of 1.500 mm; allowed: .* straight off the facet"),
        ("X=$AA_IM[X]-1.5", "X-104.5", "found an unprotected move of .* mm; allowed: 1.5 mm"),
        ("X=$AA_IM[X]-1.5", "X=$AA_MM[X]-1.5", "found an unprotected move of .* mm; allowed: 1.5 mm"),  # after a miss
        ("TG_FLAG=0\nTG_X=$AA_IM[X]\n", "TG_FLAG=0\n", "the record has X 77777.000; the machine was at"),
        ("X=$AA_IM[X]-1.5", "X$AA_IM[X]-1.5", "no line that a program of this kind"),
        ("MEAS=1 X-113. Y-10. Z280.", "MEAS=1 X-113. Z-10. Z280.", "allowed: every axis once"),
        ("SUPA D0 G1 MEAS=1 X-113. Y-10. Z280.", "G1 MEAS=1 X-113. Y-10. Z280.", "no line that a program of this kind"),
        ("MEAS=1 X-98. ", "MEAS=1 X98. ", r"found X 98\.000 mm"),
        ("Z313. F3000.", "Z-313. F3000.", r"found Z -313\.000 mm"),
        ("B=AC(-30.)", "B=AC(30.)", "found B 30 deg; the plan turns to B -30 deg"),
        ("TG_TURN>0.01", "TG_TURN>9.", "although B has not arrived"),
        ("STOPRE\nTG_X=", "TG_X=", "is read before anything has waited"),
        ("TG_STOP_6\nSTOPRE\nIF $A_PROBE[1]<>0 GOTOF", "TG_STOP_6\nIF $A_PROBE[1]<>0 GOTOF", r"[$]A_PROBE is read before"),
        ("IF $P_TRAFO<>0 GOTOF TG_STOP_8\n", "", "before the control was asked for TRAFO .frame_check"),
        ("$P_TRAFO<>0", "$P_TRAFO==5", "although a transformation is on"),
        ("IF $MN_SCALING_SYSTEM_IS_METRIC<>1 GOTOF TG_STOP_9\n", "", "asked for METRIC .metric_check"),
        ("IF $MN_SCALING_SYSTEM_IS_METRIC<>1 GOTOF", "IF $MN_SCALING_SYSTEM_IS_METRIC==1 GOTOF", "though nothing has gone wrong"),
        ("+ABS($P_ACTFRAME[Y,RT])", "", "asked for Y RT .frame_check"),
        ("[Z,SC]-1.", "[Z,SC]-2.", "though nothing has gone wrong"),
        ("G4 F0.2\n", "", r"VA_IM.B. is read before its axis has come to rest"),
        ("[C,FI])>0.0001 GOTOF", "[C,FI])>9. GOTOF", "although a frame is left: TR of B"),
        ("+ABS($AC_DRF[Z])", "", "asked for Z DRF .frame_check"),
        ("[Y,RT])+ABS", "[Y,RT])*0.+ABS", "although a frame is left"),
        ("TG_WAY>0.0001", "TG_WAY>9.", "although a frame is left: TR of X"),
        (" OR ($P_ACTFRAME[Z,MI]<>0)", "", "asked for Z MI .frame_check"),
        ("Z=TG_WAY-0.5 F60.", "Z=TG_WAY-5. F60.", "found a step of Z -5 mm; allowed: one of Z -0.5 mm"),
        ("Z=TG_WAY-0.5 F60.", "Z=TG_WAY-0.5 F3000.", "the feed is 3000; allowed: 60"),
        ("ABS(TG_WAY-0.5)>0.02", "TG_WAY>0.52", "although"),
        ("TG_WAY=TG_WAY-$AA_IM[Z]\nIF ABS(TG_WAY-0.5)>0.02 GOTOF TG_STOP_2\n", "", "although"),
        ("TG_TURN=ABS($VA_IM[B]-", "TG_TURN=ABS($AA_IM[B]-", "although B has not arrived"),
        ("TG_SUM=TG_X+", "TG_SUM=0.1+TG_X+", "the sum in the record"),
        (f"{SUMMED}\n{SHOWN}", f"{SHOWN}\n{SUMMED}", "before it has a value|TG_TEXT was put together before its values were there"),
        ("TG_WAY<5.", "TG_WAY<4.", "just before the search zone"),
        ("TG_MISSES>=3 ", "TG_MISSES>=300 ", "3 touches in a row"),
        ("IF $A_PROBE[1]<>0 GOTOF TG_STOP_1\nSUPA", "IF $A_PROBE[1]==5 GOTOF TG_STOP_1\nSUPA", "although the probe is deflected"),
        ("OR (TG_SHORT>0.02)", "OR (TG_SHORT>2000.)", "stopped short in"),
        ("TG_LAG>1.", "TG_LAG>100.", "although the latched position of X has changed"),
        ("($AC_MEA[1]<>0) OR (TG_SHORT>0.02)", "TG_SHORT>0.02", "met something at its very end"),
        ("SETAL(65002)\nM0\nM30", "SETAL(65002)\nRET", "TG_STOP_2 is no place where this program stops"),
        ("IF TG_ERROR<>0 GOTOF TG_STOP_6\nSTOPRE", "STOPRE", "although nothing can be written"),
        (" G90 G94 M5\nD0", " G91 G94 M5\nD0", "no line that a program of this kind"),
        (",TG_C,TG_SUM)", ",TG_SUM)", "6 values for 7 places"),
        ("ENDIF\n", "", "an IF within an IF|no line that an IF may have"),
        ("ENDIF\n", "M0\nENDIF\n", "no line that an IF may have"),
        ("ENDIF\n", "IF TG_FLAG==1\nENDIF\n", "an IF within an IF"),
    ],
)
def test_what_is_dangerous_on_siemens_is_named(old: str, new: str, words: str) -> None:
    told = refused(changed(lines_of("siemens", golden()), old, new), "siemens")
    assert re.search(words, told), told


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("Q23 = +313.0000\nCALL LBL 1", "Q23 = -313.0000\nCALL LBL 1", r"found Z -313\.000 mm"),
        ("L B-30.0000 R0 FMAX M91", "L B+30.0000 R0 FMAX M91", "found B 30 deg; the plan turns to B -30 deg"),
        ("L B-30.0000 R0 FMAX M91", "L B-30.0000 FMAX", "no block that a program of this kind"),
        ("\nL B-30.0000", "\nL X-113.0000 Y-10.0000 Z+280.0000 R0 F2000 M91\nL B-30.0000", "no block that a program of this kind"),
        (
            "+280.0000\nCALL LBL 1\nQ21 = -113.0000",
            "+280.0000\nQ21 = -113.0000",
            "found Z 318.000 mm; the plan goes to Z 280.000 mm .back",
        ),
        ("F180 MB+1.5000", "F180 MB+0", "found MB 0 after a measuring move; allowed: 1.5 mm"),
        ("Q23 = +383.0000\nCALL LBL 1\n; TOUCH 1", "Q23 = +383.0000\n; TOUCH 1", "found Z 280.000 mm; the plan goes to Z 383"),
        ("PGM TANGO MM", "PGM TANGO INCH", "found no BEGIN PGM"),
        ("FN 12: IF +Q34 LT +0.001 GOTO LBL 11\n", "", "found a probing direction of length 0"),  # MB has been there already
        ("FN 11: IF +Q44 GT -0.5 GOTO LBL 90\n", "", "although a protected move has met something at its very end"),
        (
            "FN 11: IF +Q35 GT +0.0200 GOTO LBL 91\n",
            "",
            "although (positions come in inches|a protected move has been stopped short)",
        ),
        ("FN 11: IF +Q37 GT +1.0000 GOTO LBL 93", "FN 11: IF +Q37 GT +900.0 GOTO LBL 93", "beside the line of its measuring move"),
        ("REFERENCE SYSTEM: 1", "REFERENCE SYSTEM: 0", "no block that TCH PROBE 4 in machine coordinates"),
        ("F180 MB", "F1800 MB", "the feed is 1800; allowed: 180"),
        ("GT +2.5 GOTO LBL 92", "GT +250 GOTO LBL 92", "3 touches in a row"),
        ("FN 11: IF +Q35 GT +5.0000 GOTO LBL 22", "FN 11: IF +Q35 GT +4.0 GOTO LBL 22", "just before the search zone"),
        ("FN 12: IF +Q44 LT -0.5 GOTO LBL 21", "FN 12: IF +Q44 LT -1.5 GOTO LBL 21", "stops at a miss or an early contact"),
        ("FN 20: WAIT FOR SYNC\nFN 18: SYSREAD Q35", "FN 18: SYSREAD Q35", "is read before anything has waited"),
        ("GT +0.01 GOTO LBL 94", "GT +9.0 GOTO LBL 94", "although B has not arrived"),
        ("GT +0.01 GOTO LBL 94", "GT +0.01 GOTO LBL 95", "label 95 is no place where this program stops for good"),
        ("LBL 94\nSTOP ; ROTARY AXIS NOT IN PLACE\nM30", "LBL 94\nSTOP ; ROTARY AXIS NOT IN PLACE", "label 94 is no place"),
        ("GOTO LBL 22\nQ46 = 2\nLBL 22", "GOTO LBL 24\nQ46 = 2\nLBL 22", "label 24 is no place"),
        (
            "FN 11: IF +Q35 GT +5.0000 GOTO LBL 22\nQ46 = 2\nLBL 22",
            "LBL 22\nFN 11: IF +Q35 GT +5.0000 GOTO LBL 22\nQ46 = 2",
            "label 22 is no place",
        ),
        ("IDX5", "IDX4", "found axis number 4"),
        ("Q56 = 2\n", "Q56 = 3\n", "the record is of touch 3; this is touch 2"),
        ('STRING QS3 = " Y"', 'STRING QS5 = " Y"', "appears twice"),
        ('DECLARE STRING QS3 = " Y"', 'QS3 = " Y"', "is no string parameter"),
        ("CYCL DEF 10.1 ROT+0", "CYCL DEF 10.1 ROT+5", "no block that a program of this kind"),
        ("CYCL DEF 8.1\n", "CYCL DEF 8.1 X\n", "no block that a program of this kind"),
        ("CYCL DEF 7.2 Y+0.0\n", "", "found CYCL DEF 7.3 Z\\+0.0 without CYCL DEF 7.2 Y\\+0.0 before it"),
        ("CYCL DEF 8.0 MIRROR IMAGE\nCYCL DEF 8.1\n", "", "the program begins without CYCL DEF 8.1"),
        ("CYCL DEF 11.1 SCL 1\n", "", "the program begins without CYCL DEF 11.1 SCL 1"),
        ("M126\n", "", "the program begins without M126"),
        ("PLANE RESET STAY\n", "", "the program begins without PLANE RESET STAY"),
        ("CYCL DEF 13.1 ANGLE+90.0000\n", "", "found M19 without CYCL DEF 13.1 before it"),
        ("TNC:\\TANGO.TXT", "TNC:\\TABLE.PR", "allowed: those of the profile"),
        ("\nM30\nLBL 1 ", "\nLBL 1 ", "label 1, which is not after M30"),
    ],
)
def test_what_is_dangerous_in_klartext_is_named(old: str, new: str, words: str) -> None:
    told = refused(renumbered(changed(bare("heidenhain", golden()), old, new)), "heidenhain")
    assert re.search(words, told), told


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("post", "options", "behind", "reset"),
    [
        ("fanuc", {}, r"G1 .*\(OFF\)", "#109=0"),
        ("fanuc", {}, r"DPRNT\[P.*", "#109=0"),
        ("fanuc", {"macros": "called"}, "O7701.*", "#109=0"),  # in the guarded move
        ("siemens", {}, r"SUPA D0 G1 [XYZ]=.*", "TG_MISSES=0"),
        ("okuma", {}, r"G1 .*\(OFF\)", "VC102=0"),
        ("fagor", {}, "G1 .*", "P5=0"),
        ("centroid", {}, "G1 .*", "#29109 = 0"),
        ("mach4", {}, r"G1 .*\(OFF\)", "#109=0"),
        ("heidenhain", {}, "LBL 1 .*", "Q47 = 0"),
    ],
)
def test_a_dead_probe_stops_nothing_where_the_count_of_misses_is_forgotten_between_touches(
    post: str, options: dict[str, Any], behind: str, reset: str
) -> None:
    text = "\n".join(bare(post, golden(), **options))
    forgetful, times = re.subn(f"^({behind})$", rf"\1\n{reset}", text, flags=re.MULTILINE)
    assert times
    lines = forgetful.split("\n")
    told = refused(counted(post, lines), post, **options)
    assert "although no touch finds anything any more" in told, told


SWITCHES = {"unclamp": {"C": "M711"}, "clamp": {"C": "M710"}, "probe_on": "M720", "probe_off": "M721"}


@pytest.mark.few(14)
@pytest.mark.parametrize("post", READ)
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("M720\n", "", "something moves before M720 has switched the probe on"),
        ("M720\n", "M721\n", "something moves before M720 has switched the probe on"),
        ("M721\n", "", "the program ends before M721 has switched the probe off"),
        ("M711\n", "", "C turns before M711 has freed it"),
        ("M710\n", "", "something else happens before M710 holds C"),
        ("M710\n", "M711\n", "something else happens before M710 holds C"),
    ],
)
def test_the_words_of_the_profile_stand_where_they_belong(post: str, old: str, new: str, words: str) -> None:
    if load(post).language == "fagor" and old == "M721\n":  # the first ones stand in its stops
        old, new = "$ENDIF\nM721\n", "$ENDIF\n"
    if load(post).language == "rs274" and old == "M721\n":
        old, new = "\nM721\n(LOG,", "\n(LOG,"
    lines = changed(bare(post, golden(), **SWITCHES), old, new)
    assert words in refused(counted(post, lines), post, **SWITCHES)


@pytest.mark.few(2)
@pytest.mark.parametrize("post", ["centroid", "fagor", "heidenhain", "linuxcnc", "okuma", "siemens"])
def test_no_stop_leaves_the_probe_on(post: str) -> None:
    """On the others a stop is an alarm of the control, behind which nothing of the program is carried out."""
    lines = bare(post, golden(), **SWITCHES)
    at = [i for i, line in enumerate(lines) if line == "M721"]
    assert len(at) > 4, "the end of the program, and its stops"
    del lines[at[0] if post in ("fagor", "linuxcnc") else at[-1]]
    assert refused(counted(post, lines), post, **SWITCHES)


@pytest.mark.parametrize("post", ["fanuc", "haas"])
def test_an_alarm_between_the_probe_and_the_port_leaves_the_probe_on(post: str) -> None:
    """Also before the port is open; an alarm before both leaves nothing, and is refused as it stops a run that is well."""
    lines = lines_of(post, golden(), **SWITCHES)
    lines.remove(SWITCHES["probe_on"])
    at, on, alarm = lines.index("POPEN"), SWITCHES["probe_on"], "#3000=5(STOP)"
    assert "it leaves the probe on" in refused([*lines[:at], on, alarm, *lines[at:]], post, **SWITCHES)
    assert "nothing has gone wrong" in refused([*lines[:at], alarm, on, *lines[at:]], post, **SWITCHES)


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("post", "options", "close"),
    [
        ("fagor", {}, "#CLOSE"),
        ("linuxcnc", {}, "(LOGCLOSE)"),
        ("okuma", {}, "CLOSE C"),
        ("siemens", {"output": "/dev/ext/1"}, "EXTCLOSE("),
    ],
)
def test_no_stop_leaves_the_file_open(post: str, options: dict[str, Any], close: str) -> None:
    lines = bare(post, golden(), **options)
    at = [i for i, line in enumerate(lines) if line.startswith(close)]
    assert len(at) > 4
    for i in at[1:] if post in ("okuma", "siemens") else at[:1]:  # the first one there is the good end
        assert refused(lines[:i] + lines[i + 1 :], post, **options)


@pytest.mark.few(4)
@pytest.mark.parametrize("post", READ)
def test_every_header_says_what_to_do_after_a_stop(post: str) -> None:
    assert any("AFTER A STOP - RESET" in line for line in bare(post, golden())[:12])


@pytest.mark.few(6)
@pytest.mark.parametrize("post", READ)
@pytest.mark.parametrize("instead", ["", "M3"])
def test_nothing_moves_before_the_spindle_has_been_told_to_stand(post: str, instead: str) -> None:
    blocks = bare(post, golden())
    at, block = next((i, block) for i, block in enumerate(blocks) if re.search(r"\bM5$", block))
    lines = [*blocks[:at], block.removesuffix("M5") + instead, *blocks[at + 1 :]]
    told = refused(counted(post, lines), post)
    assert re.search(r"before M5 is stated|without M5|M3|no (line|block)|outside of start mark", told), told


@pytest.mark.parametrize("new", ["", "(CLAMP C M711)\n", "(CLAMP B M710)\n"])
def test_the_words_that_the_driver_of_grbl_takes_from_the_head_are_those_of_the_profile(new: str) -> None:
    lines = changed(bare("grbl", golden(), **SWITCHES), "(CLAMP C M710)\n", new)
    assert "the driver is given the words" in refused(lines, "grbl", **SWITCHES)


@pytest.mark.parametrize("word", ["M62", "M64 P1", "H10", "M010"])
def test_words_that_grbl_takes_for_something_else_are_no_clamps(word: str) -> None:
    with pytest.raises(InputError, match=rf"controller\.clamp: found 'C': '{word}'; allowed: with control: grblHAL, M words"):
        lines_of("grbl", golden(), clamp={"C": word}, unclamp={"C": "M11"})
    with pytest.raises(InputError, match=r"FluidNC has none"):
        lines_of("grbl", golden(), control="FluidNC", clamp={"C": "M10"}, unclamp={"C": "M11"})


@pytest.mark.parametrize(("post", "note"), [("okuma", "(A NOTE)"), ("okuma", ""), ("mach4", "(A NOTE)"), ("fagor", "; A NOTE")])
def test_a_line_that_says_nothing_may_stand_anywhere(post: str, note: str) -> None:
    """Between any two lines, also within a way out behind the end: an operator may write a note there at the control."""
    assert not refused([line for each in lines_of(post, golden()) for line in (each, note)], post)


def test_blocks_that_do_not_count_are_refused() -> None:
    lines = lines_of("heidenhain", golden())
    assert "found the block number 41" in refused([*lines[:40], *lines[41:]], "heidenhain")


def test_where_the_axes_stand_is_not_where_the_contact_was() -> None:
    lines = changed(bare("fanuc", golden()), "=#5061+#5021-#5041", "=#5041+#5021-#5041")
    assert re.search(r"the record has X .*; the machine was at ", refused(lines, "fanuc"))


def test_turning_near_the_table_is_refused_whatever_the_plan_says() -> None:
    """A plan that forgets its retract, and a program that does what it says."""
    x, y, z, *still = golden().touches[2].standoff
    turned = golden().touches[3].standoff[3:]
    turns = tuple(t if t.touch != 4 else Turn(4, (x, y, z - 70, *still), (x, y, z - 70, *turned)) for t in golden().turns)
    low = tuple(replace(t, over=t.standoff) for t in golden().touches)
    careless = replace(golden(), turns=turns, touches=low)
    with pytest.raises(InputError, match=r"B turns with the probe .* mm from what is on the table; retract before turning"):
        read_back(lines_of("fanuc", careless), careless, "fanuc")


def test_a_plan_beyond_a_travel_is_refused_whatever_the_plan_says() -> None:
    axes = tuple(replace(a, travel=(a.travel[0], 100.0)) if a.name == "Y" and a.travel else a for a in golden().machine.axes)
    narrow = replace(golden(), machine=replace(golden().machine, axes=axes))
    with pytest.raises(InputError, match=r"found Y 113\.000; travel -350 … 100"):
        read_back(lines_of("fanuc", narrow), narrow, "fanuc")


CODE = re.compile(
    r"G|O<tango_\w+> CALL|O\d+ |IF|\(ABORT|\(LOG|DPRNT|M19|M30|M2$|PCLOS|POPEN|#<|SUPA|TG_[A-Z]+=|SPOS|WRITE|EXT"
    r"|[LQFT]|C(?!YCL DEF 10)|M126"
)
MAY_BE_MISSING = {
    "#<_tango_b> = [#<_abs_b> - #<_b>]",  # nothing reads these two
    "#<_tango_c> = [#<_abs_c> - #<_c>]",
    "IF[#110NE0]THEN#109=0",  # misses that are not in a row count too: the program stops sooner
    "TG_MISSES=0",
    "TG_TURN=ABS(TG_TURN-360.*TRUNC(TG_TURN/360.+0.5))",  # a whole turn too many is no longer forgiven
    "#31=ABS[#31-360*FIX[#31/360+0.5]]",  # a whole turn too many is no longer forgiven
    "GOTO8999",  # a control that cannot jump then stops at the first jump that it needs, or at an alarm
    # The step of 0.5 mm: the line behind these two stops for an inch, a mirror image or a scaling as well, with other words.
    "IF[ABS[#31-0.0197]LT0.005]GOTO9011",
    "IF[ABS[#31-0.25]GT0.27]GOTO9012",
    "Q35 = ABS ( Q35 + 0.0000 )",  # the next line takes the sign away again
    "Q35 = ABS ( Q35 - 360 * INT ( Q35 / 360 + 0.5 ) )",
    "Q47 = 0",  # of those two in a program, the one behind contact
    "FN 11: IF +Q36 GT +14.9800 GOTO LBL 21",  # the control itself says that there was no contact, in Q44
    "FN 11: IF +Q35 GT +16.0000 GOTO LBL 93",  # farther away on the line of its move than it goes is a miss as well
    "FN 12: IF +Q34 LT +0.001 GOTO LBL 11",  # the control makes an error of a way of length 0
}


def _said_again(lines: list[str], at: int) -> bool:
    """Whether a line gives a Q parameter the number that it has already."""
    name, _, value = lines[at].partition(" = ")
    return bool(re.fullmatch(r"[+-][\d.]+", value)) and lines[at] == next(
        (line for line in reversed(lines[:at]) if line.startswith(f"{name} = ")), ""
    )


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("post", "every"),
    [
        *(("fanuc", 8), ("linuxcnc", 8), ("siemens", 16), ("heidenhain", 16)),
        *(pytest.param(post, 1, marks=pytest.mark.long) for post in ("fanuc", "linuxcnc", "siemens", "heidenhain")),
    ],
)
def test_no_line_that_moves_asks_stops_or_records_may_be_missing(post: str, every: int) -> None:
    lines = bare(post, golden())
    passed, first = set(), 0
    if post == "siemens":  # the probe is asked twice before anything moves
        first = next(i for i, line in enumerate(lines) if line.startswith("SUPA"))
    for at in [i for i, line in enumerate(lines) if i >= first and CODE.match(line)][::every]:
        if not refused(counted(post, [*lines[:at], *lines[at + 1 :]]), post) and not _said_again(lines, at):
            passed.add(lines[at])
    assert passed <= MAY_BE_MISSING


@pytest.mark.few(2)
@pytest.mark.parametrize("axis", [1, 2, 3])
def test_a_program_of_heidenhain_asks_of_every_axis_whether_it_is_scaled(axis: int) -> None:
    lines = bare("heidenhain", golden())
    at = lines.index(f"FN 18: SYSREAD Q35 = ID210 NR4 IDX{axis}")
    unasked = renumbered([*lines[:at], *lines[at + 2 :]])
    assert "before ID210 NR4 has said that nothing is scaled" in refused(unasked, "heidenhain")
    every = [line for line in lines if "ID210 NR4" not in line and line != lines[at + 1]]
    assert "before ID210" not in refused(renumbered(every), "heidenhain", scaling_check=False), "where nobody wants it asked"


def test_a_program_of_heidenhain_asks_whether_an_axis_is_mirrored() -> None:
    """A mirrored Z would send the first move, up, down to the table; that cycle 8 without axes cancels it is unconfirmed."""
    lines = bare("heidenhain", golden())
    at = lines.index("FN 18: SYSREAD Q35 = ID210 NR3")
    assert "before ID210 NR3 has said that nothing is mirrored" in refused(
        renumbered([*lines[:at], *lines[at + 2 :]]), "heidenhain"
    )
    unheard = [*lines[:at], lines[at], *lines[at + 2 :]]
    assert "mirrors an axis" in refused(renumbered(unheard), "heidenhain"), "asked, and nobody looks at the answer"


@pytest.mark.few(1)
@pytest.mark.parametrize("which", [0, 1])
def test_a_control_that_reads_ahead_gets_both_empty_blocks_before_it_is_asked_where_it_is(which: int) -> None:
    lines = bare("haas", golden(), wait="G103 P1")
    assert not refused(lines, "haas", wait="G103 P1")
    pairs = [i for i in range(len(lines) - 1) if lines[i] == lines[i + 1] == ";"]
    assert pairs
    for i in pairs[:: max(len(pairs) // 6, 1)]:
        assert refused([*lines[: i + which], *lines[i + which + 1 :]], "haas", wait="G103 P1")


# At the command line


def call(*arguments: object) -> int:
    return guarded(tango.main, [str(a) for a in arguments], prog_name="tango", standalone_mode=False)


OWN = """
from dataclasses import replace
from postprocessors import load

fanuc = load("fanuc")
POST = replace(fanuc, title="Ours", retract=lambda job, leg: ["(UP)"])
"""


def test_a_program_that_is_refused_is_not_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(GOLDEN / "cell", tmp_path / "cell")
    (tmp_path / "cell" / "own.py").write_text(OWN)
    assert call("plan", "-C", tmp_path / "cell", "--post", tmp_path / "cell" / "own.py") == 2
    error = capsys.readouterr().err
    assert "program line" in error and "something moves before a step of Z" in error
    assert not (tmp_path / "cell" / "program").exists()


@pytest.mark.few(0)
def test_every_post_is_read_back_or_said_to_be_unread(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for post in names():
        assert call("plan", "-C", GOLDEN / "cell", "--post", post, "--out", tmp_path / post) == 0, post
        assert ("has not been read back" in capsys.readouterr().out) == (post not in READ), post
