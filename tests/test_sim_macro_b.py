"""The Fanuc-like control: Custom Macro B by the manuals' examples, and its dangerous habits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_controller.faults import faults
from sim_controller.languages import Alarm, Silence, macro_b
from sim_controller.languages.macro_b.printing import field as printed_field
from sim_controller.motion import Motion
from sim_controller.probing import rig
from sim_controller.session import profile
from tango_cnc.files import read_cell
from tango_cnc.records import Artefact, Facet, InputError, World

HU40T = read_cell(Path(__file__).parent.parent / "examples" / "hu40t").machine
# C may turn for ever, as roll-over axes do
MACHINE = replace(HU40T, axes=tuple(replace(a, travel=(-100.0, 100.0)) if a.name == "C" else a for a in HU40T.axes))
LENGTH, RADIUS = MACHINE.probe.length, MACHINE.probe.tip_radius
TABLE = Artefact("one top", {"a": Facet("a", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))})
TOP = LENGTH + RADIUS  # Z at which facet a is touched


@dataclass
class Ran:
    """What came of a program."""

    out: bytes = b""
    alarm: Alarm | None = None
    events: list[tuple[str, Mapping[str, Any]]] = field(default_factory=list)
    motion: Motion | None = None

    @property
    def lines(self) -> list[str]:
        return [data["text"] for event, data in self.events if event == "output"]


def run(program: str, streamed: bool = False, fault: str | None = None, library: str = "", **settings: str) -> Ran:
    """Program text without its % → what the control did with it."""
    ran = Ran()

    def note(event: str, **data: Any) -> None:
        ran.events.append((event, data))

    motion = Motion(rig(MACHINE, TABLE, World()), note, faults=faults([fault] if fault else []))

    def punch(data: bytes) -> None:
        ran.out += data

    control = macro_b.Control(motion, profile(macro_b, MACHINE, settings), punch, note, library.splitlines())
    ran.motion = motion
    try:
        control.run(program.splitlines(), streamed)
    except Alarm as alarm:
        ran.alarm = alarm
    return ran


def value(expression: str, before: str = "") -> float:
    """What `#500=expression` makes of #500, by printing it."""
    ran = run(f"O1\n{before}\n#500={expression}\nPOPEN\nDPRNT[#500[44]]\nPCLOS\nM30")
    assert ran.alarm is None, ran.alarm
    return float(ran.lines[0].replace(" ", ""))


def alarm_of(program: str, **more: Any) -> str:
    ran = run(program, **more)
    assert ran.alarm is not None
    return ran.alarm.code


# --- DPRNT ---------------------------------------------------------------------------------------------------------------

EXAMPLE = "O1\n#2=128.47398\n#5=-91.2\n#30=123.456\nPOPEN\nDPRNT[X#2[53]*Y#5[53]*T#30[20]]\nPCLOS\nM30"


def test_the_manuals_example_of_dprnt() -> None:
    assert run(EXAMPLE).out == b"\x12X   128.474 Y-   91.200 T 23\n\x14"


def test_dprnt_without_padding() -> None:
    assert run(EXAMPLE, padding="none").out == b"\x12X128.474 Y-91.200 T23\n\x14"


@pytest.mark.parametrize(("line_end", "end"), [("lf", b"\n"), ("crlf", b"\r\n"), ("lfcrcr", b"\n\r\r")])
def test_line_ends_are_a_parameter(line_end: str, end: bytes) -> None:
    assert run(EXAMPLE, line_end=line_end).out == b"\x12X   128.474 Y-   91.200 T 23" + end + b"\x14"


def test_a_haas_expands_its_fields_and_ends_lines_with_cr() -> None:
    """Manual 96-8000: a whole part with more digits expands the field; leading blanks; a carriage return behind every block."""
    program = "O1\n#2=12345.5\n#5=-.5\nPOPEN\nDPRNT[X#2[44]*Y#5[44]]\nPCLOS\nM30"
    assert run(program, overflow="expanded", line_end="cr").out == b"\x12X 12345.5000 Y-   0.5000\r\x14"
    assert run(program).out == b"\x12X 2345.5000 Y-   0.5000\n\x14"


