"""What travels with a program is read back too: Mach3's macros, Mach4's scripts, Heidenhain's mask.

For Mach3, whose macros make every move, there are mutants of the macros as of the programs, judged by the simulated control.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterator

import pytest
from support.readback import Beside, golden, lines_of, refused
from support.rehearsed import Endless, Trace, carried_out, compared, short, worlds

from postprocessors import companions, load
from tango_cnc.records import Plan

EDITS = [
    *(("G31", "G1"), ("G1", "G31"), ("G1", "G0"), ("G53 G0", "G0"), ("G90", "G91"), ("G21", "G20"), ("Exit Sub", "")),
    *(("<>", "="), ("<", ">"), (">", "<"), (">=", ">"), (" = ", " <> "), (" Or ", " And "), (" + ", " - "), (" - ", " + ")),
    *((" * ", " / "), (" / ", " * "), ("Abs(", "("), ("Sqr(", "("), ("Sin(", "Abs("), ('" X"', '" Y"'), ('" Z"', '" X"')),
    *(("PX", "X"), ("PY", "PX"), ("X", "Y"), ("Y", "Z"), ("Flag", "Missed"), ("DRO(8", "DRO(80"), ("GetOEMDRO", "GetVar")),
    *(("OEMLED", "OEMDRO"), ("0.0000", "0"), ("0.0000", "0.00"), ("1003", "1000"), ("Param1()", "1"), ("IsMoving()", "1 = 2")),
    *(("Append", "Input"), ("Mark", "Text"), ('"B"', '"C"'), ("Code", "Message"), ("SetVar", "GetVar")),
]
FREE = re.compile(r"\+ (0\.[5-9]|1\.\d|2) \* W[XYZ]")  # how far off a facet is up to the post, within these mm


def beside(post: str, made: Plan | None = None) -> dict[str, list[str]]:
    return companions(load(post), made or golden(), {})


def edited(post: str, file: str, old: str, new: str, made: Plan | None = None) -> dict[str, list[str]]:
    """→ what travels with the program, with one thing in one file otherwise."""
    files = beside(post, made)
    text = "\n".join(files[file])
    assert old in text
    return files | {file: text.replace(old, new, 1).split("\n")}


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("m881.m1s", '"G90 G21 G31"', '"G90 G21 G1"', "found an unprotected move; allowed: one off the facet"),
        ("m881.m1s", '"G90 G21 G31"', '"G91 G21 G31"', "found a step along X Y Z"),
        ("m881.m1s", '"G90 G21 G31"', '"G90 G20 G31"', "no line that a macro"),
        ("m881.m1s", "Z = GetVar(103)", "Z = GetVar(102)", r"found Z|#102 is read"),
        ("m881.m1s", "X - GetVar(131)", "X - GetVar(132)", "found X|depends on"),
        ("m881.m1s", '"0.0000") & " F"', '"0") & " F"', "no line that a macro"),
        ("m881.m1s", " Or GetOEMLED(825) <> 0", "", "goes on although a protected move has met something at its very end"),
        ("m881.m1s", "Off > GetVar(110)", "Off > 10", "goes on although a protected move has been stopped short"),
        ("m881.m1s", "Abs(GetOEMDRO(84) - Y) + ", "", "stopped short in Y"),
        ("m881.m1s", "If GetVar(150) <> 0 Then\n  Exit Sub\nEnd If\n", "", "would go on after a stop"),
        (
            "m881.m1s",
            "X = GetOEMDRO(83)",
            "If GetOEMLED(825) <> 0 Then\n  Exit Sub\nEnd If\nX = GetOEMDRO(83)",
            "leaves without a stop",
        ),
        ("m880.m1s", "Call SetVar(150, 0)", "Call SetVar(150, 0)\nWhile IsMoving()\n  Sleep 20\nWend", "gives #150 a value"),
        ("m880.m1s", 'Open "C:', 'Mark = 5\nOpen "C:', "no line that a macro"),
        ("m881.m1s", "Call SetVar(150, 1)", "Call SetVar(151, 1)", "stops are remembered in #150, #151"),
        ("m881.m1s", "  Call DoOEMButton(1003)\n", "", "allowed in an If: Exit Sub, one value, or a stop"),
        (
            "m881.m1s",
            "If GetVar(152) + 1 <> GetVar(114) Then",
            "If GetVar(152) > GetVar(114) Then",
            "although M88[07] has been lost",
        ),
        ("m882.m1s", "Call SetVar(152, GetVar(114))", "Call SetVar(152, 0)", r"does not count itself in #152 last of all"),
        ("m882.m1s", "PX = GetVar(2000) +", "PX = GetVar(2001) +", "flag|goes on although|stops the program though"),
        ("m882.m1s", "While IsMoving()\n  Sleep 20\nWend\nPX", "PX", "read before anything has waited for the axes"),
        ("m882.m1s", "> 0.005 Then", "> 1 Then", "the work offset of X has changed"),
        ("m882.m1s", "> 1 Then", "> 100 Then", "the latched position of X has changed"),
        ("m882.m1s", "  Flag = 2", "  Flag = 1", r"the flag is 1 where the contact came at once"),
        ("m882.m1s", "  Flag = 0", "  Flag = 1", "the flag is 1 where nothing was touched"),
        ("m882.m1s", "Missed >= GetVar(111)", "Missed >= 300", "no touch finds anything any more|3 touches in a row"),
        ("m882.m1s", "Call SetVar(122, PY)", "Call SetVar(122, PX)", "the record has Y"),
        ("m882.m1s", "Call SetVar(121, PX)", "Call SetVar(2000, PX)", "found #2000 given a value"),
        ("m883.m1s", "+ 1.5 * WX", "- 1.5 * WX", "straight off the facet"),
        ("m883.m1s", "+ 1.5 * WX", "+ 15 * WX", "found an unprotected move of 15.000 mm"),
        ("m884.m1s", 'Letter = "B"', 'Letter = "C"', "found C|stops the program though"),
        ("m884.m1s", "G53 G0 ", "G0 ", "no line that a macro"),
        ("m884.m1s", "Off > 0.000087", "Off > 1", "goes on although B has not arrived"),
        ("m885.m1s", "Format(GetVar(125)", "Format(GetVar(126)", "the record has B|the sum"),
        ("m885.m1s", " + GetVar(112), ", ", ", "the sum in the record"),
        ("m885.m1s", "tango-readings.txt", "other.txt", "found the file"),
        ("m880.m1s", "GetOEMLED(825) <> 0", "GetOEMLED(825) <> 1", "a lamp <> a number"),
        ("m880.m1s", "If GetOEMLED(825) <> 0 Then", "If GetOEMLED(824) <> 0 Then", "which nobody knows|without having asked"),
        ("m880.m1s", "GetOEMDRO(84) - GetOEMDRO(801)", "GetOEMDRO(84)", "found Y|stops the program"),
        ("m880.m1s", 'InStr(Text, "TANGO START ")', 'InStr(Text, "TANGO END ")', "the mark END is written|no line"),
        ("m886.m1s", "Open FileName() For Input As #1", "Kill FileName()", "no line that a macro"),
        ("m883.m1s", ' & " F"', ' & " B" & Format(GetVar(101), "0.0000") & " F"', "no line that a macro"),
        ("m881.m1s", ' & " F"', ' & " M" & Format(3, "0.0000") & " F"', "no line that a macro"),
        ("m881.m1s", ' & " Z" & Format(Z - GetVar(133), "0.0000")', "", "no line that a macro"),
        ("m884.m1s", "Abs(Sin(", "(Sin(", "goes on although B has not arrived"),
        ("m884.m1s", "0.00872664626", "0.01745329252", "goes on although B has not arrived"),
        ("m884.m1s", "GetOEMDRO(82 + Param1())", "GetOEMDRO(82.6 + Param1())", "# of 10087.6, which some controls round"),
        ("m884.m1s", 'Letter = "B"', 'Letter = "S"', "turns no axis"),
        ("m882.m1s", "Abs(GetOEMDRO(84) - GetOEMDRO(801)", "(GetOEMDRO(84) - GetOEMDRO(801)", "the work offset of Y has changed"),
        ("m882.m1s", "Abs(PY - GetOEMDRO(84))", "(PY - GetOEMDRO(84))", "the latched position of Y has changed"),
        ("m882.m1s", "Flag = 1", "Flag = 1 + (GetVar(2000) = 0)", "a number \\+ a comparison"),
        ("m882.m1s", "Call SetVar(120, Flag)", 'Call SetVar(120, "")', "no line that a macro"),
        ("m881.m1s", "GetOEMLED(825) <> 0", "GetOEMLED(825) = 1", "a lamp = a number"),
        ("m881.m1s", "GetOEMLED(825) <> 0", "GetOEMLED(825) > 0", "a lamp > a number"),
        ("m881.m1s", "GetOEMLED(825) <> 0", "GetOEMLED(825) And 2", "a lamp and a number"),
        ("m882.m1s", "Call SetVar(120, Flag)", "' a remark _\nCall SetVar(120, Flag)", "no line that a macro"),
        ("m881.m1s", "Off = Abs", "IsMoving = 0\nOff = Abs", "no line that a macro"),
        ("m885.m1s", "While IsMoving()", "Call SetVar(152, GetVar(114))\nWhile IsMoving()", "does not count itself"),
        ("m885.m1s", "If GetVar(113) <> ", "If GetVar(113) = 1", "stops|the macros are not those of this program"),
    ],
)
def test_what_is_dangerous_in_a_macro_of_mach3_is_named(file: str, old: str, new: str, words: str) -> None:
    told = refused(lines_of("mach3", golden()), "mach3", beside=edited("mach3", file, old, new))
    assert re.search(words, told), told
    assert file in told or "macros" in told or "program line" in told


@pytest.mark.parametrize(
    ("passage", "other", "words"),
    [
        ("GetVar(152) + 1 <> GetVar(114)", "GetVar(152) + 1 < GetVar(114)", "somebody has started in the middle of the program"),
        (
            "If GetVar(113) <> (\\d+) Then",
            r"If GetVar(113) <> \1 And GetVar(113) = 5 Then",
            "the macros are not those of this program",
        ),
    ],
)
def test_what_every_macro_has_to_ask_is_asked(passage: str, other: str, words: str) -> None:
    """Changed alike in all of them, as a program and macros of one mind would have it."""
    pattern = passage if "\\" in passage else re.escape(passage)
    pattern = pattern.replace("GetVar(113)", r"GetVar\(113\)")
    files = {name: [re.sub(pattern, other, line) for line in lines] for name, lines in beside("mach3").items()}
    assert files != beside("mach3")
    assert re.search(words, refused(lines_of("mach3", golden()), "mach3", beside=files))


def test_a_lost_start_is_found_whatever_the_run_before_has_left() -> None:
    """An M880 that sets the counter itself, and a program that does not: without its file the counter is that of before."""
    files = beside("mach3")
    first = files["m880.m1s"].index("If GetVar(152) + 1 <> GetVar(114) Then")
    files["m880.m1s"] = [*files["m880.m1s"][:first], *files["m880.m1s"][first + 6 :]]
    lines = [line for line in lines_of("mach3", golden()) if line != "#152=0"]
    assert re.search("although (M880 has been lost|somebody has started)", refused(lines, "mach3", beside=files))


def test_a_record_cannot_live_on_the_flag_of_the_touch_before() -> None:
    files = edited("mach3", "m880.m1s", "Call SetVar(151, 0)", "Call SetVar(151, 0)\nCall SetVar(120, 1)")
    when = "If Flag <> 1 Then\n  Call SetVar(120, Flag)\nEnd If"
    files |= {"m882.m1s": edited("mach3", "m882.m1s", "Call SetVar(120, Flag)", when)["m882.m1s"]}
    files |= {"m885.m1s": edited("mach3", "m885.m1s", "Format(GetVar(120),", "Format(GetVar(120) + 0,")["m885.m1s"]}
    assert "the flag is" in refused(lines_of("mach3", golden()), "mach3", beside=files)


def test_the_end_mark_is_taken_out_by_the_macro_that_writes_it() -> None:
    files = beside("mach3")
    end = files["m886.m1s"]
    first = end.index('Mark = ""')
    look = end[first : first + 10]
    files["m886.m1s"] = end[:first] + end[first + 16 :]
    files["m885.m1s"] = [*files["m885.m1s"][:-1], *look, files["m885.m1s"][-1]]
    assert "the mark of nothing is written" in refused(lines_of("mach3", golden()), "mach3", beside=files)


def test_nothing_happens_behind_the_mark_of_the_program_or_the_end_mark() -> None:
    lines = lines_of("mach3", golden())
    assert "no line that a program" in refused([f"{line} G0 Z-50" if "(PROGRAM" in line else line for line in lines], "mach3")
    assert "outside of start mark and end mark" in refused([*lines[:-1], "#152=9", "M30"], "mach3")


@pytest.mark.parametrize("blank", ["\t", "\r", "\xa0", "\n"])
def test_a_blank_is_a_blank(blank: str) -> None:
    """Not a character at which a control may begin another line, or complain."""
    lines = [line.replace(" ", blank) if line.startswith("#101") else line for line in lines_of("mach3", golden())]
    assert "not of ASCII" in refused(lines, "mach3")
    files = beside("mach3")
    files["m881.m1s"] = [line.replace(") + Abs", f"){blank}+ Abs") for line in files["m881.m1s"]]
    assert "not of ASCII" in refused(lines_of("mach3", golden()), "mach3", beside=files)


def test_a_macro_that_is_missing_is_named() -> None:
    for name in beside("mach3"):
        told = refused(lines_of("mach3", golden()), "mach3", beside={n: text for n, text in beside("mach3").items() if n != name})
        assert f"{name} is not among the macros" in told


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("m881.mcs", "value(111)", "value(112)", "the record has X"),
        ("m881.mcs", "C%.4f ", "", "another number of values than of letters"),
        ("m881.mcs", "P%.0f", "P%.0e", "found '    say"),
        ("m883.mcs", "end", 'mc.mcCntlGcodeExecuteWait(inst, "G0 Z0")\nend', "found"),
        ("m880.mcs", "tango-readings.txt", "other.txt", "found"),
        ("m880.mcs", "-- M880", "M880", "a remark in the first line"),
        ("m882.mcs", "~= ", "~= 9", "found"),
        ("m884.mcs", "ISIG_PROBE", "ISIG_HOME", "found"),
        ("m884.mcs", "~= 0", "~= 1", "found"),
    ],
)
def test_what_is_wrong_in_a_script_of_mach4_is_named(file: str, old: str, new: str, words: str) -> None:
    told = refused(lines_of("mach4", golden()), "mach4", beside=edited("mach4", file, old, new))
    assert re.search(words, told), told
    assert file in told or "record" in told


def test_a_mask_that_prints_anything_else_is_refused() -> None:
    told = refused(lines_of("heidenhain", golden()), "heidenhain", beside=edited("heidenhain", "TANGO.A", "QS1", "QS2"))
    assert "TANGO.A" in told and "allowed" in told


# Mutants of the macros


def mutants(count: int, rng: random.Random) -> Iterator[tuple[str, str, Beside]]:
    """number, randomness → file, its changed line, all files; never the same ones."""
    files = beside("mach3", short())
    while count:
        name = rng.choice(list(files))
        lines = list(files[name])
        at, kind = (
            rng.randrange(1, len(lines)),
            rng.choice(("edit", "edit", "number", "number", "deleted", "swapped", "twice", "passage")),
        )
        line = lines[at]
        numbers = list(re.finditer(r"\d+\.?\d*", line))
        pairs = [pair for pair in EDITS if pair[0] in line]
        if kind == "edit" and pairs:
            lines[at] = line.replace(*rng.choice(pairs), 1)
        elif kind == "number" and numbers:
            m = rng.choice(numbers)
            place = rng.randrange(len(m[0]))
            digit = m[0][place]
            other = str((int(digit) + rng.randint(1, 9)) % 10) if digit.isdigit() else ""
            lines[at] = line[: m.start()] + m[0][:place] + other + m[0][place + 1 :] + line[m.end() :]
        elif kind == "deleted":
            del lines[at]
        elif kind == "swapped" and at + 1 < len(lines):
            lines[at : at + 2] = lines[at + 1], line
        elif kind == "twice":
            lines.insert(at, line)
        elif kind == "passage":
            del lines[at : at + rng.randint(2, 12)]
        if lines != files[name] and not FREE.search(lines[at] if at < len(lines) else ""):
            count -= 1
            yield name, f"{kind}: {line} → {' | '.join(lines[at : at + 1])}", files | {name: lines}


def judged(count: int, proven: int, seed: int = 7) -> tuple[int, list[tuple[str, str, str]]]:
    """number of mutants, after how many dangerous ones those that are refused are not judged any more → dangerous ones, and those
    of them that get through: what is dangerous, file, line."""
    lines = lines_of("mach3", short())
    originals: list[tuple[Trace, list[str]]] = [carried_out("mach3", lines, world) for world in worlds()]
    found, through = 0, []
    for file, line, files in mutants(count, random.Random(seed)):
        stopped = bool(refused(lines, "mach3", short(), files))
        if stopped and found >= proven:
            continue  # it gets through nowhere
        stored = tuple(text for name, texts in files.items() for text in (name, *texts))
        how = ""
        for world, right in zip(worlds(), originals, strict=True):
            try:
                how = how or compared(right, carried_out("mach3", lines, world, stored))
            except Endless:
                how = "never ends"
        if how:
            found += 1
            if not stopped:
                through.append((how, file, line))
    return found, through


@pytest.mark.few(0)
def test_dangerous_mutants_of_macros_are_refused() -> None:
    found, through = judged(8, 1)
    assert not through and found >= 1


@pytest.mark.campaign
def test_every_dangerous_one_of_350_mutants_of_macros_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    found, through = judged(350, 30)
    with capsys.disabled():
        print(f"\nmacros of mach3: 350 mutants, {found} dangerous, {found - len(through)} of them refused")
    assert not through and found >= 30
