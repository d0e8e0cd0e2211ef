"""Nothing that is not known ever leaves words of axes to be read as a move: G0 to G399 in every language, and words of letters."""

from __future__ import annotations

import re
import string
from types import ModuleType

import pytest
from support.compensated import ROOT

from tango_cnc.nc.blocks import Block, Modal, guessed, language, languages
from tango_cnc.records import InputError

AXES = "XYZABC"
ISO = ("rs274", "macro_b", "siemens")


def read(module: ModuleType, text: str) -> Block:
    """Language, block → it, read after a program that has begun and is cutting a line."""
    modal = Modal(
        motion="feed", position=dict.fromkeys(AXES, 0.0), offset="", tool=1, centre=(0.0, 0.0), metric=True, absolute=True
    )
    return module.read(text, 7, modal, AXES)


def documented(name: str, row: str) -> set[float]:
    """Language, row → the G functions that docs/compensate.md lists there."""
    text = (ROOT / "docs" / "compensate.md").read_text(encoding="utf-8")
    (line,) = (line for line in text.splitlines() if line.startswith(f"| `{name}` | {row} |"))
    found: set[float] = set()
    for first, last in re.findall(r"G([\d.]+)(?: to G(\d+))?", line.split("|")[3]):
        found |= {float(first)} if not last else set(map(float, range(int(first), int(last) + 1)))
    return found


def walked(name: str, codes: list[float]) -> dict[str, set[float]]:
    """Language, G functions → those that are taken: beside words of axes that move, that do not, and in a block of their own."""
    module = language(name)
    rows = {"beside a move": set[float](), "a way that stays as it is": set[float](), "in a block without axes": set[float]()}
    move, stays, alone = rows.values()
    for code in codes:
        for words in ("X10. Y20. Z3.", ""):
            try:
                block = read(module, f"G{code:g} {words}")
            except InputError as error:
                assert str(error).startswith(f"line 7: found {'an arc' if code in (2, 3) else f'G{code:g}'}"), error
                continue
            if words:
                moves = block.kind in ("rapid", "feed")
                assert set(block.target if moves else block.forgets) >= set("XYZ"), block
                (move if moves else stays).add(code)
            elif code not in move | stays:
                alone.add(code)
    arcs = alone & {2.0, 3.0}  # beside a move, but they need a center or a radius
    return rows | {"beside a move": move | arcs, "in a block without axes": alone - arcs}


@pytest.mark.parametrize("name", ISO)
def test_every_g_function_is_listed_or_refused_by_its_name_and_line(name: str) -> None:
    for row, found in walked(name, list(map(float, range(1000)))).items():
        assert found == {code for code in documented(name, row) if code == int(code)}, row


@pytest.mark.long
@pytest.mark.parametrize("name", ISO)
def test_every_g_function_with_a_decimal_is_listed_or_refused(name: str) -> None:
    codes = [round(whole + part / 10, 1) for whole in range(400) for part in range(1, 10)]
    for row, found in walked(name, codes).items():
        assert found == {code for code in documented(name, row) if code != int(code)}, row


def test_klartext_knows_no_g_functions() -> None:
    forms = ("5 G{} X+10 Y+20", "5 L G{} X+10", "5 L X+10 G{}", "5 G{}")
    for code in range(400):
        with pytest.raises(InputError) as error:
            read(language("klartext"), forms[code % 4].format(code))
        assert re.match(rf"line 7: found G{code}\b", str(error.value))


KNOWN_LETTERS = "XYZABCNFSDHTM"


@pytest.mark.parametrize("name", ISO)
def test_every_letter_is_known_or_refused(name: str) -> None:
    module = language(name)
    for letter in set(string.ascii_uppercase) - set("G"):
        text = f"{letter}1." if letter in AXES else f"X10. {letter}1"
        if letter in KNOWN_LETTERS:
            assert read(module, text).target
            continue
        with pytest.raises(InputError, match=f"line 7: found.*{letter}1"):
            read(module, text)


@pytest.mark.parametrize("name", languages())
def test_every_m_function_that_calls_or_moves_is_refused(name: str) -> None:
    module = language(name)
    before = "5 L " if name == "klartext" else ""
    for code in {"klartext": (89, 94, 97, 98, 99, 118, 126, 128, 138, 140, 143, 144), "siemens": ()}.get(name, (98, 99, 198)):
        with pytest.raises(InputError, match=f"line 7: found M{code};"):
            read(module, f"{before}M{code}")