def test_a_control_of_several_skip_inputs_wants_its_own_skip_word() -> None:
    """M700V p. 555: G31.1 … G31.4, or P behind G31; the plain word is that of another input."""
    assert run("O1\nG31.2 X-5. F100.\nM30", skip_word="G31.2").alarm is None
    assert alarm_of("O1\nG31 X-5. F100.\nM30", skip_word="G31.2") == "P601"
    assert alarm_of("O1\nG31 X-5. F100.\nM30", skip_word="G31 P1") == "P601"
    assert alarm_of("O1\nG31.2 X-5. F100.\nM30") == "PS0010"


def test_the_feed_of_a_mitsubishis_g31_is_its_own() -> None:
    """M700V p. 547: F in the block, the modal one is not updated, P603 without."""
    assert "PS0011" in str(run("O1\nG31 X-5. F100.\nG1 X0.\nM30", skip_feed="own").alarm)
    assert run("O1\nG31 X-5. F100.\nG1 X0.\nM30").alarm is None
    assert "P603" in str(run("O1\nG1 X1. F100.\nG31 X-5.\nM30", skip_feed="own").alarm)
    assert "P603" in str(run("O1\nG1 X1. F100.\nG31 X[FIX[-5.5]]\nM30", skip_feed="own").alarm)


def test_a_haas_does_not_skip_faster_than_it_may() -> None:
    assert "faster than 2500" in str(run("O1\nG31 X-5. F2501.\nM30", fastest_skip="2500").alarm)
    assert run("O1\nG31 X-5. F2500.\nM30", fastest_skip="2500").alarm is None


@pytest.mark.parametrize(
    ("value", "text"), [(-0.4187, "X-.4187"), (0.504, "X.504"), (-90.0, "X-90."), (0.0, "X0."), (10.25, "X10.25")]
)
def test_a_haas_ngc_prints_no_zero_that_it_can_spare(value: float, text: str) -> None:
    program = f"O1\n#2={value:.4f}\nPOPEN\nDPRNT[X#2[44]]\nPCLOS\nM30"
    assert run(program, padding="bare").lines == [text]


@pytest.mark.parametrize(
    ("number", "form", "text"),
    [
        (12345.0, (4, 4), " 2345.0000"),  # the first digit is gone and nobody says so
        (-0.5, (4, 4), "-   0.5000"),
        (0.00005, (4, 4), "    0.0001"),
        (-0.00004, (4, 4), "     0.0000"[1:]),
        (7.0, (2, 0), "  7"),
        (0.25, (0, 3), " .250"),
        (None, (2, 1), "  0.0"),
    ],
)
def test_fields_of_dprnt(number: float | None, form: tuple[int, int], text: str) -> None:
    assert printed_field(number, *form, "spaces") == text


@pytest.mark.long
@given(st.floats(-9999, 9999), st.integers(0, 4))
def test_a_number_that_fits_is_printed_to_its_digits(number: float, decimals: int) -> None:
    text = printed_field(number, 4, decimals, "spaces")
    assert len(text) == 1 + 4 + (1 + decimals if decimals else 0)
    if abs(number) < 9999 - 0.5:
        assert float(text.replace(" ", "")) == pytest.approx(number, abs=0.5000001 * 10**-decimals)


def test_output_without_popen_goes_nowhere() -> None:
    ran = run("O1\nDPRNT[HELLO]\nM30")
    assert ran.out == b""
    assert ("lost", {"text": "HELLO", "why": "DPRNT without POPEN"}) in ran.events


@pytest.mark.parametrize("form", ["00", "54", "99"])
def test_more_than_eight_digits_or_none_are_no_format(form: str) -> None:
    assert alarm_of(f"O1\nPOPEN\nDPRNT[X#1[{form}]]\nM30") == "PS0114"


# --- expressions ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("expression", "result"),
    [
        ("1+2*3", 7),
        ("[1+2]*3", 9),
        ("10-4-3", 3),
        ("12/4/3", 1),
        ("7MOD4", 3),
        ("-[2+3]", -5),
        ("2*-3", -6),
        ("SIN[30]", 0.5),
        ("COS[60]", 0.5),
        ("TAN[45]", 1),
        ("ASIN[0.5]", 30),
        ("ACOS[-1]", 180),
        ("ATAN[1]", 45),
        ("ATAN[1]/[-1]", 135),
        ("ATAN[-1]/[1]", 315),
        ("SQRT[2]*SQRT[2]", 2),
        ("ABS[-4.5]", 4.5),
        ("ROUND[2.5]", 3),
        ("ROUND[-2.5]", -3),
        ("FIX[-1.7]", -1),
        ("FUP[-1.2]", -2),
        ("FIX[1.7]+FUP[1.2]", 3),
        ("6AND3", 2),
        ("6OR3", 7),
        ("6XOR3", 5),
        ("BCD[12]", 18),
        ("BIN[18]", 12),
        ("[[[[[1]]]]]", 1),
    ],
)
def test_expressions(expression: str, result: float) -> None:
    assert value(expression) == pytest.approx(result, abs=1e-4)


