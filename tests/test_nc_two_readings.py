"""Blocks whose length or path is not known from what they say: refused by name, in every language that has them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.compensated import example
from support.nc_compensate_parts import ZERO, knowledge, rewritten
from support.readers import READERS, cell

from tango_cnc.compensate.fit import Known
from tango_cnc.nc.follow import Setup
from tango_cnc.nc.program import mark_text, tools_of
from tango_cnc.records import InputError

__all__ = ["knowledge"]
HEADS = {
    "klartext": "0 BEGIN PGM A MM\n1 TOOL CALL 1 Z S5000\n2 L X+0 Y+0 Z+5 A+0 C+0 R0 FMAX\n3 L X+10 Y+0 R0 F500\n",
    "siemens": "G71 G90 G17 G54\nG0 X0 Y0 Z5 A0 C0\nG1 X10 Y0 F500\n",
}


@pytest.mark.parametrize(
    ("name", "block", "words"),
    [
        ("klartext", "4 TOOL DEF 1 L+50 R+5", "a tool length that is written into the program"),
        ("klartext", "4 TOOL DEF 1 L50", "a tool length that is written into the program"),
        ("klartext", "4 CC X+20", "which other coordinate the control takes is not known"),
        ("klartext", "4 CC Y+0", "which other coordinate the control takes is not known"),
        ("klartext", "4 CC X+20 Y+0\n5 C X+30 Y+0 DR+ A+30", "an arc with a rotary axis; its path is not known"),
        ("klartext", "4 CR X+20 Y+10 R+10 DR- C+30", "an arc with a rotary axis; its path is not known"),
        ("klartext", "4 CC X+20 Y+0\n5 C X+30 Y+0 R+10 DR+", "has no radius"),
        ("klartext", "4 L X+10 R+5", "R and DR belong to an arc"),
        ("klartext", "4 L X+10 DR+", "R and DR belong to an arc"),
        ("siemens", "%_N_SUB_SPF", "a second program begins here"),
        ("siemens", "% MPF 200", "a second program begins here"),
        ("siemens", "G2 X20 Y0 CR5", "a radius without ="),
        ("siemens", "G2 X20 Y0 CR 5", "a radius without ="),
    ],
)
def test_a_block_of_which_nobody_knows_what_it_does_is_refused(name: str, block: str, words: str, knowledge: Known) -> None:
    with pytest.raises(InputError, match=words) as refused:
        rewritten(f"{HEADS[name]}{block}\n", knowledge, name)
    assert str(refused.value).startswith("line ") and "nothing was written" in str(refused.value)


@pytest.mark.parametrize(
    ("name", "block"),
    [
        ("klartext", "4 TOOL DEF 2"),
        ("klartext", "4 CC\n5 L X+10 Y+0"),
        ("klartext", "4 CC X+20 Y+0\n5 C X+30 Y+0 DR+"),
        ("klartext", "4 L X+20 R0 FMAX"),
        ("siemens", "G2 X20 Y0 CR=5"),
        ("siemens", "g2 x20 y0 cr=5"),
    ],
)
def test_those_beside_them_are_followed(name: str, block: str, knowledge: Known) -> None:
    assert len(rewritten(f"{HEADS[name]}{block}\n", knowledge, name)[0]) > 4


def test_the_mark_knows_the_tools_and_stands_in_the_head(knowledge: Known) -> None:
    """Compensated with 240 mm and given again with 200, it was copied as it is; so was a program with a mark between its blocks."""
    setup = Setup(example("trunnion")[0].machine, ZERO, 240.0)
    marks = {
        tools_of(s) for s in (setup, replace(setup, length=200.0), replace(setup, tools={1: 90.0}), replace(setup, tools={1: 91.0}))
    }
    assert len(marks) == 4 and tools_of(setup) == "TOOL 240"
    plain = "G21 G90 G17 G54\nG0 X0. Y0. Z5. A0. C0.\nG1 X10. F500\n"
    lines, _ = rewritten(plain, knowledge)
    with pytest.raises(InputError, match="another estimate, zero or tool length"):
        rewritten("\n".join(lines).replace("TOOL 150", "TOOL 200") + "\n", knowledge)
    pasted = plain + next(line for line in lines if "TANGO" in line) + "\nG1 X20.\n"
    with pytest.raises(InputError, match=r"line 4: .* stands in its head: take it out"):
        rewritten(pasted, knowledge)
    assert mark_text("0123", ZERO).endswith("C0")


def test_a_byte_order_mark_is_named(tmp_path: Path) -> None:
    cell(tmp_path)
    program = tmp_path / "part.nc"
    program.write_bytes(b"\xef\xbb\xbfG21 G90\nG0 X0. Y0. Z5.\n")
    with pytest.raises(InputError, match="found a byte order mark before the first character"):
        READERS["part.nc"].read(tmp_path)
