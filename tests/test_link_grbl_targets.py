"""Targets that a grbl control confirms: with any one character wrong, a line moves nothing or stays between here and the target.

Quick: one in 13 of the ways to spoil a line; `-m campaign`: all of them, in half a minute.
"""

import functools
import math

import numpy as np
import pytest
from support.linkparts import machine

from sim_controller.languages.grbl import RESET, Control, Profile
from sim_controller.languages.grbl.numbers import Parameters
from sim_controller.motion import Skip
from sim_controller.protocols.grbl import Input
from tango_cnc.link import _grbl_targets as targets
from tango_cnc.records import InputError

PLACE = {"X": 10.0, "Y": -7.5, "Z": 200.0, "B": 30.0, "C": 0.0}
# What would do most harm behind another letter: inches, relative, home, another work offset, tool change
MEANT = {"X": 20.0, "Y": 28.1, "Z": 100.0, "B": 55.0, "C": 91.0}
VALUES = {**{name: targets.apart(value) for name, value in MEANT.items()}, "F": targets.apart(2000.0)}
LETTERS = (*VALUES, "G")


class Moves:
    """Axes that are where they were sent at once: what was asked of them is written down."""

    machine, deflected = machine(), False

    def __init__(self):
        self.asked = []
        self.position = np.array([math.radians(PLACE[n]) if n in "BC" else PLACE.get(n, 0.0) for n in self.machine.names])

    def reads(self, text):
        """Nobody is there to read it."""

    def rapid(self, target):
        self.asked.append(("rapid", dict(target)))

    def feed(self, target, feed):
        self.asked.append(("feed", dict(target)))

    def skip(self, target, feed):
        self.asked.append(("search", dict(target)))
        return Skip(False, self.position)

    def dwell(self, seconds):
        pass


@functools.cache
def named(code, word=targets.ORIENT):
    """code of the motion, value of M → the parameters, set"""
    known = Parameters(True, True)
    for line in targets.assignments({**VALUES, "M": word, "R": 90.0002, "G": code}):
        at = 0
        while at < len(line):
            at = known.assigned(line.upper(), at + 1)
    return known._named


def heard(data, firmware, modal, code, known=True):
    """bytes on the line, what is modal, code of the motion → the control after them, what it was asked to move, its answers."""
    one = Control(Moves(), Profile(firmware), lambda data: None, lambda event, **data: None)
    one._modal, one._feed = modal, 2000.0
    if known:
        one._parameters._named = dict(named(code))
    answers = sent_to(one, data)
    return one, one.motion.asked, answers


def sent_to(one, data):
    """control, bytes on its line → its answers"""
    into, answers = Input(one.kind.one_line_end), []
    for byte in data:
        taken = into.take(byte)
        if isinstance(taken, int):
            one.realtime(taken)
        elif taken is not None:
            answers.append(one.line(taken))
    return answers


def spoilt(line, every):
    """line → it with one character lost, doubled, or replaced by any other byte: the first of so many, the next, …"""
    data, ways = f"{line}\n".encode(), []
    for i, byte in enumerate(data):
        others = [*range(0x80), *(byte ^ 1 << bit for bit in range(8) if byte ^ 1 << bit >= 0x80)]
        pieces = [b"", bytes([byte, byte]), *(bytes([other]) for other in others if other != byte)]
        ways += [data[:i] + piece + data[i + 1 :] for piece in pieces]
    return ways[::every]


def between(asked):
    """→ whether every axis was told its target or to stay"""
    near = {name: (VALUES[name], PLACE[name]) for name in PLACE}
    return all(
        any(math.isclose(math.degrees(value) if name in "BC" else value, end, abs_tol=1e-3) for end in near[name])
        for _, target in asked
        for name, value in target.items()
    )


FIRMWARES = pytest.mark.parametrize("firmware", ["grblHAL", "FluidNC"])
THOROUGH = pytest.mark.parametrize("every", [13, pytest.param(1, marks=pytest.mark.campaign)])