def test_variables_may_be_addressed_by_variables() -> None:
    assert value("#[#1+1]", "#1=100\n#101=42") == 42
    assert value("##1", "#1=101\n#101=43") == 43


@pytest.mark.parametrize(
    ("condition", "vacant", "zero"),
    [
        ("#101 EQ #0", True, False),
        ("#101 NE 0", True, False),
        ("#101 GE #0", True, True),
        ("#101 GT 0", False, False),
        ("#101 LE #0", True, True),
        ("#101 LT 0", False, False),
    ],
)
def test_vacant_is_not_nought_for_eq_and_ne_alone(condition: str, vacant: bool, zero: bool) -> None:
    for before, truth in (("", vacant), ("#101=0", zero)):
        assert value("#102", f"{before}\n#102=1\nIF[{condition}]THEN#102=2") == (2 if truth else 1)


def test_vacant_in_arithmetic_is_nought_and_copied_it_stays_vacant() -> None:
    assert value("#0+1") == 1
    assert value("#102", "#101=5\n#101=#0\n#102=1\nIF[#101EQ#0]THEN#102=2") == 2


@pytest.mark.parametrize(
    ("statement", "code"),
    [
        ("#100=1/0", "PS0112"),
        ("#100=SQRT[-1]", "PS0119"),
        ("#100=[[[[[[1]]]]]]", "PS0118"),
        ("#100=1+", "PS0114"),
        ("#100=[1", "PS0114"),
        ("#100=#1 EQ 2", "PS0114"),
        ("#400=1", "PS0115"),
        ("#0=1", "PS0116"),
        ("#5061=1", "PS0116"),
        ("#100=#9999", "PS0115"),
        ("#100=1 G0 X1.", "PS0127"),
        ("G0 X1. #100=1", "PS0127"),
        ("GOTO77", "PS0128"),
        ("WHILE[1 EQ 1]DO1", "PS0124"),
        ("WHILE[1 EQ 1]DO4\nEND4", "PS0126"),
        ("IF[1 EQ 1]", "PS0125"),
        ("G12", "PS0010"),
        ("G5.1 Q1", "PS0010"),
        ("G1 X1.", "PS0011"),
        ("G31 X1.", "PS0011"),
        ("G0 A10.", "PS0009"),
        ("G0 x10.", "PS0009"),
        ("G0 X", "PS0005"),
        ("G0 X1.2.3", "PS0007"),
        ("G0 X1234567890", "PS0003"),
        ("G43 H9", "PS0030"),
        ("M98 P1234", "PS0076"),
        ("G65 P9810 X1.", "PS0076"),
        ("G0 X-500.", "OT0501"),
        ("G0 X500.", "OT0500"),
        ("#3000=12(PROBE LOST)", "MC3012"),
        ("(NOTHING ENDS THIS)", "PS5010"),
    ],
)
def test_what_is_wrong_is_an_alarm(statement: str, code: str) -> None:
    end = "" if code == "PS5010" else "\nM30"
    assert alarm_of(f"O1\n{statement}{end}") == code


PIECES = [
    "#",
    "[",
    "]",
    "=",
    "-",
    "+",
    "/",
    "*",
    ".",
    "1",
    "20.5",
    "#101",
    "#5061",
    "#[",
    "SIN[",
    "ATAN[",
    "IF[",
    "THEN",
    " EQ ",
    "AND",
]
PIECES += [
    "GOTO",
    "WHILE[",
    "DO1",
    "END1",
    "DPRNT[",
    "POPEN",
    "[44]",
    "G0",
    "G31",
    "G65",
    "M98",
    "M99",
    "X",
    "Z",
    "P1",
    "F100.",
    "(",
    ")",
    "N5",
]


@pytest.mark.long
@settings(max_examples=150)
@given(st.lists(st.sampled_from(PIECES), max_size=9).map("".join) | st.text(max_size=12))
def test_no_text_makes_the_control_fail_otherwise(text: str) -> None:
    run(f"POPEN\n{text}\nM30", streamed=True)  # alarms are taken, anything else would pass through


