"""Programs of every language compensated: each part of each block leads where the block means to go, judged by the simulator."""

from __future__ import annotations

import io

import numpy as np
import pytest
from support.compensated import example
from support.nc_compensate_parts import CHORD, DECIMALS, LENGTH, ZERO, away, knowledge, rewritten, winding
from support.ncdialects import LANGUAGES, Meant, array, parts, program

from tango_cnc.compensate.fit import Known
from tango_cnc.nc.blocks import language
from tango_cnc.nc.follow import Setup
from tango_cnc.nc.program import Account, RewriteSettings, compensated, mark_text
from tango_cnc.records import Array, InputError

__all__ = ["knowledge"]

ROUNDED = 0.5 * 10**-DECIMALS
# mm: what rounding makes of three words, and of A and C at the farthest places from their axes.
LIMIT = 3**0.5 * ROUNDED + (165 + 120) * np.radians(ROUNDED)


def positions(places: Array) -> Array:
    """(n, 5) programmed X Y Z A C → (n, k) mm rad of the axes."""
    machine = example("trunnion")[0].machine
    result = np.zeros((len(places), len(machine.names)))
    for i, name in enumerate("XYZAC"):
        value = places[:, i] + ZERO[name] + (LENGTH if name == "Z" else 0.0)
        result[:, machine.column(name)] = value * (1.0 if i < 3 else np.pi / 180)
    return result


def worst(seed: int, name: str, found: Known) -> tuple[float, float, float]:
    """Seed, language → mm that the tip is away: as programmed, at the ends of parts, between them (beyond the ends' share)."""
    cell, world = example("trunnion")
    text, blocks = program(seed, name)
    lines, _ = rewritten(text, found, name)
    out = "\n".join(lines)
    assert "nan" not in out.lower() and "inf" not in out.lower()
    again, second = rewritten(out + "\n", found, name)
    assert again == lines and second.marked
    ends: list[tuple[Array, Array]] = []
    between: list[tuple[Array, Array]] = []
    last: dict[str, float] | None = None
    for block, became in zip(blocks, parts(out, blocks), strict=True):
        n = len(became)
        ends.append((array([block.at(j / n) for j in range(1, n + 1)]), array(became)))
        if not block.rapid and last is not None:
            way = array([last, *became])
            for share in (0.3, 0.5, 0.8):
                between.append((array([block.at((j + share) / n) for j in range(n)]), way[:-1] + share * np.diff(way, axis=0)))
        last = became[-1]
    meant, got = (positions(np.vstack(v)) for v in zip(*ends, strict=True))
    middle_meant, middle = (positions(np.vstack(v)) for v in zip(*between, strict=True))
    return (
        float(away(cell.machine, world, meant, meant).max()),
        float(away(cell.machine, world, got, meant).max()),
        float(away(cell.machine, world, middle, middle_meant).max()),
    )


@pytest.mark.few(1)
@pytest.mark.parametrize("name", LANGUAGES)
def test_every_part_of_every_block_goes_where_it_is_meant_to(name: str, knowledge: Known) -> None:
    before, after, between = worst(0, name, knowledge)
    assert after < LIMIT < before
    # An arc in parts leaves it by the chord, its correction once more by no more than that.
    assert between < 2 * CHORD + LIMIT


@pytest.mark.campaign
@pytest.mark.parametrize("name", LANGUAGES)
def test_a_thousand_random_programs_of_every_language(name: str, knowledge: Known) -> None:
    found = np.array([worst(seed, name, knowledge) for seed in range(250)])
    size = 1e3 * found.max(axis=0)
    print(f"{name}: {len(found)} programs, {size[0]:.1f} µm before, {size[1]:.3f} µm at ends of parts, {size[2]:.3f} µm between")
    assert found[:, 1].max() < LIMIT and found[:, 2].max() < 2 * CHORD + LIMIT


def test_a_zero_with_which_an_axis_would_leave_its_travel_is_refused(knowledge: Known) -> None:
    said = refusal("G21 G90 G17 G54\nG0 X0. Y0. Z5.\nG1 X398. F500\n", knowledge, "rs274")
    assert "line 3: found X398" in said and "machine would stand at X 401" in said and "-400 to 400" in said and "--zero" in said
    assert rewritten("G21 G90 G17 G54\nG0 X0. Y0. Z5.\nG1 X396. F500\n", knowledge)[1].compensated


def test_a_rotary_axis_that_would_leave_its_travel_is_refused(knowledge: Known) -> None:
    said = refusal("G21 G90 G17 G54\nG0 A0. C0.\nG0 X0. Y0. Z5.\nG0 A180.\n", knowledge, "rs274")
    assert "line 4: found A180" in said and "-120 to 120 deg" in said


