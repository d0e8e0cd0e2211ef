"""A whole run against controllers that live in memory, with a clock that only moves when somebody waits."""

import io

import pytest
from support.linkparts import MARK, FakeClock, Memory, job
from support.sessions import GOOD, Run, after_the_program, printed

from tango_cnc.link.journal import Journal, read_journal
from tango_cnc.link.protocols import dnc
from tango_cnc.link.session import Session
from tango_cnc.records import InputError


def test_a_run_from_start_mark_to_end_mark(tmp_path):
    run = Run(tmp_path, after_the_program(printed(*GOOD)))
    assert run.error == ""
    assert bytes(run.line.written) == dnc.tape(job().program)
    assert [entry.touch for entry in run.kinds("reading")] == [1, 2, 3]
    assert [step.deviation for step in run.steps[1:]] == pytest.approx([-3.0, 12.0, -2.0])
    assert [(step.done, step.total) for step in run.steps] == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert run.entries[-1].complete is True


def test_the_end_mark_of_another_program_ends_nothing(tmp_path):
    assert Run(tmp_path, after_the_program(printed(*GOOD, end=f"TANGO END {MARK} 3"))).error == ""
    (tmp_path / "other").mkdir()
    other = Run(tmp_path / "other", after_the_program(printed(*GOOD, end="TANGO END 5AFE00000001 3")))
    assert "silent" in other.error and "the end mark of another program" in other.kinds("refused")[0].why
    assert [entry.touch for entry in other.kinds("reading")] == [1, 2, 3]


def test_every_reading_is_on_disk_before_another_byte_is_sent(tmp_path):
    """The control holds the line after the first record; while it does, the journal already has that reading."""
    seen = []

    def answer(written):
        if len(written) < 16:
            return b""
        seen.append(sum(entry.kind == "reading" for entry in read_journal(tmp_path / "run.journal")[0]))
        return printed(GOOD[0], end="") + (printed(*GOOD[1:], begin="") if written.endswith(b"%\n") and len(written) > 20 else b"")

    run = Run(tmp_path, answer)
    assert run.error == ""
    assert seen[:2] == [0, 1]


def test_a_control_that_stops_is_given_up_and_the_touch_that_was_due_is_named(tmp_path):
    run = Run(tmp_path, after_the_program(printed(GOOD[0], end="")))
    assert "silent for longer than 30 s" in run.error
    assert "1 of 3 touches are recorded, touch 2 was due" in run.error
    assert "look at the machine" in run.error
    assert 30 < run.clock.seconds < 31
    assert [entry.touch for entry in run.kinds("reading")] == [1]
    assert run.entries[-1].complete is False


def test_a_control_that_never_answers_is_given_up_after_the_time_to_press_a_button(tmp_path):
    run = Run(tmp_path, lambda written: b"", this_job=job(start_patience=120.0))
    assert "silent for longer than 120 s" in run.error
    assert "may still execute what it has received: look at the machine" in run.error
    assert "0 of 3 touches" in run.error


def test_the_person_at_the_machine_is_told_when_it_is_the_control_s_turn(tmp_path):
    run = Run(tmp_path, lambda written: b"", this_job=job(start_patience=20.0))
    assert [step.remark for step in run.steps] == ["the program is sent (45 bytes): start it at the control"]


def test_a_line_that_breaks_after_some_touches(tmp_path):
    given = printed(*GOOD[:2], end="")

    def answer(written):
        if not written.endswith(b"%\n") or len(written) < 20:
            return b""
        return None if run_is_over() else given

    state = {"asked": 0}

    def run_is_over():
        state["asked"] += 1
        return state["asked"] > 2

    run = Run(tmp_path, answer)
    assert run.error.startswith("the other side closed the connection. ")
    assert "2 of 3 touches are recorded, touch 3 was due" in run.error


def test_a_record_that_is_not_believed_is_said_and_its_touch_is_missing(tmp_path):
    wrong = GOOD[1].replace("Y30.0120", "Y38.0120").replace("Z50", "Z58")
    run = Run(tmp_path, after_the_program(printed(GOOD[0], wrong, GOOD[2])))
    assert "the record of touch 2 was not believed or not received" in run.error
    assert [entry.touch for entry in run.kinds("reading")] == [1, 3]
    assert "beside the line" in run.kinds("refused")[0].why
    assert any("not believed" in (step.remark or "") for step in run.steps)


def test_a_repeated_record_is_refused(tmp_path):
    run = Run(tmp_path, after_the_program(printed(GOOD[0], GOOD[1], GOOD[1], GOOD[2])))
    assert run.error == ""
    assert [entry.touch for entry in run.kinds("reading")] == [1, 2, 3]
    assert "repeated or out of order" in run.kinds("refused")[0].why