# --- flow ----------------------------------------------------------------------------------------------------------------


def test_goto_finds_numbers_ahead_and_behind() -> None:
    program = "O1\n#101=0\nN10 #101=#101+1\nIF[#101 LT 3]GOTO10\n#1=30\nGOTO#1\n#101=99\nN30 POPEN\nDPRNT[#101[20]]\nM30"
    assert run(program).lines == ["  3"]


def test_loops_nest_and_are_left_when_their_condition_is_false() -> None:
    program = "O1\n#100=0\n#1=0\nWHILE[#1 LT 3]DO1\n#2=0\nWHILE[#2 LT 2]DO2\n#100=#100+1\n#2=#2+1\nEND2\n#1=#1+1\nEND1\n"
    assert run(program + "WHILE[#100 LT 0]DO1\n#100=-1\nEND1\nPOPEN\nDPRNT[#100[20]]\nM30").lines == ["  6"]


def test_subprograms_on_the_same_tape_and_macros_with_arguments() -> None:
    program = "O1\nPOPEN\nM98 P100 L2\nG65 P200 A1.5 B#0 X10 I3.\nDPRNT[#1[20]]\nM30\n"
    program += "O100\nDPRNT[SUB]\nM99\nO200\n#1=#1+#4\nDPRNT[A#1[21]*X#24[13]]\nIF[#2 NE #0]THEN#3000=1(B IS VACANT)\nM99\n"
    assert run(program).lines == ["SUB", "SUB", "A  4.5 X 0.010", "  0"]


def test_programs_that_the_control_has_stored_can_be_called() -> None:
    assert run("O1\nPOPEN\nG65 P9810 Z5.\nM30", library="O9810\nDPRNT[Z#26[21]]\nM99").lines == ["Z  5.0"]


def test_branches_are_refused_in_a_drip_fed_program() -> None:
    program = "POPEN\nIF[1 EQ 1]THEN#100=1\nDPRNT[BEFORE]\nIF[1 EQ 2]GOTO9\nDPRNT[AFTER]\nN9 M30"
    ran = run(program, streamed=True)
    assert ran.lines == ["BEFORE"]
    assert ran.alarm is not None and ran.alarm.code == "PS0123"
    assert run(program, streamed=True, branches_in_dnc="true").lines == ["BEFORE", "AFTER"]


def test_a_drip_fed_program_runs_before_it_has_all_come() -> None:
    arrived = []

    def lines():
        for line in ("POPEN", "DPRNT[ONE]", "DPRNT[TWO]", "M30", "DPRNT[NEVER]"):
            arrived.append(line)
            yield line

    out = []
    motion = Motion(rig(MACHINE, TABLE, World()))
    control = macro_b.Control(
        motion, macro_b.default_profile(MACHINE), lambda d: out.append((d, len(arrived))), lambda e, **d: None
    )
    control.run(lines(), streamed=True)
    assert out[1:] == [(b" ONE\n"[1:], 2), (b"TWO\n", 3)]
    assert arrived[-1] == "M30"


# --- axes ----------------------------------------------------------------------------------------------------------------


def position(program: str, **settings: str) -> dict[str, float]:
    """Machine coordinates at the end, mm and degrees."""
    ran = run(f"O1\n{program}\nM30", **settings)
    assert ran.alarm is None, ran.alarm
    shown = [data["position"] for event, data in ran.events if "position" in data]
    return shown[-1]


def test_a_number_without_a_decimal_point_counts_thousandths() -> None:
    assert position("G0 X1000 B10")["X"] == pytest.approx(1.0)
    assert position("G0 X1000 B10")["B"] == pytest.approx(0.01)
    assert position("G0 X100", calculator="true")["X"] == pytest.approx(100.0)
    assert position("#1=20\nG0 X#1")["X"] == pytest.approx(20.0)


def test_digits_beyond_the_least_increment_are_cut_and_variables_are_rounded() -> None:
    assert position("G0 X12.3456")["X"] == pytest.approx(12.345, abs=1e-12)
    assert position("G0 X[12.3456]")["X"] == pytest.approx(12.346, abs=1e-12)
    assert position("G0 X12.3456", increment="0.0001")["X"] == pytest.approx(12.3456, abs=1e-12)


def test_a_word_whose_variable_is_vacant_is_not_there() -> None:
    assert position("G0 X5. Y5.\nG0 X#1 Y7.") == pytest.approx({"X": 5, "Y": 7, "Z": 800, "B": 0, "C": 0, "S": 0})


