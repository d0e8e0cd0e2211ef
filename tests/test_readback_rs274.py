"""Programs for grbl, Mach3, Mach4 and Centroid read back: what is dangerous is named; and two hundred mutants for grbl, whose
decisions are its driver's, so that the judge of the other dialects does not know it."""

from __future__ import annotations

import random
import re
from contextlib import suppress

import pytest
from support.programmutants import mutant
from support.readback import changed, golden, lines_of, refused
from support.rehearsed import NEAR, Traced, short, worlds

from sim_controller.languages import Alarm, Silence
from sim_controller.languages.grbl import Control, Profile
from tango_cnc.records import World

Trace = list[tuple[str, tuple[float, ...]]]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("G38.3 X-98. F180.", "G1 X-98. F180.", "no line that a program of this kind"),
        ("G38.3 X-98. F180.", "G38.3 X-98. F2000.", "the feed is 2000; allowed: 180"),
        ("G38.3 X-98. F180.", "G38.3 X98. F180.", r"found X 98\.000 mm"),
        ("G38.3 X-98. F180.", "G38.2 X-98. F180.", "no line that a program of this kind"),
        ("G38.3 X-26.9808 Z313.2679 F180.", "G38.3 Z313.2679 F180.", r"found X -19\.481 mm; the plan goes to X -26\.981"),
        ("G1 X-1.5 F2000.", "G1 X1.5 F2000.", "straight off the facet"),
        ("G1 X-1.5 F2000.", "G1 X-15. F2000.", "found an unprotected move of 15.000 mm"),
        ("G1 X-1.5 F2000.", "G1 Y-1.5 F2000.", "straight off the facet"),
        ("F2000.\nG90\n(RECORD P1 IS MADE OF THE ANSWER PRB)\n", "F2000.\n", "between G91 and G90"),
        ("G21 G91\nG1 X-1.5 F2000.\nG90\n", "", "does not take it off first"),
        ("G0 B-30. C-90.", "G0 B30. C-90.", "found B 30 deg"),
        ("G0 B-30. C-90.", "G0 B-30.", "the indexation lacks C"),
        ("G17 G21 ", "G17 G20 ", "no line that a program|is stated|before the start mark"),
        ("(TANGO END MARK 6)", "(TANGO END MARK 5)", "the end mark says 5"),
        ("(TANGO END MARK 6)", "(TANGO END 5AFE0000AFFE 6)", "the end mark is that of 5AFE0000AFFE"),
        ("(TANGO END MARK 6)", "(TANGO END MARK 6)\nG0 B0.", "after the end mark"),
    ],
)
def test_what_is_dangerous_on_grbl_is_named(old: str, new: str, words: str) -> None:
    mark = lines_of("grbl", golden())[1].split()[1]
    told = refused(changed(lines_of("grbl", golden()), old.replace("MARK", mark), new.replace("MARK", mark)), "grbl")
    assert re.search(words, told), told


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("#101=-98. ", "#101=98. ", r"found X 98\.000 mm"),
        ("#104=180.\n", "", "the feed is 1500; allowed: 180"),
        ("#110=0.02", "#110=20.", "goes on although Z goes the other way: a mirror image"),
        ("#109=5.", "#109=0.", "the flag is 1 where the contact came at once; it has to be 2"),
        ("#111=3", "#111=30", "goes on although no touch finds anything any more"),
        ("#141=0 #142=0 #143=1", "#141=1 #142=1 #143=1", "found X 0.000 mm; the plan goes to X"),
        ("#143=1", "#143=0", "stops the program though nothing has gone wrong"),
        ("M882", "M881", "stops the program though nothing has gone wrong"),
        ("M883\n", "", "stops the program though nothing has gone wrong"),
        (
            "#104=1500.\n#114=13\nM883",
            "#101=-128.\n#104=1500.\n#114=13\nM883",
            "found an unprotected move of 1.500 mm; allowed: .* straight off the facet",
        ),
        ("#105=-30.", "#105=30.", "found B 30 deg"),
        ("M884 P5", "M884 P4", "found A"),
        ("M885 P2", "M885 P3", "the record is of touch 3; this is touch 2"),
        ("#106=-113.", "#106=-103.", "the flag is 2 where nothing has gone wrong"),
        ("#112=90.", "#112=0.", "the record has S 0"),
        ("#109=5.", "#109=5.\n#131=7.", "found #131=7"),
        ("M30", "M30\nM881", "after the end"),
    ],
)
def test_what_is_dangerous_on_mach3_is_named(old: str, new: str, words: str) -> None:
    told = refused(changed(lines_of("mach3", golden()), old, new), "mach3")
    assert re.search(words, told), told


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("G31 X#31 Y#32 Z#33 F3000.", "G1 X#31 Y#32 Z#33 F3000.", "found an unprotected move; allowed: one off the facet"),
        ("GT0.02]THEN#3000", "GT200.]THEN#3000", "although a protected move has been stopped short"),
        ("GE3]THEN#3000=83", "GE300]THEN#3000=83", "3 touches in a row"),
        ("GT0.005]THEN#3000=82", "GT9.]THEN#3000=82", "the work offset of X has changed"),
        ("M883\n#31=ABS", "#31=ABS", "is read before anything has waited"),
        ("M881(RECORD)", "M882(RECORD)", "no line that a program of this kind"),
        ("#120=2.", "#120=3.", "the record is of touch 3"),
        ("#118=#111+", "#118=#112+", "the sum in the record"),
        ("M880(TANGO START ", "M880(TANGO START 0", "no line that|the start mark is"),
        ("#106=#5026-#5046(C)", "#106=#5027-#5047(C)", r"#5027 is read|\[C\]|#5047 is read"),
    ],
)
def test_what_is_dangerous_on_mach4_is_named(old: str, new: str, words: str) -> None:
    told = refused(changed(lines_of("mach4", golden()), old, new), "mach4")
    assert re.search(words, told), told


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("M125 /Z[383. - #29103] P#9011", "G1 Z[383. - #29103]", "found an unprotected move; allowed: one off the facet"),
        ("G1 X[#5021 - 1.5 - #29101] F3000.\n", "", "the probe is at a facet, and this does not take it off first"),
        (
            "[#5021 - 1.5 - #29101]",
            "[#5021 + 1.5 - #29101]",
            "found an unprotected move of 1.500 mm; allowed: .* straight off the facet",
        ),
        (
            "[#5021 - 1.5 - #29101]",
            "[#24301 - 1.5 - #29101]",
            "found an unprotected move of .* mm; allowed: 1.5 mm",
        ),  # after a miss
        ("[#5021 - 1.5 - #29101]", "[#5021 - 1.5]", "found an unprotected move of .* mm; allowed: 1.5 mm"),
        ("L1\n", "\n", "no line that a program of this kind"),
        ("M115 /X[-98. ", "M115 /X[98. ", r"found X 98\.000 mm"),
        ("383.]] > 0.02] THEN GOTO 9001", "383.]] > 200.] THEN GOTO 9001", "although a protected move has been stopped short"),
        ("THEN GOTO 9003", "THEN GOTO 9999", "no place where this program stops"),
        (">= 3] THEN GOTO 9003", ">= 300] THEN GOTO 9003", "3 touches in a row"),
        ("] > 1.] THEN GOTO 9002", "] > 100.] THEN GOTO 9002", "the latched position of X has changed"),
        ("== #29123] THEN GOTO 9004", "== 5] THEN GOTO 9004", "although the probe is deflected"),
        ("> 0.000087]", "> 0.5]", "B has not arrived"),
        ("IF #50010\nIF [ABS[SIN", "IF [ABS[SIN", "is read before anything has waited"),
        ("< 5.] THEN #29110 = 2", "< 4.] THEN #29110 = 2", "just before the search zone"),
        ("#29121 = 0", "#29121 = 2", "shown for a moment only"),
        ('M225 #29121 "TANGO STOPPED. PROBE IS DEFLECTED"\n', "G1 X[5.] F100.\n", "is no place where this program stops"),
        ("N9999", "N9999\nG53 B0.", "the last line is no label"),
        ("#29111 = #5021", "#5021 = #29111", "found #5021 given a value"),
        ("C%.4f", "A%.4f", "the record has X Y Z B A S"),
    ],
)
def test_what_is_dangerous_on_centroid_is_named(old: str, new: str, words: str) -> None:
    told = refused(changed(lines_of("centroid", golden()), old, new), "centroid")
    assert re.search(words, told), told


