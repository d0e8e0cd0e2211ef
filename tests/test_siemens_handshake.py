"""Siemens: records through R parameters or global user data: what the program does, what the read-back refuses."""

import contextlib
import re
from dataclasses import replace

import pytest
from support.controls import ACTIVE, golden, run_on
from support.readback import lines_of, refused

from sim_controller.languages import siemens
from tango_cnc.link.client import Touched
from tango_cnc.records import InputError

MOVED = []  # what the machine did in the last program
NAMES = ("R700", "TANGO_REC")
OFF = {
    "record": 0,
    "taken": 1,
    "point": 2,
    "flag": 3,
    "count": 4,
    "sum": 8,
    **{letter: 10 + i for i, letter in enumerate("XYZABCS")},
}


class Computer(dict):
    """Takes every record: in the variables of a control, as this side of OPC UA does."""

    def __init__(self, name, start=0.0, patience=1000, willing=True):
        super().__init__()
        self.cell = {what: f"R{700 + at}" if name == "R700" else f"{name}[{at}]" for what, at in OFF.items()}
        self.taken, self.left, self.willing = [], patience, willing
        self[self.cell["record"]] = self[self.cell["taken"]] = start

    def get(self, name, default=0.0):
        record, taken = self.cell["record"], self.cell["taken"]
        if name == taken and self[taken] != self[record]:
            self.left -= 1
            if self.left < 0:
                raise TimeoutError
            if self.willing:
                self.taken.append({what: super(Computer, self).get(self.cell[what], 0.0) for what in OFF})
                self[taken] = self[record]
                return self[record] - 1  # the computer's answer is seen at the next look
        return super().get(name, default)


def ran(lines, computer, name="R700"):
    known = replace(siemens.default_profile(golden().machine), **(ACTIVE | {"user": {} if name == "R700" else {name: 17}}))

    MOVED.clear()

    def build(motion, punch, noted):
        def note(event, **data):
            if event in ("feed", "rapid", "skip", "contact"):
                MOVED.append(event)
            noted(event, **data)

        motion._note = note
        control = siemens.Control(motion, known, punch, note)
        control.parameters = computer
        return control

    return run_on(build, lines, golden())


@pytest.mark.few(1)
@pytest.mark.parametrize("name", NAMES)
def test_every_record_is_that_of_the_printed_one(name):
    printed = [event for event in ran(lines_of("siemens", golden()), {}).records(golden()) if isinstance(event, Touched)]
    computer = Computer(name, start=65533.0)
    lines = lines_of("siemens", golden(), handshake=name)
    assert ran(lines, computer, name).alarm is None
    first, *given, last = computer.taken
    assert (first["point"], last["point"]) == (0, 65535) and {one["count"] for one in computer.taken} == {len(printed)}
    assert [one["record"] for one in computer.taken][:4] == [65534, 65535, 0, 1]  # counted on from 65535 to 0
    assert len(given) == len(printed)
    for one, record in zip(given, printed, strict=True):
        assert (one["point"], one["flag"]) == (record.number, record.flag)
        for letter, value in record.position.items():
            assert one[letter] == pytest.approx(value, abs=1e-4)
        assert one["sum"] == pytest.approx(sum(record.position.values()), abs=1e-3)


def test_nothing_moves_before_the_start_mark_has_been_taken():
    computer = Computer("R700", patience=50, willing=False)
    came = None
    with contextlib.suppress(TimeoutError):
        came = ran(lines_of("siemens", golden(), handshake="R700"), computer)
    assert came is None and computer.left < 0 and MOVED == []


def test_a_taken_of_yesterday_takes_nothing():
    for record, taken in ((4.0, 5.0), (65535.0, 0.0)):
        computer = Computer("R700", willing=False)
        computer["R700"], computer["R701"] = record, taken
        came = ran(lines_of("siemens", golden(), handshake="R700"), computer)
        assert came.moves == 0 and computer.taken == [] and "AHEAD" in " ".join(came.messages)


@pytest.mark.parametrize("name", NAMES)
def test_what_the_post_writes_passes(name):
    assert refused(lines_of("siemens", golden(), handshake=name), "siemens", handshake=name) == ""


@pytest.mark.long
def test_every_line_of_the_handshake_is_needed():
    """One line left out, or with another number in it: refused, but for what the two marks say beside their point."""
    lines = lines_of("siemens", golden(), handshake="R700")
    end = lines.index("M30")
    first_two = [i for i, line in enumerate(lines[:end]) if line.startswith("R700=R700")][:2]
    last = max(i for i, line in enumerate(lines[:end]) if line == "R702=65535")
    spots = [i for i in (*range(first_two[1] + 12), *range(last, end)) if re.search(r"\bR7\d\d\b|WHILE|G4 F0.1", lines[i])]
    spots = [i for i in spots if not lines[i].startswith(";") and lines[i] not in ("R703=0", "R708=0")]
    assert len(spots) > 20
    for i in spots:
        assert refused([*lines[:i], *lines[i + 1 :]], "siemens", handshake="R700"), lines[i]
        other = re.sub(r"\bR7(\d)(\d)", lambda m: f"R7{m[1]}{(int(m[2]) + 1) % 10}", lines[i], count=1)
        assert other == lines[i] or refused([*lines[:i], other, *lines[i + 1 :]], "siemens", handshake="R700"), other


def test_a_program_with_variables_is_refused_where_the_profile_names_none():
    assert refused(lines_of("siemens", golden(), handshake="R700"), "siemens")
    assert refused(lines_of("siemens", golden()), "siemens", handshake="R700") == ""  # one that prints says so itself


@pytest.mark.parametrize("name", ["R", "R990", "7", "tango", "G17", "R7000", 'A"B'])
def test_a_name_that_is_none_is_refused(name):
    with pytest.raises(InputError, match=r"controller\.handshake"):
        lines_of("siemens", golden(), handshake=name)