def test_incremental_inch_offsets_and_machine_coordinates() -> None:
    assert position("G91 G0 X5.\nX5.")["X"] == pytest.approx(10)
    assert position("G20 G0 X1.")["X"] == pytest.approx(25.4)
    assert position("G0 X10.", g54="X:100,Y:-20")["X"] == pytest.approx(110)
    assert position("G53 G0 X10.", g54="X:100")["X"] == pytest.approx(10)
    assert position("G55 G0 X10.", g54="X:100")["X"] == pytest.approx(10)
    assert position("G43 H2 G0 Z500.", tool_lengths="2:120.5")["Z"] == pytest.approx(620.5)
    assert position("G43 H2 G0 Z500.\nG49", tool_lengths="2:120.5")["Z"] == pytest.approx(620.5)
    assert position("G43 H2 G0 Z500.\nG49", tool_lengths="2:120.5", length_moves="true")["Z"] == pytest.approx(500)
    assert position("G0 X10. Z500.\nG91 G28 Z0.")["Z"] == pytest.approx(800)


def test_spindle_orientation_is_not_an_axis() -> None:
    assert position("M19 R90.")["S"] == pytest.approx(90)
    assert alarm_of("O1\nG0 R90.\nM30") == "PS0009"


def ways(*blocks: str, **settings: str) -> list[tuple[float, float]]:
    """Blocks that move C from 0 → (degrees that it really turned, absolute position then) of each."""
    ran = run("O1\n" + "\n".join(f"G0 {block}" for block in blocks) + "\nM30", rollover="C", **settings)
    assert ran.alarm is None, ran.alarm
    turned = []
    at = 0.0
    for _, data in (entry for entry in ran.events if entry[0] == "rapid"):
        end = data["position"]["C"]
        turned.append((end - at, end % 360))
        at = end % 360
    return [(round(way, 9), round(position, 9)) for way, position in turned]


def test_roll_over_by_the_manuals_table() -> None:
    blocks = ["G90 C-150.", "G90 C540.", "G90 C-620.", "G91 C380.", "G91 C-840."]
    assert ways(*blocks) == [(-150, 210), (-30, 180), (-80, 100), (380, 120), (-840, 0)]


def test_half_a_turn_goes_in_the_positive_direction() -> None:
    assert ways("C180.") == [(180, 180)]


def test_the_sign_may_be_the_direction() -> None:
    assert ways("C-90.", "C45.", "C-30.", signed_direction="true") == [(-270, 90), (315, 45), (-15, 30)]


def test_without_roll_over_angles_are_taken_as_they_are() -> None:
    assert position("G0 C-270.")["C"] == pytest.approx(-270)
    assert position("G0 C270.\nC-90.")["C"] == pytest.approx(-90)


# --- probing -------------------------------------------------------------------------------------------------------------

DOWN = f"G0 Z{TOP + 10:.3f}\n"
PRINT = "POPEN\nDPRNT[#5061[44]*#5062[44]*#5063[44]]\n"


def test_the_skip_position_is_where_the_probe_triggered() -> None:
    ran = run(f"O1\n{DOWN}G31 Z{TOP - 5:.3f} F180.\n{PRINT}M30")
    assert ran.lines == [f"    0.0000     0.0000  {TOP:9.4f}"]


def test_a_miss_stores_the_end_point_and_says_nothing() -> None:
    ran = run(f"O1\n{DOWN}G0 X50.\nG31 Z{TOP - 5:.3f} F180.\n{PRINT}M30")
    assert ran.alarm is None
    assert ran.lines == [f"   50.0000     0.0000  {TOP - 5:9.4f}"]


def test_a_deflected_probe_ends_the_block_at_once_and_says_nothing() -> None:
    ran = run(f"O1\n{DOWN}G31 Z{TOP - 5:.3f} F180.\nG31 Z{TOP - 5:.3f}\n{PRINT}M30")
    assert ran.alarm is None
    assert float(ran.lines[0].split()[-1]) == pytest.approx(TOP - 0.00525, abs=1e-4)