# Mutants of the lines for grbl


def told() -> tuple[World, World]:
    """→ as planned; something in the way of the second touch: the others are for programs that decide."""
    return worlds()[0], worlds()[3]


def carried_out(lines: list[str], world: World) -> Trace:
    """lines, true machine → every place they move to, until the control locks or refuses one."""
    motion = Traced(world)
    with suppress(Alarm, Silence):
        Control(motion, Profile(), lambda data: None, lambda event, **data: None).run(lines, False)
    return motion.trace


def dangerous(originals: list[Trace], lines: list[str]) -> bool:
    """Whether the control moves elsewhere, otherwise or farther than before; stopping sooner is no danger."""
    for world, moves in zip(told(), originals, strict=True):
        after = carried_out(lines, world)
        if len(after) > len(moves):
            return True
        for (kind, place), (wanted, there) in zip(after, moves, strict=False):
            if kind != wanted or max(abs(a - b) for a, b in zip(place, there, strict=True)) > NEAR:
                return True
    return False


def judged(count: int, proven: int) -> tuple[int, list[tuple[str, ...]]]:
    """number of mutants, after how many dangerous ones those that are refused are not judged any more → dangerous ones, and those
    of them that get through."""
    rng, lines = random.Random(7), lines_of("grbl", short())
    originals = [carried_out(lines, world) for world in told()]
    found, through = 0, []
    for _ in range(count):
        kind, at, mutated = mutant(lines, rng)
        stopped = bool(refused(mutated, "grbl", short()))
        if stopped and found >= proven:
            continue  # it gets through nowhere
        if dangerous(originals, mutated):
            found += 1
            if not stopped:
                through.append((kind, lines[at], *mutated[at : at + 1]))
    return found, through


@pytest.mark.few(0)
def test_dangerous_mutants_for_grbl_are_refused() -> None:
    found, through = judged(20, 3)
    assert not through and found >= 3


@pytest.mark.long
def test_every_dangerous_one_of_two_hundred_mutants_for_grbl_is_refused() -> None:
    found, through = judged(200, 50)
    assert not through and found >= 50
