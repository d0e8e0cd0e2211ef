"""What every file in postprocessors/ has to keep to; a new dialect is tested the moment its file exists.

Programs are compared with tests/golden/<dialect>/. After a change that is meant, look at the difference and write them anew with

    TANGO_GOLDEN=write .venv/bin/python -m pytest tests/contracts/test_posts.py
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from support.namedcontrols import complaint, first, missing
from support.rows import command, writing

from postprocessors import Job, Leg, Post, comment, companions, load, mark_of, names, program, settings, unverified
from sim_controller.named import FOLDER
from sim_controller.session import families
from tango_cnc import commission, readback
from tango_cnc.files import read_cell
from tango_cnc.files.plan import plan_lines
from tango_cnc.link.client import Refused, Touched
from tango_cnc.link.words import record
from tango_cnc.plan import part, plan, plan_hash
from tango_cnc.records import Cell, InputError, Plan

GOLDEN = Path(__file__).parent.parent / "golden"
WRITE = command("tests/contracts/test_posts.py")
MOVES = ("retract", "clear", "index", "approach", "probe", "back", "record")
WHOLE = ("begin", "probe_on", "probe_off", "end")


@pytest.fixture(scope="module")
def cell() -> Cell:
    return read_cell(GOLDEN / "cell")


@pytest.fixture(scope="module")
def made(cell: Cell) -> Plan:
    return plan(cell)


@pytest.fixture(params=names())
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@cache
def refused(name: str) -> str:
    """dialect → why its defaults make no program of the golden cell, "" where they make one."""
    golden = plan(read_cell(GOLDEN / "cell"))
    try:
        program(load(name), golden, {}, plan_hash(golden))
    except InputError as error:
        return str(error)
    return ""


def test_the_defaults_make_a_program(name: str) -> None:
    assert not refused(name), (
        f"postprocessors/{name}.py: {refused(name)}. Correct its default; the other tests wait for it. Where the control has this "
        f"word, it speaks another language than {load(name).language} (docs/dialects.md, Writing one)"
    )


def test_its_language_is_one_that_is_read_and_run(name: str) -> None:
    known = sorted(set(readback.names()) & set(families()))
    assert load(name).language in known, (
        f"postprocessors/{name}.py: found language={load(name).language!r}; allowed in this project: {', '.join(known)}. "
        "For another one, write tango_cnc/readback/languages/<language>.py and sim_controller/languages/<language>.py "
        "(docs/dialects.md, Writing one); the other tests wait for it"
    )


def test_the_simulated_control_of_its_name_is_described_from_its_manual(name: str) -> None:
    if load(name).language in {*readback.names()} & {*families()}:
        if writing() and missing(name):
            (FOLDER / f"{name}.yaml").write_text(first(name), encoding="utf-8")
        assert not complaint(name), complaint(name)


@pytest.fixture
def post(name: str) -> Post:
    if load(name).language not in {*readback.names()} & {*families()}:
        pytest.skip("nothing reads its language: see test_its_language_is_one_that_is_read_and_run")
    if refused(name):
        pytest.skip("its defaults make no program: see test_the_defaults_make_a_program")
    return load(name)


def text_of(post: Post, made: Plan, options: dict[str, Any] | None = None) -> str:
    return "".join(f"{line}\n" for line in program(post, made, options or {}, plan_hash(made))[2]())


def code_of(text: str) -> list[str]:
    """text of a program → its lines without comments in ( ) and behind ;"""
    return [re.sub(r"\([^)]*\)|;.*", "", line).strip() for line in text.splitlines()]


def compare(file: Path, text: str) -> None:
    if writing():
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    assert file.is_file(), f"{file} is missing; write it with: {WRITE} -k {file.parent.name}"
    assert text == file.read_text(encoding="utf-8"), f"if this difference is meant: {WRITE} -k {file.parent.name}"


def test_the_program_is_the_golden_one(name: str, post: Post, made: Plan) -> None:
    compare(GOLDEN / name / program(post, made, {}, plan_hash(made))[0], text_of(post, made))


def test_the_files_beside_the_program_are_the_golden_ones(name: str, post: Post, made: Plan) -> None:
    for file, lines in companions(post, made, {}).items():
        compare(GOLDEN / name / file, "".join(f"{line}\n" for line in lines))


def test_the_plan_is_the_golden_one(made: Plan) -> None:
    compare(GOLDEN / "plan.csv", "".join(f"{line}\n" for line in plan_lines(made)))


def test_every_step_says_something(post: Post, made: Plan) -> None:
    """A step that yields nothing would be a silent gap: no probing, no record, no end."""
    job = Job(made, settings(post, {}), "P", "M", unverified(post, {}))
    for step in WHOLE:
        assert any(line.strip() for line in getattr(post, step)(job)), step
    place: dict[str, float] = {}
    for move in made.moves:
        place.update(move.target)
        leg = Leg(move.kind, move.target, dict(place), made.touches[move.touch - 1])
        assert any(line.strip() for line in getattr(post, move.kind)(job, leg)), move
        if move.kind == "back":
            assert any(line.strip() for line in post.record(job, leg)), move


def test_lines_are_plain_ascii_without_blanks_at_their_end(post: Post, made: Plan) -> None:
    for line in text_of(post, made).splitlines():
        assert line.isascii() and line.isprintable() and line == line.rstrip(), line
        assert len(line) <= 128, line


def test_axis_words_have_a_decimal_point_and_no_exponent(post: Post, made: Plan) -> None:
    text = text_of(post, made)
    for line in code_of(text.replace(mark_of(text), "MARK").replace(plan_hash(made), "PLAN")):
        words = re.sub(r" R0(?= F\S+ M91)", "", line)  # Klartext: no compensation of the radius
        assert not re.search(r"(?<![A-Z0-9<_#%\[])[XYZABCIJKR]=?[+-]?\d+(?![\d.])", words), line
        assert not re.search(r"\d\.?[eE][+-]?\d", line), line
        assert not re.search(r"[XYZABCSIJKR\[]-0\.0*(?![0-9])", line), line


def test_the_program_carries_a_mark_that_notices_any_change(post: Post, made: Plan) -> None:
    text = text_of(post, made)
    mark = program(post, made, {}, plan_hash(made))[1]
    assert mark_of(text) == mark
    assert mark_of(text.replace("\n", "\r\n")) == mark
    assert text.count(mark) >= 2, "header and start record carry it"
    assert plan_hash(made) in text
    changed = text.replace("180.", "181.")
    assert changed != text
    with pytest.raises(InputError, match="changed after"):
        mark_of(changed)
    with pytest.raises(InputError, match="no mark"):
        mark_of("G0 X1.")


@pytest.mark.few(6)
def test_the_same_plan_gives_the_same_program_and_another_one_another_mark(post: Post, cell: Cell, made: Plan) -> None:
    assert text_of(post, made) == text_of(post, plan(cell))
    some = part(made, [2, 5])
    assert program(post, some, {}, plan_hash(some))[1] != program(post, made, {}, plan_hash(made))[1]


@pytest.mark.few(10)
def test_no_text_from_a_file_reaches_the_program_unfiltered(post: Post, cell: Cell) -> None:
    """Hostile names give the program that their filtered forms give, marks aside."""

    def renamed(word: Callable[[str], str]) -> str:
        odd = 'x)\nM30 ; %\tO1 "[#500=1]" (äß'
        facets = {word(odd): replace(f, id=word(odd)) if f.id == "top" else f for f in cell.artefact.facets.values()}
        facets = {f.id: f for f in cell.artefact.facets.values() if f.id != "top"} | {
            word(odd): replace(cell.artefact.facets["top"], id=word(odd))
        }
        indexations = tuple(
            replace(i, facets=tuple(word(odd) if f == "top" else f for f in i.facets)) for i in cell.strategy.indexations
        )
        hostile = replace(
            cell,
            machine=replace(cell.machine, name=word(odd)),
            artefact=replace(cell.artefact, name=word(odd), facets=facets),
            strategy=replace(cell.strategy, name=word(odd), indexations=indexations),
        )
        made = plan(hostile)
        text = text_of(post, made)
        return text.replace(mark_of(text), "MARK").replace(plan_hash(made), "PLAN")

    assert renamed(str) == renamed(comment)


def test_touches_come_in_the_order_of_the_plan(post: Post, made: Plan) -> None:
    """Every record step is called once a touch, in order, between its own probing move and the next one."""
    calls: list[tuple[str, int]] = []

    def noted(kind: str) -> Callable[[Job, Leg], list[str]]:
        def step(job: Job, leg: Leg) -> list[str]:
            calls.append((kind, leg.touch.number))
            return list(getattr(post, kind)(job, leg))

        return step

    list(program(replace(post, probe=noted("probe"), record=noted("record")), made, {}, "P")[2]())
    calls = calls[len(calls) // 2 :]  # the program is written twice: once for its mark
    assert calls == [(kind, touch.number) for touch in made.touches for kind in ("probe", "record")]


@pytest.mark.few(3)
def test_a_rotary_axis_turns_between_the_words_that_free_and_hold_it(name: str, post: Post, made: Plan) -> None:
    stated = {"unclamp": {"C": "M711"}, "clamp": {"C": "M710"}}
    said = [text for line in code_of(text_of(post, made, stated)) if (text := re.sub(r"^\d+ |^#114=.*", "", line))]
    turns = [i for i, line in enumerate(said) if line == "M711"]
    assert len(turns) == said.count("M710") == sum(move.kind == "index" and "C" in move.target for move in made.moves)
    plain = [text for line in code_of(text_of(post, made)) if (text := re.sub(r"^\d+ |^#114=.*", "", line))]
    assert {said[i + 2] for i in turns} == {"M710"}
    together = [f"G0 {line.split()[-1]}" for line in plain if post.link == "grbl" and line.startswith("G0 ")]  # all axes in a line
    assert {said[i + 1] for i in turns} <= {*plain, *together}
    read = text_of(post, made, stated).splitlines()
    assert not readback.check(
        lambda: iter(read), made, settings(post, stated), companions(post, made, stated), written_in=post.language
    )


def test_each_word_that_switches_the_probe_stands_at_its_own_end_also_alone(made: Plan) -> None:
    """On is said before the first touch, off behind the last. A program that is sent without them asks for a hand."""
    mark, by_hand = plan_hash(made), "SWITCH IT BY HAND"
    for post in map(load, names()):
        keys = {option.name for option in post.options} & {"probe_on", "probe_off"}
        for key in keys:
            text = "\n".join(program(post, made, {key: "M80"}, mark)[2]())
            touch = re.search(rf"\bTOUCH {made.touches[0].number}\b", text)
            assert touch is not None and "M80" in (text[: touch.start()] if key == "probe_on" else text[touch.end() :]), post.title
            assert (by_hand in text) == (post.link == "grbl"), post.title
        assert not keys or by_hand not in "\n".join(program(post, made, {}, mark)[2]()), post.title


@pytest.mark.few(5)
def test_its_program_is_read_back(post: Post, made: Plan) -> None:
    lines = text_of(post, made).splitlines()
    assert not readback.check(lambda: iter(lines), made, settings(post, {}), companions(post, made, {}), written_in=post.language)


def test_a_program_is_written_in_the_language_that_its_post_names_and_in_no_other(post: Post, made: Plan) -> None:
    lines = text_of(post, made).splitlines()
    assert readback.recognized(lambda: iter(lines)) == [post.language]
    assert post.language in families()


def test_a_record_without_its_sum_is_refused_where_the_post_prints_sums(post: Post, made: Plan) -> None:
    letters = post.record_letters(made.machine)
    touched = " ".join(["P1 H1", *(f"{letter}1.000" for letter in letters)])
    wanted = (*letters, "K") if post.summed else letters
    assert isinstance(record(touched, wanted), Refused if post.summed else Touched)
    assert isinstance(record(f"{touched} K{len(letters)}.000", wanted), Touched)


def test_what_is_unverified_is_in_the_header_until_the_profile_states_it(post: Post, made: Plan) -> None:
    text = text_of(post, made)
    assert text.count("UNVERIFIED") == len(unverified(post, {})) >= 1
    doubtful = next(o for o in post.options if not o.verified)
    assert len(unverified(post, {doubtful.name: doubtful.default})) == len(unverified(post, {})) - 1


@pytest.mark.few(9)
def test_the_header_lists_what_is_unverified_by_danger_and_says_what_a_dry_run_does_not_do(post: Post, made: Plan) -> None:
    head = " ".join(re.sub(r"^[(;\d ]+|\)$", "", line).strip() for line in text_of(post, made).splitlines())
    place = {doubt: head.index(f"UNVERIFIED {comment(doubt, 40)}") for doubt in unverified(post, {})}
    listed = commission.remaining(place, {})  # as 'tango plan' lists them
    dangers = {doubt: experiment.danger if experiment else 9 for experiment, doubts in listed for doubt in doubts}
    assert [dangers[doubt] for doubt in sorted(place, key=lambda doubt: place[doubt])] == sorted(dangers.values())
    acts = settings(post, {})["feed_override"] == "acts"
    before = head[: min(place.values())]
    assert ("KEEP THE FEED OVERRIDE AT 100 PERCENT" if acts else "DRY RUN AND FEED OVERRIDE MAY NOT ACT ON PROBING MOVES") in before
    assert ("DRY RUN OFF - IT ACTS" in before) == (post.language == "siemens")  # LinuxCNC has no dry run
    bare = text_of(post, made, {"gate": "none"}).splitlines() if post.gate is not None else []
    assert all("NOTHING PROVES THE PROBE ALIVE" in line for line in [line for line in bare if "UNVERIFIED" in line][:1])


def test_an_unknown_option_is_refused_with_what_there_is(post: Post) -> None:
    known = post.options[0].name
    with pytest.raises(InputError, match=rf"found the unknown key '{known}x'; allowed: post, port, .*Did you mean '{known}'"):
        settings(post, {f"{known}x": 1})


def test_an_option_of_the_wrong_kind_is_refused(post: Post) -> None:
    for option in post.options:
        with pytest.raises(InputError, match=rf"controller\.{option.name}: found .*; allowed: "):
            settings(post, {option.name: object()})


def test_words_of_the_profile_cannot_smuggle_in_comments_or_lines(post: Post) -> None:
    for option in post.options:
        if option.codes:
            for hostile in ("M5\nM30", "M5)", "(X", "#1=2", "m5", "M5;"):
                with pytest.raises(InputError, match=rf"controller\.{option.name}"):
                    settings(post, {option.name: hostile})


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -12345678.5])
def test_a_number_that_is_none_is_refused(post: Post, made: Plan, bad: float) -> None:
    touch = replace(made.touches[0], end=(bad, *made.touches[0].end[1:]))
    with pytest.raises(InputError, match=r"position is|more than the eight digits"):
        program(post, replace(made, touches=(touch, *made.touches[1:])), {}, "P")


def test_a_post_that_forgets_a_step_is_a_type_error() -> None:
    given = {f.name: getattr(load(names()[0]), f.name) for f in fields(Post)}
    for step in (*MOVES, *WHOLE, "stem"):
        rest = {key: value for key, value in given.items() if key != step}
        with pytest.raises(TypeError, match=step):
            Post(**rest)