def test_places_beyond_the_touches_are_counted(knowledge: Known) -> None:
    text = "G21 G90 G17 G54\nG0 X0. Y0. Z5.\nG1 X40. F500\nG1 X150. F500\nG1 X20. F500\n"
    account = rewritten(text, knowledge, touched={"X": (-100.0, 100.0)})[1]
    assert 0 < account.outside < account.count
    assert rewritten(text, knowledge, touched={"X": (-200.0, 200.0)})[1].outside == 0


def test_a_turn_is_not_looked_at_once_a_turn() -> None:
    block = Meant("b0b", dict.fromkeys("XYZAC", 0.0), {"X": 0.0, "Y": 0.0, "Z": 0.0, "A": 0.0, "C": 1440.0}, False)
    assert block.at(0.25)["C"] == 360


def refusal(text: str, found: Known, name: str) -> str:
    with pytest.raises(InputError) as error:
        rewritten(text, found, name)
    return str(error.value)


HEAD = {
    "rs274": "G21 G90 G17 G54\nG0 X0. Y0. Z5.\n",
    "macro_b": "G21 G90 G17 G54\nG0 X0. Y0. Z5.\n",
    "siemens": "G90 G71 G54\nG0 X=0 Y=0 Z=5\n",
    "klartext": "0 BEGIN PGM A MM\n1 L X+0 Y+0 Z+5 R0 FMAX\n",
}


@pytest.mark.parametrize(
    ("name", "line", "said"),
    [
        ("rs274", "G12 I5. F100", "G12; what this does to the path is not known"),
        ("rs274", "G43.2 H2", "further tool lengths"),
        ("rs274", "G44 H1", "taken off"),
        ("rs274", "G43 H0 Z5.", "H0"),
        ("rs274", "T3\nM6\nG0 X0. Y0.\nG43 H5 Z5.", "H5 with tool 3"),
        ("rs274", "G0 G1 X5.", "G0 and G1"),
        ("rs274", "G1 X5. R2.", "R2 in a line"),
        ("rs274", "G43 G49 H1 Z5.", "G43 and G49; which one is meant"),
        ("rs274", "G90 G91 G28 Z0\nG0 X0. Y0. Z5.", "G90 and G91; which one is meant"),
        ("macro_b", "G91 G28 Z0. G90\nG0 X0. Y0. Z5.", "G91 and G90; which one is meant"),
        ("rs274", "G90.1 G91.1 G2 X10. I5.", "G90.1 and G91.1; which one is meant"),
        ("rs274", "G2 X10. Y0. R5. R8.", "R twice"),
        ("rs274", "G2 X10. Y0. I5. I6.", "I twice"),
        ("rs274", "G43 H1 H2 Z5.", "H twice"),
        ("rs274", "T1 T2 M6", "T twice"),
        ("macro_b", "G1 X5.; Y5.", "a semicolon ends a block here"),
        ("rs274", "G3 X200.09 Y0. I100. J0.", "its end is 100.0900 mm from its center"),
        ("rs274", "X" + "9" * 400 + ".", "no machine goes there"),
        ("rs274", "G91 G28 Z5.", "G91 with Z5"),
        ("rs274", "G91 G28 Z0.\nG0 X1. Y1. Z1.", "G91 is still on"),
        ("rs274", "G0 C90.\nG53 G0 C0.\nG1 X5.", "where C is, no block has said"),
        ("rs274", "G28\nG0 X1. Y1. Z1.\nG1 X5.", "where A and C are, no block has said"),
        ("rs274", "G43 H2\nG1 X5.", "where Z is, no block has said"),
        ("rs274", "G18 G43 H2\nG2 X5. Z2.5 I2.5 K0", "Z or X has not been programmed"),
        ("rs274", "M70\nM72", "M72; what it switches back"),
        ("macro_b", "G234 H1", "tool center point"),
        ("macro_b", "G254", "follow the table"),
        ("macro_b", "G112", "polar and cylindrical"),
        ("macro_b", "G110", "additional work offsets"),
        ("macro_b", "G2.4 X1. Y1.", "G2.4; what this does"),
        ("macro_b", "G5.1 Q2", "Q1"),
        ("siemens", "G505", "one work offset"),
        ("siemens", "G500", "one work offset"),
        ("siemens", "G291", "another one"),
        ("siemens", "G147 X5", "soft approaches"),
        ("siemens", "D2", "further edges"),
        ("klartext", "5 L X+10 R0 F500 M118 X1", "handwheel"),
        ("klartext", "5 L X+10 X+11", "X twice"),
        ("klartext", "5 L C+90 FMAX\n6 L C+0 FMAX M91\n7 L X+5 F100", "where C is, no block has said"),
        ("klartext", "5 L X+10 M99", "cycles"),
        ("klartext", "5 L X+10 M97", "radius compensation"),
        ("klartext", '5 TOOL CALL "MILL" Z S3000', "whole number"),
        ("klartext", "5 TOOL CALL 5.1 Z S3000", "whole number"),
        ("klartext", "5 TOOL CALL 5 Y S3000", "another axis than Z"),
        ("klartext", "5 TOOL CALL 2 Z\n6 C X+10 Y+0 DR+", "no CC"),
        ("klartext", "5 TOOL CALL 2 Z\n6 CC", "X or Y has not been programmed"),
    ],
)
def test_what_would_lead_elsewhere_is_refused(name: str, line: str, said: str, knowledge: Known) -> None:
    assert said in refusal(HEAD[name] + line + "\n", knowledge, name)


