"""What a program does not state is not guessed, what it says in passing is kept, and no axis turns the other way."""

from __future__ import annotations

import io
import re
from dataclasses import replace

import pytest
from support.compensated import example
from support.nc_compensate_parts import ZERO, knowledge, rewritten  # noqa: F401  fixture

from tango_cnc.compensate.fit import Known
from tango_cnc.nc.blocks import language
from tango_cnc.nc.follow import Setup, follow
from tango_cnc.records import InputError, Machine

MOVES = {
    "rs274": "G0 X0. Y0. Z5.\nG1 X40. F500\n",
    "macro_b": "G0 X0. Y0. Z5.\nG1 X40. F500\n",
    "siemens": "G0 X0 Y0 Z5\nG1 X40 F500\n",
    "klartext": "1 L X+0 Y+0 Z+5 R0 FMAX\n2 L X+40 R0 F500\n",
}


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("name", "head", "said"),
    [
        ("rs274", "G17 G54\n", "whether it is in millimeters and absolute, no block has stated: write G21 and G90 before it"),
        ("rs274", "G21 G17 G54\n", "whether it is absolute, no block has stated: write G90"),
        ("rs274", "G90 G17 G54\n", "whether it is in millimeters, no block has stated: write G21"),
        ("macro_b", "%\nO7\nG90 G54\n", "write G21"),
        ("siemens", "G90 G54\n", "write G71 or G710"),
        ("siemens", "G710 G54\n", "write G90"),
        ("klartext", "0 BEGIN PGM A\n", "write BEGIN PGM … MM"),
        ("klartext", "", "write BEGIN PGM … MM"),
    ],
)
def test_millimeters_and_absolute_are_stated_by_the_program_or_by_the_user(
    name: str,
    head: str,
    said: str,
    knowledge: Known,
) -> None:
    with pytest.raises(InputError) as error:
        rewritten(head + MOVES[name], knowledge, name)
    assert said in str(error.value) and "--metric-absolute" in str(error.value)
    stated = {"klartext": "0 BEGIN PGM A MM\n", "siemens": "G90 G71 G54\n"}.get(name, "G21 G90 G17 G54\n")
    alike, whole = (
        rewritten(head + MOVES[name], knowledge, name, settled=True)[0],
        rewritten(stated + MOVES[name], knowledge, name)[0],
    )
    assert alike[-1].split()[-2:] == whole[-1].split()[-2:] and alike[-1] != MOVES[name].splitlines()[-1]


def test_what_is_not_millimeters_or_absolute_is_refused_whatever_the_user_says(knowledge: Known) -> None:
    for line in ("G20", "G91"):
        with pytest.raises(InputError, match=f"found {line}"):
            rewritten(f"{line}\n{MOVES['rs274']}", knowledge, settled=True)


@pytest.mark.parametrize("name", ["rs274", "macro_b"])
def test_a_comment_within_a_word_is_kept(name: str, knowledge: Known) -> None:
    text = "G21 G90 G17 G54\nG0 X0. Y0. Z5.\nG1 X(half)40. Y(low)10. F(slow)500\nG3 (bow)X50. Y20. I(across)0. J(up)10. M(air)9\n"
    lines, account = rewritten(text, knowledge, name)
    out = "\n".join(lines)
    assert account.arcs == 1 and account.compensated == 3
    for comment in ("half", "low", "slow", "bow", "across", "up"):
        assert out.count(f"({comment})") == 1
    assert out.count("M9") + out.count("M(air)9") == 1 and out.count("(air)") == 1
    bare, _ = rewritten(re.sub(r"\([^)]*\)", "", text), knowledge, name)
    assert [_numbers(line) for line in lines] == [_numbers(line) for line in bare]


def _numbers(line: str) -> list[str]:
    return re.findall(r"[-\d.]+", re.sub(r"\([^)]*\)", "", line))


def followed(machine: Machine, text: str) -> int:
    return len(list(follow(io.StringIO("G21 G90\nG0 X0. Y0. Z5. A0.\n" + text), language("macro_b"), Setup(machine, ZERO, 100.0))))


def test_a_cut_that_an_axis_may_turn_the_other_way_is_refused(knowledge: Known) -> None:
    machine = example("trunnion")[0].machine
    kinds = {"by its numbers": {}, "nearer": {"nearer": True}, "no travel": {"travel": None}}
    machines = {
        kind: replace(machine, axes=tuple(replace(a, **change) if a.name == "C" else a for a in machine.axes))  # type: ignore[arg-type]
        for kind, change in kinds.items()
    }
    for text in ("G0 C350.\nG1 C10. F500\n", "G0 C0.\nG1 C180. F500\n", "G0 C0.\nG1 C100. F500\nG1 C-80.\n"):
        assert followed(machines["by its numbers"], text) > 3
        for kind in ("nearer", "no travel"):
            with pytest.raises(InputError, match="which way it turns is not known") as error:
                followed(machines[kind], text)
            assert kind in str(error.value).replace("it has no travel", "no travel")
    for text in ("G0 C350.\nG1 C200. F500\nG1 C50.\n", "G0 C350.\nG0 C10.\nG1 C12. F500\n", "G1 X1. F500\nG1 C350.\n"):
        for known in machines.values():
            assert followed(known, text) > 3


def test_the_mark_of_another_zero_or_estimate_is_refused(knowledge: Known) -> None:
    lines, _ = rewritten("G21 G90 G17 G54\n" + MOVES["rs274"] + "M30\n", knowledge)
    marked = "\n".join(lines) + "\n"
    assert rewritten(marked, knowledge)[0] == lines
    for found, other in (("0123", "4567"), ("ZERO X", "ZERO X9")):
        with pytest.raises(InputError, match=r"another estimate, zero or tool length .* Take the program that it was made from"):
            rewritten(marked.replace(found, other, 1), knowledge)


@pytest.mark.parametrize(("name", "word"), [("rs274", "X４0."), ("macro_b", "X٤0."), ("klartext", "X+４0")])
def test_digits_that_no_control_reads_are_refused(name: str, word: str, knowledge: Known) -> None:
    head = {"rs274": "G21 G90\n", "macro_b": "%\nO7\nG21 G90\n", "klartext": "0 BEGIN PGM A MM\n"}[name]
    with pytest.raises(InputError, match="line"):
        rewritten(head + MOVES[name].replace("X40.", word).replace("X+40", word), knowledge, name)


def test_rapids_that_turn_an_axis_are_counted_with_their_lines(knowledge: Known) -> None:
    _, account = rewritten("G21 G90 G17 G54\nG0 X0. Y0. Z5. A0. C0.\nG0 C30.\nG1 X40. F500\nG0 A10. C40.\nM30\n", knowledge)
    assert account.turning == len(account.turning_lines) == 3 and account.turning_lines == [2, 3, 5]