@pytest.mark.few(1)
@THOROUGH
@FIRMWARES
@pytest.mark.parametrize("modal", [0.0, 38.3])
def test_what_sets_asks_and_waits_moves_nothing_whatever_becomes_of_it(firmware, modal, every):
    quiet = [*targets.assignments({**VALUES, "G": 38.3}), targets.question(LETTERS), targets.FED, targets.WAIT]
    for line in quiet:
        for data in spoilt(line, every):
            one, asked, _ = heard(data, firmware, modal, 38.3)
            assert asked == [], data
            assert (one._relative, one._inch, one._frame) == (False, False, 54), data
            assert one._modal == modal or RESET in data, data


@pytest.mark.few(1)
@THOROUGH
@FIRMWARES
def test_what_was_set_wrongly_is_not_confirmed(firmware, every):
    wanted = {**VALUES, "G": 38.3}
    for line in targets.assignments(wanted):
        for data in spoilt(line, every):
            one, _, answers = heard(data, firmware, 38.3, 1.003)  # G is another one before
            if one.state == "Hold:0" or len(answers) != 1 or answers[0] != ["ok"]:
                continue  # the client waits for one ok, and for nothing else
            if targets.confirmed(list(wanted.values()), one.line(targets.question(LETTERS))):
                values = [one._parameters._named[f"q{letter.lower() * 2}"] for letter in LETTERS]
                assert values == pytest.approx(list(wanted.values()), abs=4e-4), data


@THOROUGH
@FIRMWARES
def test_after_a_search_nothing_but_a_search_can_come_of_a_search(firmware, every):
    for code in (38.3, 1.003, 0.003):
        for data in spoilt(targets.motion(LETTERS, searching=True), every):
            _, asked, _ = heard(data, firmware, 38.3, code)
            assert between(asked), (data, asked)
            assert len(asked) <= 1, (data, asked)
            assert code != 38.3 or not asked or asked[0][0] == "search", (data, asked)


@THOROUGH
def test_turning_the_spindle_moves_nothing_else(every):
    for data in spoilt(targets.motion((*LETTERS, "M", "R"), searching=True), every):
        _, asked, _ = heard(data, "grblHAL", 38.3, 0.003)
        assert between([(kind, target) for kind, target in asked if set(target) != {"S"}]), (data, asked)
        assert {round(math.degrees(target["S"]), 3) for _, target in asked if "S" in target} <= {0.0, 90.0}, "no R is R0"


@THOROUGH
@pytest.mark.parametrize(("word", "freed"), [(11, True), (10, False)])
def test_the_word_of_a_clamp_moves_nothing_and_said_twice_it_is_heard(every, word, freed):
    """Everything stands where the line sends it. One of the two is spoilt: the driver stops, or the clamp has switched."""
    at_target = np.array([math.radians(VALUES[n]) if n in "BC" else VALUES.get(n, 0.0) for n in Moves.machine.names])
    first, second = (targets.motion((*LETTERS, "M"), searching).encode() + b"\n" for searching in (True, False))
    dropped = 0
    for data in spoilt(first.decode().strip(), every):
        one = Control(Moves(), Profile(unclamp={"C": 11}, clamp={"C": 10}), lambda data: None, lambda event, **data: None)
        one._modal, one._feed, one._held = 38.3, 2000.0, set() if not freed else {"C"}
        one._parameters._named = dict(named(0.003, targets.switch(word)))
        one.motion.position = at_target
        answers = sent_to(one, data)
        for _, target in one.motion.asked:
            assert all(
                math.isclose(math.degrees(v) if n in "BC" else v, VALUES[n], abs_tol=1e-3) for n, v in target.items() if n != "S"
            ), data
        assert (one._relative, one._inch, one._frame) == (False, False, 54), data
        if answers != [["ok"]] or one.state != "Idle":
            continue  # the driver waits, or stops
        dropped += ("C" in one._held) == freed
        assert sent_to(one, second) == [["ok"]], data
        assert ("C" in one._held) != freed, data
    assert dropped or every > 1, "or saying it twice is for nothing"


def test_a_word_that_would_do_harm_behind_g_is_refused():
    for number in (20, 21, 91):
        with pytest.raises(InputError, match=rf"found M{number} for a clamp; allowed: .*e\.g\. M10.*targets=plain"):
            targets.switch(number)
    assert targets.switch(10) == 10.003