def test_the_commanded_end_is_a_miss(tmp_path):
    run = Run(tmp_path, after_the_program(printed(GOOD[0].replace("X20.0030", "X25.0000"), *GOOD[1:])))
    assert [entry.status for entry in run.kinds("reading")] == ["miss", "ok", "ok"]
    assert run.steps[1].remark == "touch 1: miss"


def test_a_line_of_wrong_settings_is_given_up_after_ten_records(tmp_path):
    run = Run(tmp_path, after_the_program(printed(*["P1 H1 X~~~"] * 12)))
    assert "10 records in a row were not believed" in run.error
    assert len(run.kinds("refused")) == 10
    assert "settings of the line" in run.error


def test_the_user_stops_the_feeding_and_what_is_there_is_kept(tmp_path):
    steps = []

    def answer(written):
        return printed(GOOD[0], end="") if len(written) >= 16 else b""

    run = Run(tmp_path, answer, watch=steps.append, stop=lambda: len(steps) == 2)
    assert run.error.startswith("stopped by the user. 1 of 3 touches are recorded, touch 2 was due.")
    assert len(run.line.written) == 16
    assert [entry.touch for entry in run.kinds("reading")] == [1]


def test_a_second_segment_counts_in_the_numbers_of_the_run_and_time_goes_on(tmp_path):
    Run(tmp_path, after_the_program(printed(GOOD[0], end="")))
    rest = job(original=(2, 3, 4))
    later = FakeClock()
    later.seconds = 1000.0
    journal = Journal(tmp_path / "run.journal", resume=True)
    session = Session(rest, dnc.Client(rest, {}), journal, lambda step: None, clock=later, now=later.now)
    session.run(Memory(later, after_the_program(printed(*GOOD))))
    journal.close()
    readings = [entry for entry in read_journal(tmp_path / "run.journal")[0] if entry.kind == "reading"]
    assert [entry.touch for entry in readings] == [1, 2, 3, 4]
    assert readings[0].time_s < 1
    assert 999 < readings[1].time_s < 1001


def test_a_resumed_run_that_stops_says_that_its_count_is_of_its_own_program(tmp_path):
    run = Run(tmp_path, after_the_program(b""), this_job=job(original=(2, 3, 4), again=1))
    said = "0 of 3 touches of the resumed program are recorded, beside those of before, touch 2 was due"
    assert said in run.error


def test_the_transcript_of_a_run_can_be_replayed(tmp_path):
    out = io.StringIO()
    Run(tmp_path, after_the_program(printed(*GOOD)), transcript=out)
    lines = out.getvalue().splitlines()
    sent = "".join(line[3:] for line in lines if line.startswith("-> "))
    assert sent.encode().decode("unicode_escape") == dnc.tape(job().program).decode()
    assert any(line.startswith("<- \\x12TANGO START") for line in lines)


def test_a_percent_sign_within_a_program_would_end_the_tape_and_is_refused():
    with pytest.raises(InputError, match=r"program line 2: found '%_N_TANGO_MPF'.*ends the tape"):
        dnc.tape("; TANGO\n%_N_TANGO_MPF\nM30\n")
    with pytest.raises(InputError, match=r"program line 3: found '\(50%\)'"):
        dnc.tape("%\nO1\n(50%)\nM30\n%\n")


def test_blocks_have_an_even_number_of_characters_where_the_control_counts_them():
    assert dnc.tape("%\nO0001\nG31 X25.\nM30\n%\n", even=True) == b"%\nO0001\nG31 X25. \nM30\n%\n"
    assert all(len(line) % 2 for line in dnc.tape(job().program, even=True).decode().splitlines()[1:-1])


@pytest.mark.parametrize("text", ["O1\nM30", "%\nO1\nM30", "O1\nM30\n%", "%\nO1\nM30\n%\n\n"])
def test_a_tape_begins_and_ends_with_one_percent_line_whatever_the_program_has(text):
    assert dnc.tape(text) == b"%\nO1\nM30\n%\n"


def test_a_percent_alone_begins_a_tape_and_does_not_end_it():
    assert dnc.tape("%") == b"%\n%\n"


def test_the_drift_of_a_resumed_run_counts_from_the_touches_before_it_was_stopped(tmp_path):
    """The first touch stops the run; made again, its facet is 10 µm deeper."""
    Run(tmp_path, after_the_program(printed(GOOD[0], end="")))
    again = Run(tmp_path, after_the_program(printed(GOOD[0].replace("X20.0030", "X20.0130"), *GOOD[1:])), resume=True)
    first, second = (entry for entry in again.kinds("reading") if entry.touch == 1)
    assert first.drift_um is None
    assert second.drift_um == pytest.approx(second.deviation_um - first.deviation_um) == pytest.approx(-10.0)
