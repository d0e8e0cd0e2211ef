"""NC programs compensated: the tip goes where the program meant, nothing is invented, what cannot be followed is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from support.compensated import ROOT, example
from support.nc_compensate_parts import (
    CHORD,
    DECIMALS,
    LENGTH,
    ZERO,
    away,
    knowledge,  # noqa: F401  fixtures
    rewritten,
)
from support.ncprograms import ends, rs274

from tango_cnc.cli import tango
from tango_cnc.compensate.fit import Known
from tango_cnc.nc.blocks import Modal, language, languages
from tango_cnc.records import InputError


def judged(seed: int, found: Known) -> tuple[float, float]:
    """Seed → largest mm away of the ends of all blocks, before and after, as the simulator sees it."""
    cell, world = example("trunnion")
    text = rs274(seed)
    lines, _ = rewritten(text, found)
    out = "\n".join(lines)
    assert "nan" not in out.lower() and "inf" not in out.lower()
    twice, account = rewritten(out + "\n", found)
    assert twice == lines and account.marked
    meant, rows = ends(text, cell.machine, ZERO, LENGTH)
    got, _ = ends(out, cell.machine, ZERO, LENGTH)
    # The end of every block is the end of its last part: found by counting the parts that follow each block's own line.
    keep, line = [], 0
    sources = text.splitlines()
    first = next(i for i, t in enumerate(lines) if "TANGO" in t)
    rest = lines[:first] + lines[first + 1 :]
    counts = []
    for i in range(len(sources)):
        begin, line = line, line + 1
        following = sources[i + 1] if i + 1 < len(sources) else None
        while line < len(rest) and following is not None and not _same(rest[line], following):
            line += 1
        counts.append(line - begin)
    numbers = np.cumsum(counts)
    _, got_rows = ends("\n".join(rest), cell.machine, ZERO, LENGTH)
    got, _ = ends("\n".join(rest), cell.machine, ZERO, LENGTH)
    index = {row: i for i, row in enumerate(got_rows)}
    for row in rows:
        keep.append(index[int(numbers[row - 1])])
    before, after = away(cell.machine, world, meant, meant), away(cell.machine, world, got[keep], meant)
    return float(before.max()), float(after.max())


def _same(line: str, source: str) -> bool:
    """Whether a line of the result is the beginning of this source block: all but its coordinates is there."""
    bare = re.sub(r"[XYZABCIJ]-?[\d.]+", "", source).replace("G2", "G1").replace("G3", "G1").split()
    there = re.sub(r"[XYZABCIJ]-?[\d.]+", "", line).replace("G2", "G1").replace("G3", "G1").split()
    return bare == there and bool(bare)


LIMIT = CHORD + 3**0.5 * 0.5 * 10**-DECIMALS + 0.15 * np.radians(0.5 * 10**-DECIMALS) * 1e3


@pytest.mark.few(0)
@pytest.mark.parametrize("seed", range(6))
def test_random_programs_go_where_they_mean_to(seed: int, knowledge: Known) -> None:
    before, after = judged(seed, knowledge)
    assert after < LIMIT < before


@pytest.mark.campaign
def test_a_thousand_random_programs(knowledge: Known) -> None:
    worst = [judged(seed, knowledge) for seed in range(1000)]
    print(f"largest {1e3 * max(b for b, _ in worst):.1f} µm before, {1e3 * max(a for _, a in worst):.3f} µm after")
    assert max(a for _, a in worst) < LIMIT


@pytest.mark.parametrize(
    ("name", "line", "said"),
    [
        ("rs274", "G41 D1", "radius compensation"),
        ("rs274", "G91", "incremental"),
        ("rs274", "G20", "inches"),
        ("rs274", "G81 X1 Y1 Z-5 R2", "canned cycles"),
        ("rs274", "G93", "inverse time"),
        ("rs274", "G1 X#3", "variables"),
        ("rs274", "G1 X[1+2]", "variables"),
        ("rs274", "o100 call", "not known"),
        ("rs274", "/G1 X5", "skipped"),
        ("rs274", "G55", "one work offset"),
        ("rs274", "G92 X0", "shifted"),
        ("rs274", "G2 X10. Y0. I1. J0.", "from its center"),
        ("rs274", "G1 B5.", "no axis B"),
        ("rs274", "G1 X5,3", "not known"),
        ("rs274", "G38.2 Z-5 F100", "probing"),
        ("macro_b", "G43.4 H1", "tool center point"),
        ("macro_b", "G68.2 X0. Y0.", "tilted"),
        ("macro_b", "M98 P100", "subprograms"),
        ("macro_b", "G1 X5", "decimal point"),
        ("macro_b", "G65 P9810", "macros"),
        ("macro_b", "WHILE [#1 LT 5] DO1", "jumps and loops"),
        ("macro_b", "GOTO 10", "jumps and loops"),
        ("siemens", "TRAORI", "tool center point"),
        ("siemens", "CYCLE81(1,2,3)", "cycles"),
        ("siemens", "TRANS X=5", "frames"),
        ("siemens", "X=IC(5)", "AC( ) and IC( )"),
        ("siemens", "R1=5", "variables"),
        ("klartext", "5 L X+5 Y+3 RL F500", "radius compensation"),
        ("klartext", "5 L IX+5", "incremental"),
        ("klartext", "5 FUNCTION TCPM", "tool center point"),
        ("klartext", "5 PLANE SPATIAL SPA+0", "tilted"),
        ("klartext", "5 CYCL DEF 200 DRILLING", "cycles"),
        ("klartext", "5 L X+Q1", "not followed"),
        ("klartext", "5 M128", "tool center point"),
    ],
)
def test_what_cannot_be_followed_is_refused_by_its_name(name: str, line: str, said: str, knowledge: Known) -> None:
    head = {"klartext": "0 BEGIN PGM A MM\n1 L X+0 Y+0 Z+5 R0 FMAX\n", "siemens": "G90 G71 G54\nG0 X=0 Y=0 Z=5\n"}
    text = head.get(name, "G21 G90 G17 G54\nG0 X0. Y0. Z5.\n") + line + "\n"
    with pytest.raises(InputError, match="line 3: found") as error:
        rewritten(text, knowledge, name)
    assert said in str(error.value)


SAME = {
    "rs274": "G21 G90 G17 G54\nG0 X0. Y0. Z5.\nN10 G1 X40. Y10. F500 (cut)\nG3 X50. Y20. I0. J10.\nG0 Z50. M9\nM30\n",
    "macro_b": "%\nO7\nG21 G90 G17 G54\nG0 X0. Y0. Z5.\nN10 G1 X40. Y10. F500 (CUT)\nG3 X50. Y20. R10.\nG0 Z50. M9\nM30\n%\n",
    "siemens": "G90 G71 G17 G54\nG0 X0 Y0 Z5\nN10 G1 X=40 Y10 F500 ; cut\nG3 X50 Y20 CR=10\nG0 Z50 M9\nM30\n",
    "klartext": "0 BEGIN PGM A MM\n1 L X+0 Y+0 Z+5 R0 FMAX\n2 L X+40 Y+10 R0 F500 ; cut\n3 CC X+40 Y+20\n4 C X+50 Y+20 DR+\n"
    "5 L Z+50 R0 FMAX M9\n6 END PGM A MM\n",
}


@pytest.mark.parametrize("name", languages())
def test_every_language_leads_to_the_same_places(name: str, knowledge: Known) -> None:
    lines, account = rewritten(SAME[name], knowledge, name)
    text = "\n".join(lines)
    last = [line for line in lines if re.search(r"X[+=]?\+?5\d\.", line)][-1]
    x, y = (float(re.search(rf"{a}=?([-+]?[\d.]+)", last)[1]) for a in "XY")  # type: ignore[index]
    assert (x, y) == pytest.approx((50, 20), abs=0.1) and (x, y) != (50, 20)
    assert "cut" in text.lower() and account.arcs == 1 and "TANGO COMPENSATED" in text
    assert rewritten(text + "\n", knowledge, name)[0] == lines
    numbers = [int(line.split()[0]) for line in lines] if name == "klartext" else []
    assert numbers == list(range(len(numbers)))


@pytest.mark.long
def test_the_command_says_what_it_did_and_keeps_the_source(tmp_path: Path) -> None:
    cell = tmp_path / "cell"
    import shutil

    shutil.copytree(ROOT / "examples" / "three_axis_calibrated", cell)
    assert CliRunner().invoke(tango, ["simulate", "-C", str(cell)]).exit_code == 0
    source, target = tmp_path / "part.nc", tmp_path / "out.nc"
    source.write_bytes(SAME["rs274"].replace("\n", "\r\n").encode())
    common = ["compensate", str(source), "-C", str(cell), "-o", str(target), "--simulated"]
    lacking = CliRunner().invoke(tango, common)
    assert isinstance(lacking.exception, InputError) and "--zero" in str(lacking.exception) and not target.exists()
    done = CliRunner().invoke(tango, [*common, "--zero", "X=0,Y=0,Z=50", "--diff", str(tmp_path / "diff.txt")])
    assert done.exit_code == 0, done.exception
    assert "µm after" in done.output and source.read_bytes() == SAME["rs274"].replace("\n", "\r\n").encode()
    assert b"\r\n" in target.read_bytes() and "- N10 G1 X40." in (tmp_path / "diff.txt").read_text()
    itself = CliRunner().invoke(tango, [*common[:-2], str(source), "--simulated", "--zero", "X=0,Y=0,Z=0"])
    assert isinstance(itself.exception, InputError)
    source.write_text("G21 G90\nG0 X0. Y0. Z5.\nG41 D1\n")
    before = target.read_bytes()
    refused = CliRunner().invoke(tango, [*common, "--zero", "X=0,Y=0,Z=50"])
    assert isinstance(refused.exception, InputError) and "part.nc: line 3" in str(refused.exception)
    assert target.read_bytes() == before and not list(tmp_path.glob(".out*"))


@pytest.mark.parametrize(
    ("placed", "assumed"), [("G0 X0. Y0. Z50.\n", {"A", "C"}), ("G0 X0. Y0. Z50. A30.\n", {"C"}), ("G0 X0. Z50. A30. C0.\n", set())]
)
def test_rotary_axes_that_no_block_has_placed_are_said(knowledge: Known, placed: str, assumed: set[str]) -> None:
    """The control may have them anywhere, and the corrections are those of 0."""
    _, account = rewritten(f"G21 G90 G17 G54\nG0 Y0.\n{placed}G1 X5. F500.\n", knowledge)
    assert account.assumed == assumed


def test_m_functions_of_the_builder_are_said_with_their_first_line(knowledge: Known) -> None:
    """M21 mirrors X on some controls and switches a relay on others: nobody knows it from here."""
    program = "G21 G90 G17 G54\nG0 X0. Y0. Z50. A0. C0.\nM21\nM3 S900\nM8\nG1 X5. F500. M110\nM21\nG1 X6. M9\nM30\n"
    text, account = rewritten(program, knowledge)
    assert account.unknown == {"M21": 3, "M110": 6} and text.count("M21") == 2


@pytest.mark.parametrize("name", ["rs274", "macro_b", "siemens"])
@pytest.mark.parametrize("end", ["M2", "M30", "M02"])
def test_what_stands_after_the_end_of_a_program_is_refused(name: str, end: str) -> None:
    """No control goes there, so it was never compensated for anybody."""
    modal, read_line = Modal(), language(name).read
    read_line(f"G1 X1. {end}", 1, modal, "XYZAC")
    for nothing in ("%", "", "(a note)" if name != "siemens" else "; a note"):
        assert read_line(nothing, 2, modal, "XYZAC").kind == "none"
    with pytest.raises(InputError, match=r"line 3: found G1 X2\.; the program has ended with M"):
        read_line("G1 X2.", 3, modal, "XYZAC")


@pytest.mark.parametrize("head", ["O0002", "O0002 (SECOND)", ":2"])
def test_a_second_program_in_the_file_is_refused(head: str) -> None:
    modal, read_line = Modal(), language("macro_b").read
    assert read_line(head, 1, modal, "XYZAC").kind == "none"
    read_line("G0 X1.", 2, modal, "XYZAC")
    with pytest.raises(InputError, match="a second program begins here: make a file of each"):
        read_line(head, 3, modal, "XYZAC")


@pytest.mark.parametrize(
    ("name", "program", "why"),
    [
        ("klartext", "0 BEGIN PGM A MM\n1 L X+1 R0 FMAX M30\n2 L X+2", "the program has ended with M30"),
        ("klartext", "0 BEGIN PGM A MM\n1 L X+1 R0 FMAX\n2 M2\n3 L X+2", "the program has ended with M2"),
        ("klartext", "0 BEGIN PGM A MM\n1 L X+1 R0 FMAX\n2 END PGM A MM\n3 L X+2", "the program has ended with END PGM"),
        ("klartext", "0 BEGIN PGM A MM\n1 L X+1 R0 FMAX M30\n2 END PGM A MM\n0 BEGIN PGM B MM", "a second program begins here"),
        ("macro_b", "%\nO1\nG0 X1.\n%\nG1 X2.", "the program has ended with %"),
        ("rs274", "%\nG0 X1\n%\nG1 X2", "the program has ended with %"),
        ("siemens", "G0 X1\nM17\nG1 X2", "the program has ended with M17"),
    ],
)
def test_what_stands_after_any_end_is_refused_at_its_line(name: str, program: str, why: str) -> None:
    modal, read_line, lines = Modal(), language(name).read, program.splitlines()
    for number, line in enumerate(lines[:-1], 1):
        read_line(line, number, modal, "XYZAC")
    with pytest.raises(InputError, match=f"line {len(lines)}: .*{why}"):
        read_line(lines[-1], len(lines), modal, "XYZAC")


def test_other_spindles_and_groups_of_feed_leave_the_path_alone(knowledge: Known) -> None:
    program = "G71 G90 G17 G54\nFGROUP(X, Y, Z)\nG0 X0 Y0 Z50 A0 C0\nM2=3 S2=8000\nG1 X5 F500 M1=5\nM17\n"
    lines, account = rewritten(program, knowledge, "siemens")
    assert not account.unknown
    assert all("".join(lines).count(word) == 1 for word in ("FGROUP(X, Y, Z)", "M2=3 S2=8000", "M1=5", "M17")), lines