def test_sinumerik_words_need_no_blanks_between_them(knowledge: Known) -> None:
    spaced = "G90 G71 G54\nG0 X0 Y0 Z5\nN5 G1 X40 Y=2.5 F500\nG3 X50 Y12.5 CR=10\n"
    tight = "G90G71G54\nG0X0Y0Z5\nN5G1X40Y=2.5F500\nG3X50Y12.5CR=10\n"
    one, two = (rewritten(text, knowledge, "siemens")[0] for text in (spaced, tight))
    assert [line.replace(" ", "") for line in one[1:]] == [line.replace(" ", "") for line in two[1:]]
    for word in ("X1EX2", "X1.2.3", "X1[2]", "X1(2)"):
        assert "line 3: found" in refusal(HEAD["siemens"] + f"G1{word}\n", knowledge, "siemens")


@pytest.mark.parametrize("comments", [10, 38, 39, 40, 41, 100])
def test_a_mark_after_many_comments_is_found_again(comments: int, knowledge: Known) -> None:
    text = "".join(f"(line {i})\n" for i in range(comments)) + HEAD["rs274"] + "G1 X40. F500\nM30\n"
    once, _ = rewritten(text, knowledge)
    twice, account = rewritten("\n".join(once) + "\n", knowledge)
    assert account.marked and twice == once != text.splitlines()


def test_a_tool_without_its_length_is_shorter(knowledge: Known) -> None:
    """SINUMERIK: after D0 the same words are lower by the tool; M6 after a T that only prepared it changes to the prepared one."""
    with_tool, without = (
        rewritten(f"G90 G71 G54\n{d}\nG0 X0 Y0 Z{z}\nG1 X40 F500\n", knowledge, "siemens")[0][-1].split()
        for d, z in (("D1", 5), ("D0", 5 + LENGTH))
    )
    assert with_tool[:-1] == without[:-1]
    assert float(without[-1][1:]) - float(with_tool[-1][1:]) == pytest.approx(LENGTH, abs=1e-6)
    lines, _ = rewritten("G90 G71 G54\nT1\nM6\nG0 X0 Y0 Z5\nT2\nG1 X40 F500\n", knowledge, "siemens")
    assert lines[-1].startswith("G1 X")  # T2 is only prepared: where X Y Z are is still known


def test_a_length_that_its_number_alone_names_acts(knowledge: Known) -> None:
    """G43 H2 without any T, and --tool 2=98.1: the default length was taken, and the tilt of an axis moved the tip by it."""
    text = "G21 G90 G17 G54\nG0 A40. C20.\nG0 X0. Y0.\nG43 H2 Z20.\nG1 X30. Y10. F500\nM30\n"
    machine = winding(example("trunnion")[0].machine)

    def run(tools: dict[int, float], length: float) -> list[str]:
        setup, settings = Setup(machine, ZERO, length, tools), RewriteSettings(chord=CHORD, decimals=DECIMALS)
        mark = mark_text("0123", ZERO)
        return list(compensated(io.StringIO(text), language("rs274"), setup, knowledge, settings, Account(), mark))

    assert run({2: 98.1}, LENGTH) == run({}, 98.1) == run({2: 98.1, 1: 300.0}, 10.0) != run({}, LENGTH)
    assert run({1: 98.1}, LENGTH) == run({}, LENGTH)


def test_a_semicolon_at_the_end_of_a_block_is_no_other_block(knowledge: Known) -> None:
    plain, ended = (rewritten(HEAD["macro_b"] + f"G1 X5. F500{end}\nY5.{end}\n", knowledge, "macro_b")[0] for end in ("", " ;"))
    assert [line.replace(" ;", "") for line in ended] == plain


def test_old_characters_come_out_as_they_went_in(tmp_path: object, knowledge: Known) -> None:
    text = b"G21 G90 (Fr\xe4sen)\nG0 X0. Y0. Z5.\nG1 X40. F500 (\xd8 10)\n".decode("utf-8", "surrogateescape")
    lines, _ = rewritten(text, knowledge)
    assert b"(Fr\xe4sen)" in "\n".join(lines).encode("utf-8", "surrogateescape")