@THOROUGH
@FIRMWARES
def test_after_another_motion_a_search_may_become_one_but_goes_no_farther(firmware, every):
    """It takes the G itself, turned into one of three letters, or a reset or a line end behind an axis."""
    whole = len(targets.motion(LETTERS, searching=False)) + 1
    for data in spoilt(targets.motion(LETTERS, searching=False), every):
        _, asked, _ = heard(data, firmware, 0.0, 38.3)
        assert between(asked), (data, asked)
        if any(kind != "search" for kind, _ in asked):
            assert len(data) == whole
            assert data[:1].upper() in (b"N", b"S", b"T") or set(data[:-1]) & {RESET, *b"\r\n"}, data


def test_a_plain_line_does_go_astray():
    """The judge is not blind: a digit lost in Z, and an F that has become a B."""
    _, asked, _ = heard(b"G38.3 X20.006 Z10.0 F2000\n", "grblHAL", 0.0, 38.3)
    assert not between(asked)
    _, asked, _ = heard(b"G38.3 X20.006 Z100.0002 B2000\n", "grblHAL", 0.0, 38.3)
    assert not between(asked)
    _, asked, _ = heard(b"G28 G90 G94\n", "grblHAL", 0.0, 38.3)
    assert asked[0][0] == "rapid"


@pytest.mark.parametrize("firmware", ["grblHAL", "FluidNC"])
def test_an_unknown_name_is_an_error(firmware):
    _, asked, answers = heard(f"{targets.motion(LETTERS, False)}\n".encode(), firmware, 0.0, 38.3, known=False)
    assert (asked, answers) == ([], [["error:2"]])


def test_no_name_becomes_another_one_or_one_of_the_control():
    names = [f"q{letter.lower() * 2}" for letter in "XYZABCFGMR"]
    system = ["_x", "_y", "_z", "_a", "_b", "_c", "_feed", "_rpm", "_line", "_mist"]
    for name in names:
        for other in {*names, *system} - {name}:
            assert distance(name, other) > 1, (name, other)


def distance(a, b):
    """→ characters lost, added or replaced between two words"""
    row = list(range(len(b) + 1))
    for i, one in enumerate(a, 1):
        row, before = [i], row
        for j, two in enumerate(b, 1):
            row.append(min(row[-1] + 1, before[j] + 1, before[j - 1] + (one != two)))
    return row[-1]


def test_targets_are_shifted_by_micrometres_and_twice_is_once():
    for value in [*np.round(np.random.default_rng(5).uniform(-999, 999, 500), 4), *range(-120, 120), *np.arange(0, 100, 0.1)]:
        assert abs(targets.apart(float(value), targets.TURNED) - value) <= 0.0062
        near = targets.apart(float(value))
        assert abs(near - value) <= 0.0062
        assert abs(near - round(near)) >= 0.0002 - 1e-9, "## of it is no parameter"
        assert targets.apart(near) == near
        assert round(near, 1) not in targets.HARMFUL or round(100 * abs(near)) % 10 != 0, "two places count behind G"


def test_a_target_at_an_end_of_its_travel_is_shifted_inwards():
    assert targets.apart(90.0, targets.TURNED, (-90.0, 90.0)) == 89.999
    assert targets.apart(-90.0, targets.TURNED, (-90.0, 90.0)) == -89.999
    assert targets.apart(4.0, travel=(-100.0, 4.0)) == 3.994


def test_lines_are_short_enough_for_fluidnc():
    longest = dict.fromkeys((*"XYZABCFG", "M", "R"), -1234.5678)
    lines = [*targets.assignments(longest), targets.question(tuple(longest)), targets.motion(tuple(longest), True)]
    assert max(map(len, lines)) <= 127


@pytest.mark.parametrize("more", [["[MSG:1.0000  2.0000  3.0000]"], ["[MSG:1.0000  2.0000]", "[MSG:1.0000  2.0000]"], ["ok"], []])
def test_an_answer_with_more_than_was_asked_or_twice_confirms_nothing(more: list[str]) -> None:
    """What does not answer exactly one question moves nothing, and ends no run with a traceback."""
    assert targets.confirmed([1.0, 2.0], ["[MSG:1.0000  2.0000]"])
    assert not targets.confirmed([1.0, 2.0], more)