@pytest.mark.parametrize(
    ("name", "text", "found"),
    [
        ("macro_b", "G22 X100. Y100.", "G22 with X100 Y100"),
        ("macro_b", "G22 I100. J100.", "G22 with I100 J100"),
        ("macro_b", "G25 X5.", "G25 with X5"),
        ("macro_b", "G26 X5.", "G26 with X5"),
        ("macro_b", "G1 G50 X5.", "G50 with X5"),
        ("macro_b", "G63 Z-5.", "G63; tapping"),
        ("macro_b", "G5.1 Q1 X0. Y0.", "G5.1 with X0 Y0"),
        ("macro_b", "G4 Y5.", "G4 with Y5"),
        ("rs274", "G4 P1 X5.", "G4 with X5"),
        ("rs274", "G92.1 X5.", "G92.1 with X5"),
        ("rs274", "G59.4", "G59.4"),
        ("rs274", "G17 G18", "G17 and G18"),
        ("rs274", "G28 G53 X5.", "G28 and G53"),
        ("siemens", "G4 X5", "G4 with X5"),
        ("siemens", "R5", "R5"),
        ("macro_b", "G2 X10. Y0. I5. K3.", "K3 in an arc in the plane XY"),
        ("rs274", "G18 G3 X0. Z10. K5. J1.", "J1 in an arc in the plane ZX"),
        ("siemens", "G2 X10 Y0 I5 K3", "K3 in an arc in the plane XY"),
        ("macro_b", "G2 X10. Y0. I5. R5.", "an arc with a radius and a center"),
        ("macro_b", "G2 X10. Y0. I5. L3", "L3"),
        ("siemens", "SPOS=90", "SPOS=90; what this does"),
        ("siemens", "G1 X10 OVRA[X]=50", "OVRA[X]=50; variables"),
        ("rs274", "M428", "M428; with tool center point control on"),
        ("macro_b", "M430", "M430; with tool center point control on"),
        ("klartext", "5 M5 M128", "M128"),
        ("klartext", "5 M5 M143", "M143"),
        ("klartext", "5 M5 X+10", "M5 X+10"),
    ],
)
def test_a_word_that_may_be_something_else_than_a_move_is_refused(name: str, text: str, found: str) -> None:
    with pytest.raises(InputError) as error:
        read(language(name), text)
    assert f"line 7: found {found}" in str(error.value)


@pytest.mark.parametrize("name", ["rs274", "macro_b"])
def test_z_is_not_moved_by_the_length_of_the_tool_before(name: str) -> None:
    """T2 M6 without G43: the length of tool 1 still acts on some controls. X and Y may move, and G49 or G43 ends it."""
    known = language(name)

    def reads(*after: str) -> list[Block]:
        modal = Modal(motion="rapid", position=dict.fromkeys(AXES, 0.0), metric=True, absolute=True)
        lines = ("T1 M6", "G43 H1 Z50.", "T2 M6", *after)
        return [known.read(line, number, modal, AXES) for number, line in enumerate(lines, 1)]

    with pytest.raises(InputError, match=r"line 5: found Z50 after M6; a tool was changed"):
        reads("G0 X5. Y5.", "G0 Z50.")
    assert reads("G0 X5. Y5.", "G43 H2 Z50.", "G1 Z5. F100.")
    assert reads("G49", "G0 Z50.") and reads("G53 G0 Z0.")


def test_what_leaves_the_path_alone_is_taken() -> None:
    for name, text in (
        ("macro_b", "G22"),
        ("macro_b", "G4 X1.5"),
        ("macro_b", "G49 H0"),
        ("macro_b", "G2 X10. Y0. I5. K0."),
        ("klartext", "5 M5 M9"),
        ("klartext", "5 M5"),
    ):
        assert read(language(name), text).number == 7


@pytest.mark.parametrize(
    ("head", "suffix", "written", "said"),
    [
        ('; CAM "X99" Ä\nN1 G71 G90\n', ".mpf", "macro_b", "siemens"),
        ('; CAM "X99" Ä\nN1 G71 G90\n', ".nc", "macro_b", "siemens"),
        ("N1 G71 G90 ; millimeters\n", "", "macro_b", "siemens"),
        ("G71 G90\n", ".SPF", None, "siemens"),
        ("%\nO1 (A; B)\nG21 G90;\nG0 X1.;\n", ".nc", "macro_b", "macro_b"),
        ("; part\nG21 G90\n", ".nc", "rs274", "rs274"),
        ("; part\nG21 G90\n", ".nc", None, "rs274"),
        ("; part\nG21 G90\n", ".ngc", "macro_b", "rs274"),
        ("0 BEGIN PGM A MM ; X\n", ".nc", "macro_b", "klartext"),
    ],
)
def test_a_language_is_guessed_by_text_name_and_cell(head: str, suffix: str, written: str | None, said: str) -> None:
    assert guessed(head.splitlines(keepends=True), written, suffix) == said
