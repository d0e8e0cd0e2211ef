"""The Mach3 program with its macros in Basic on the simulated control, and the habits of that control."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from support import controls
from support.controls import Ran, assert_as_it_happened, golden, run_on

from sim_controller.languages import Alarm, mach3
from sim_controller.languages.mach3.basic import Script
from sim_controller.motion import Motion, Note
from tango_cnc.records import InputError, Plan, World


@pytest.fixture(scope="module")
def made() -> Plan:
    return golden()


def lines_of(made: Plan, **options: Any) -> list[str]:
    return controls.lines_of("mach3", made, **options)


def library(made: Plan, **options: Any) -> list[str]:
    return controls.library_of("mach3", made, **options)


def run(
    lines: list[str],
    made: Plan,
    world: World | None = None,
    fault: str | None = None,
    stuck: bool = False,
    stored: list[str] | None = None,
    **settings: Any,
) -> Ran:
    """program, true machine, a fault, probe deflected at first, the macros folder, the profile → what came of it."""
    known, macros = replace(mach3.default_profile(made.machine), **settings), library(made) if stored is None else stored

    def build(motion: Motion, punch: Callable[[bytes], None], note: Note) -> mach3.Control:
        return mach3.Control(motion, known, punch, note, macros)

    return run_on(build, lines, made, None, world, fault, stuck)


# The program


def test_every_touch_is_recorded_where_it_happened(made: Plan) -> None:
    ran = run(lines_of(made), made)
    assert not ran.why
    assert_as_it_happened(ran, made)


@pytest.mark.long
def test_records_are_machine_coordinates_whatever_the_offset(made: Plan) -> None:
    assert run(lines_of(made), made, g54={"X": 11.5, "Y": -3.25, "Z": 100.25}).lines == run(lines_of(made), made).lines


def test_positions_that_come_in_whole_thousandths_are_no_changed_work_offset(made: Plan) -> None:
    """Three differences of rounded positions are summed: each may be one count off."""
    ran = run(lines_of(made), made, rounded=0.001, g54={"X": 11.5003, "Y": -3.2506, "Z": 100.2504})
    assert not ran.why and ran.flags(made) == [1] * len(made.touches)


@pytest.mark.long
def test_a_miss_and_an_early_contact_are_flagged(made: Plan) -> None:
    assert run(lines_of(made), made, World(facets={"4": -8.0})).flags(made)[-1] == 0
    assert run(lines_of(made), made, World(facets={"4": 7.0})).flags(made)[-1] == 2


def stopped(ran: Ran, text: str, moves: int) -> None:
    """It stopped with these words, and nothing moved after that although the control went on for some lines."""
    assert text in ran.why
    said = next(i for i, (event, _) in enumerate(ran.events) if event == "stop")
    later = ran.events[said:]
    assert any(event == "block" for event, _ in later), "lines that were read ahead are carried out"
    assert not any(event in ("feed", "skip", "contact") for event, _ in later)
    assert ran.moves == moves


def test_contact_on_the_way_stops_for_good(made: Plan) -> None:
    ran = run(lines_of(made), made, World(facets={"top": 40.0}))
    assert "PROBE MET SOMETHING ON ITS WAY" in ran.why and ran.flags(made) == [1]
    stopped(ran, "PROBE MET SOMETHING", ran.moves)


def test_a_dead_probe_stops_it(made: Plan) -> None:
    ran = run(lines_of(made, misses=2), made, World(facets={facet: -30.0 for facet in ("1", "top", "3", "4", "5")}))
    assert ran.flags(made) == [0]
    stopped(ran, "NO CONTACT. IS THE PROBE ALIVE", ran.moves)


def test_a_probe_that_is_on_lets_nothing_move(made: Plan) -> None:
    ran = run(lines_of(made), made, stuck=True)
    assert "PROBE IS DEFLECTED" in ran.why and ran.moves == 0 and not ran.lines


def test_a_probe_that_comes_on_between_touches_stops_it(made: Plan) -> None:
    ran = run(lines_of(made), made, fault="bounce-after=2")
    assert "PROBE MET SOMETHING ON ITS WAY" in ran.why and ran.flags(made) == [1, 1]


def test_without_its_macros_nothing_moves_but_the_spindle(made: Plan) -> None:
    """Mach3 skips an M code that has no macro, and says nothing."""
    ran = run(lines_of(made), made, stored=[])
    assert not ran.lines and all(data["position"]["X"] == 0 == data["position"]["B"] for e, data in ran.events if e == "rapid")
    assert not any(event in ("feed", "skip", "contact") for event, _ in ran.events)


@pytest.mark.few(0)
@pytest.mark.parametrize("code", range(880, 886))
def test_one_macro_that_is_missing_stops_at_the_next_call(made: Plan, code: int) -> None:
    """Mach3 skips its calls in silence; nothing moves then that its macros move, and nothing is put on record."""
    lines, own = lines_of(made), library(made)
    names = [line for line in own if line.startswith("m88")] + ["end"]
    first = own.index(name := f"m{code}.m1s")
    after = names[names.index(name) + 1]
    ran = run(lines, made, stored=own[:first] + own[own.index(after) if after in own else None :])
    whole = run(lines, made)
    call = next(i for i, line in enumerate(lines) if line.split()[0] == f"M{code}")
    assert "A MACRO IS MISSING OR A LINE WAS LEFT OUT" in ran.why
    done = sum(line.startswith("M885 ") for line in lines[:call])
    assert ran.lines == whole.lines[: done + (code != 880)]
    assert ran.moves < whole.moves


def test_a_program_that_is_started_in_the_middle_stops_before_it_moves(made: Plan) -> None:
    lines = lines_of(made)
    middle = [i for i, line in enumerate(lines) if line.startswith("(TOUCH")][1]
    begin = [line for line in lines[: lines.index("M881")] if not line.startswith("M880")]
    ran = run([*begin, *lines[middle:]], made)
    assert "A MACRO IS MISSING OR A LINE WAS LEFT OUT" in ran.why and ran.moves == 0


def test_a_macro_of_another_set_refuses(made: Plan) -> None:
    """One old file in the folder is enough to stop, whichever it is."""
    other, own = library(made, readings="C:\\other.txt"), library(made)
    for code in range(881, 886):
        names = [line for line in own if line.startswith("m88")]
        parts = {
            name: own[own.index(name) : own.index(names[i + 1]) if i + 1 < len(names) else None] for i, name in enumerate(names)
        }
        old = f"m{code}.m1s"
        first = other.index(old)
        parts[old] = other[first : first + len(parts[old])]
        ran = run(lines_of(made), made, stored=[line for lines in parts.values() for line in lines])
        assert "MACROS ARE NOT THOSE OF THIS PROGRAM" in ran.why and not ran.flags(made)[1:], code


def test_a_move_shorter_than_the_control_takes_stops_with_a_text_before_the_control_complains(made: Plan) -> None:
    """RS274/NGC: no G31 to a place nearer than 0.254 mm; here the first move is made a second time."""
    lines = lines_of(made)
    at = lines.index("M881") + 1
    again = [*lines[:at], "#114=4", "M881", *lines[at:]]
    stopped(run(again, made), "START IS TOO NEAR TO THE TARGET", 2)
    text = "\n".join(library(made))
    unasked = re.sub(r"\n *If Sqr[^\n]*< 0\.26 Then\n.*?End If", "", text, count=1, flags=re.DOTALL)
    assert unasked != text
    assert "too close" in run(again, made, stored=unasked.splitlines()).why


def test_a_machine_in_inches_is_found_at_the_step(made: Plan) -> None:
    ran = run(lines_of(made), made, inches=True)
    stopped(ran, "POSITIONS ARE IN INCHES", 1)


def test_a_windows_that_writes_a_decimal_comma_is_found_before_anything_moves(made: Plan) -> None:
    ran = run(lines_of(made), made, comma=True)
    assert "WINDOWS WRITES A DECIMAL COMMA" in ran.why and not ran.flags(made) and not ran.out
    assert not [event for event, _ in ran.events if event in ("skip", "contact", "collision")]


def test_a_board_that_probes_along_one_axis_only_is_found(made: Plan) -> None:
    ran = run(lines_of(made), made, one_axis=True)
    assert "PROBE MET SOMETHING ON ITS WAY OR UNITS ARE NOT MM" in ran.why and not ran.flags(made)


def test_the_path_of_the_file_goes_nowhere_but_into_a_string(made: Plan) -> None:
    assert any('Open "D:\\cnc\\mine.txt" For Append As #1' in line for line in library(made, readings="D:\\cnc\\mine.txt"))
    for bad in ('C:\\a.txt" & Kill("b', "a.txt", "C:\\..\\a.txt", "C:\\Mäch3\\a.txt"):
        with pytest.raises(InputError, match=r"controller\.readings"):
            lines_of(made, readings=bad)
        library(made, readings=bad)  # is made before anybody looks at the path


@pytest.mark.parametrize("post", ["mach3", "mach4"])
@pytest.mark.parametrize(
    "options", [{"unclamp": {"B": "M0883"}}, {"probe_on": "M880"}, {"probe_off": "M881 P1"}, {"orient": "M883 R"}]
)
def test_words_of_the_profile_that_would_call_its_own_macros_are_refused(made: Plan, post: str, options: dict[str, Any]) -> None:
    with pytest.raises(
        InputError, match=r"controller\..*: found 'M.*'; allowed: not M0?88\d, M880 to M88\d travel with the program"
    ):
        controls.lines_of(post, made, **options)


# The control


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("O100 IF [#1 EQ 1]", "Unknown word starting with O"),
        ("G38.3 X1 F100", "Unknown G code"),
        ("G31 X1", "zero feed rate"),
        ("G0 A5", "axis is not enabled"),
        ("#5000=1", "Parameter number out of range"),
        ("#1=[1 EQ 1]", "Bad format"),
    ],
)
def test_what_it_complains_of(line: str, complaint: str, made: Plan) -> None:
    assert complaint in run(["G21 G90", line], made).why


def test_who_does_not_wait_reads_what_was_before(made: Plan) -> None:
    macro = [
        "m900.m1s",
        'Code "G0 X5"',
        "Call SetVar(1, GetOEMDRO(83))",
        "While IsMoving()",
        "Wend",
        "Call SetVar(2, GetOEMDRO(83))",
    ]
    writes = [
        "m901.m1s",
        'Open "a.txt" For Append As #1',
        'Print #1, Format(GetVar(1), "0.0") & " " & Format(GetVar(2), "0.0")',
        "Close #1",
    ]
    assert run(["G21 G90", "M900", "M901"], made, stored=[*macro, *writes]).lines == ["0.0 5.0"]


@pytest.mark.few(0)
def test_a_macro_reads_a_program_of_any_length() -> None:
    """M880 looks for its start mark in the program: 2991 lines were "the macro never ends"."""
    lines, text = ["G0 X1"] * 20_000 + ["(THE MARK)"], ""
    host = {
        "open": lambda *_: None,
        "eof": lambda number: not lines,
        "line input": lambda number: lines.pop(0),
        "close": lambda number: None,
        "message": lambda found: said.append(found),
    }
    said: list[str] = []
    text = 'Open "A" For Input As #1\nWhile Not EOF(1)\nLine Input #1, found\nWend\nClose #1\nMessage found'
    Script(text, host).run()
    assert said == ["(THE MARK)"]
    with pytest.raises(Alarm, match="never ends"):
        Script("n = 1\nWhile n > 0\nn = n + 1\nWend", {}).run()


def test_basic() -> None:
    said: list[str] = []
    text = """
' a remark
Dim A
A = 2 + 3 * 4 - 6 / 3
If A > 11 And Not (A = 13) Then
  B = "yes " & A
Else
  B = "no"
End If
N = 0
While N < 3
  N = N + 1
  If N = 2 Then
    Exit Sub
  End If
  Message B & "/" & Format(-1.25, "0.0") & Mid("abcdef", InStr("abcdef", "c"), 2) ' and one behind
Wend
"""
    Script(text, {"message": said.append}).run()
    assert said == ["yes 12/-1.2cd"]
    for wrong in ("Goto x", "A = Foo(1)", "A = B", "If 1 Then", "A = (1", "While 1 = 1\nWend"):
        with pytest.raises(Alarm):
            Script(wrong, {}).run()