def test_skip_positions_are_in_the_work_frame_and_the_difference_of_the_others_brings_them_home() -> None:
    program = f"G43 H1\nG31 Z{TOP - 5 - 100 - 7:.3f} F180.\n#1=#5063+#5023-#5043\n"
    program += "POPEN\nDPRNT[#5063[44]]\nDPRNT[#1[44]]\nDPRNT[#5003[44]]\n"
    ran = run(f"O1\nG53 {DOWN}{program}M30", g54="Z:100", tool_lengths="1:7")
    assert ran.alarm is None, ran.alarm
    skipped, machine, block_end = (float(line) for line in ran.lines)
    assert machine == pytest.approx(TOP, abs=1e-4)
    assert skipped == pytest.approx(TOP - 100, abs=1e-4)
    assert block_end == pytest.approx(TOP - 100 - 7 - 0.00525, abs=1e-4)  # the end point does not contain the tool length


def test_machine_positions_are_read_ahead_of_the_moves_unless_something_waits() -> None:
    for wait, seen in (("", 0.0), ("G53", 30.0), ("M0", 30.0)):
        ran = run(f"O1\nG0 X30.\n{wait}\n#1=#5021\nPOPEN\nDPRNT[#1[31]]\nM30")
        assert float(ran.lines[0]) == seen
    assert float(run("O1\nG0 X30.\n#1=#5021\nPOPEN\nDPRNT[#1[31]]\nM30", read_ahead="false").lines[0]) == 30.0


@pytest.mark.parametrize("block", ["G4 P0.1", "M66"])
def test_another_block_waits_where_the_profile_says_so(block: str) -> None:
    """A post may state it as `wait`, and no simulated control could be one on which it is right."""
    text = f"O1\nG0 X30.\n{block}\n#1=#5021\nPOPEN\nDPRNT[#1[31]]\nM30"
    assert [float(run(text, waits=waits).lines[0]) for waits in ("", "G4 P0.2", block)] == [0.0, 0.0, 30.0]


def test_the_probe_trips_on_the_way_and_the_program_is_over() -> None:
    ran = run(f"O1\nG0 Z{TOP - 5:.3f}\nM30")
    assert ran.alarm is not None and ran.alarm.code == "EX1001"
    assert ran.out == b""


def test_the_order_of_the_position_variables_is_the_machines() -> None:
    program = "O1\nG0 B10. C20.\nG53\n#1=#5024\nPOPEN\nDPRNT[#1[31]]\nM30"
    assert float(run(program).lines[0]) == pytest.approx(10)
    assert float(run(program, axes="X Y Z C B").lines[0]) == pytest.approx(20)


def test_power_may_fail_and_alarms_may_come() -> None:
    program = f"O1\n{DOWN}G31 Z{TOP - 5:.3f} F180.\nM30"
    with pytest.raises(Silence):
        run(program, fault="stop-after=1")
    assert alarm_of(program, fault="alarm-after=1") == "EX1002"


def test_clocks_count_simulated_time() -> None:
    ran = run("O1\n#3001=0\nG4 P2500\nG4 X1.5\n#1=#3001\nPOPEN\nDPRNT[#1[50]]\nM30")
    assert ran.lines == ["  4000"]


@pytest.mark.parametrize(
    ("name", "text"),
    [("incremnt", "1"), ("increment", "-1"), ("padding", "zeros"), ("read_ahead", "yes"), ("axes", "X Y Q"), ("g54", "X=1")],
)
def test_a_wrong_parameter_of_the_control_is_refused(name: str, text: str) -> None:
    with pytest.raises(InputError, match="--set"):
        profile(macro_b, MACHINE, {name: text})


@pytest.mark.parametrize(
    ("field", "text", "said"),
    [
        ("fastest_skip", "quick", "--set fastest_skip: found 'quick'; allowed: a number"),
        ("fastest_skip", "nan", "--set fastest_skip: found 'nan'; allowed: a finite number"),
        ("skip_feed", "mine", "--set skip_feed: found 'mine'; allowed: modal, own"),
        ("tool_lengths", "Z:187", "--set tool_lengths: found 'Z:187'; allowed: number:number pairs, e.g. 1:187.4"),
        ("increment", "0", "a number greater than 0"),
        ("read_ahead", "yes", "true or false"),
        ("g54", "X=1", "name:number pairs"),
    ],
)
def test_what_a_field_of_the_control_cannot_be_is_said(field: str, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        run("O1\nM30", **{field: text})


def test_a_field_that_is_a_text_is_taken_as_it_stands() -> None:
    assert profile(macro_b, MACHINE, {"skip_word": "G31P1"}).skip_word == "G31P1"
