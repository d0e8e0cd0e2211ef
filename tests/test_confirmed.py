"""`confirmed:` of the profile: a doubt of the post that its user has checked on the control is no longer listed."""

from __future__ import annotations

import json
import re
import shutil
import textwrap
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.runs import STRATEGY, Control, run

from postprocessors import Post, comment, load, names, settings, unverified
from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example
from tango_cnc.records import InputError

CELL = Path(__file__).parent / "golden" / "cell"
TRACK = next(doubt for doubt in load("heidenhain").doubts if doubt.startswith("TRACK of the probe table is off: "))
WITH: dict[str, list[dict[str, Any]]] = {"heidenhain": [{}, {"cycle": 444}]}  # options that bring doubts of their own


def call(*arguments: object) -> int:
    return guarded(tango.main, [str(a) for a in arguments], prog_name="tango", standalone_mode=False)


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    shutil.copytree(CELL, tmp_path / "cell")
    return tmp_path / "cell"


def profile(cell: Path, *lines: str, post: str = "heidenhain") -> Path:
    """folder of a cell, lines under `confirmed:` → its tango.yaml, written; the first entry stands in line 8."""
    text = "tango: 1\nmachine: machine.yaml\nartefact: artefact.yaml\nstrategy: strategy.yaml\ncontroller:\n"
    state = "  probe_state: none\n" if post == "fanuc" else ""
    text += f"  post: {post}\n{state}  confirmed:\n" + "".join(f"    {line}\n" for line in lines)
    (cell / "tango.yaml").write_text(text, encoding="utf-8")
    return cell / "tango.yaml"


def open_facts(post: Post, given: dict[str, Any]) -> list[str]:
    """post, `controller` keys → what is unverified and no option."""
    keys = tuple(f"{option.name} = " for option in post.options if option.name not in given and not option.verified)
    return [text for text in unverified(post, given) if not text.startswith(keys)]


# Through the command line


@pytest.mark.few(0)
def test_what_is_confirmed_leaves_the_list_and_the_header(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    profile(cell, "[]")
    assert call("plan", "-C", cell, "--json", "-") == 0
    before = json.loads(capsys.readouterr().out)
    assert TRACK in before["unverified"] and "UNVERIFIED TRACK" in (cell / "program" / "TANGO.H").read_text()
    profile(cell, "- TRACK of the probe table is off", "- nothing has left cycle 26")
    assert call("plan", "-C", cell, "--json", "-") == 0
    after = json.loads(capsys.readouterr().out)
    text = (cell / "program" / "TANGO.H").read_text()
    gone = [doubt for doubt in before["unverified"] if doubt not in after["unverified"]]
    assert [doubt[:20] for doubt in gone] == ["nothing has left cyc", "TRACK of the probe t"]
    assert "TRACK" not in text and text.count("UNVERIFIED") == len(after["unverified"]) == len(before["unverified"]) - 2
    assert after["plan_hash"] == before["plan_hash"] and after["program_hash"] != before["program_hash"]


@pytest.mark.few(0)
def test_the_parts_of_a_plan_say_the_same(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    profile(cell, "- TRACK of the probe table is off")
    assert call("plan", "-C", cell, "--split", 2) == 0
    programs = [file.read_text() for file in sorted((cell / "program").glob("*.H"))]
    assert len(programs) == 3 and all("TRACK" not in text and "UNVERIFIED NOTHING HAS LEFT" in text for text in programs)
    assert "a fact without = under confirmed:" in (said := capsys.readouterr().out) and "TRACK" not in said


def test_a_line_that_is_copied_from_the_list_is_read_as_it_stands(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """YAML makes a mapping of a text with a colon."""
    profile(cell, f"- {TRACK}")
    assert call("plan", "-C", cell) == 0
    assert "TRACK" not in capsys.readouterr().out


@pytest.mark.parametrize("command", [["plan"], ["plan", "--dry-run"], ["check"], ["run", "--port", "socket://127.0.0.1:9"]])
def test_what_is_no_fact_is_refused_with_its_line_and_changes_nothing(
    cell: Path, capsys: pytest.CaptureFixture[str], command: list[str]
) -> None:
    file = profile(cell, "- nothing has left cycle 26", "- TRAK of the prob tabel")
    assert call(*command, "-C", cell) == 2
    said = capsys.readouterr().err
    assert f"{file}:9: controller.confirmed: found 'TRAK of the prob tabel', which is no fact that this post leaves open" in said
    assert f"Did you mean '{TRACK}'?" in said
    assert not (cell / "program").exists() and not (cell / "readings.csv").exists()


def test_the_program_that_is_sent_has_it_no_longer(tmp_path: Path) -> None:
    folder = tmp_path / "cell"
    write_example(folder, "hu40t")
    (folder / "strategy.yaml").write_text(STRATEGY)
    file = folder / "tango.yaml"
    root = file.read_text(encoding="utf-8").partition("controller:")[0]
    file.write_text(
        f"{root}controller:\n  post: fanuc\n  probe_state: none\n  confirmed: [G53 G0 turns a rotary axis]\n", encoding="utf-8"
    )
    control = Control(folder)
    assert run(folder, control).code == 0 and (folder / "readings.csv").exists()
    assert b"UNVERIFIED G31 ENDS AT ONCE" in control.tape and b"G53 G0 TURNS" not in control.tape


def test_a_post_by_option_starts_from_its_own_defaults(cell: Path) -> None:
    """As with every other key of the profile: what holds for one control says nothing of another."""
    profile(cell, "- TRACK of the probe table is off")
    assert call("plan", "-C", cell, "--post", "fanuc") == 0


def test_a_post_of_ones_own_has_it_too(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = (Path(__file__).parent.parent / "postprocessors" / "grbl.py").read_text(encoding="utf-8")
    (cell / "own.py").write_text(source.replace("from ._", "from postprocessors._"), encoding="utf-8")
    assert call("plan", "-C", cell, "--post", cell / "own.py", "--json", "-") == 0
    assert "the letters of the rotary axes are those of the build" in json.loads(capsys.readouterr().out)["unverified"]
    profile(cell, "- THE LETTERS OF THE ROTARY AXES", post="./own.py")
    assert call("plan", "-C", cell, "--json", "-") == 0
    assert not [text for text in json.loads(capsys.readouterr().out)["unverified"] if "letters of the rotary" in text]


@pytest.mark.few(1)
@pytest.mark.parametrize("page", ["formats", "dialects"])
def test_the_example_of_the_page_works(cell: Path, capsys: pytest.CaptureFixture[str], page: str) -> None:
    text = (Path(__file__).parent.parent / "docs" / f"{page}.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"(?m)^ *controller:\n(?:(?!```).+\n)*? *confirmed:.*\n(?:.*- .*\n)+", text)
    root = profile(cell).read_text(encoding="utf-8").partition("controller:")[0]
    (cell / "tango.yaml").write_text(root + textwrap.dedent(example), encoding="utf-8")
    assert call("plan", "-C", cell) == 0
    said = capsys.readouterr().out
    for entry in (entries := yaml.safe_load(textwrap.dedent(example))["controller"]["confirmed"]):
        assert entry not in said
    assert len(entries) == 2 and "stops nothing" in said


# Every doubt of every dialect


@pytest.mark.parametrize(("name", "options"), [(name, given) for name in names() for given in WITH.get(name, [{}])])
def test_every_doubt_is_confirmed_by_its_text_and_by_that_of_the_header(name: str, options: dict[str, Any]) -> None:
    post = load(name)
    facts, listed = open_facts(post, options), unverified(post, options)
    assert facts, "a dialect that nobody has run on a machine has doubts"
    for fact in facts:
        rest = tuple(text for text in listed if text != fact)
        assert len(rest) == len(listed) - 1
        for text in (fact, comment(fact, 1000), f"UNVERIFIED {comment(fact, 60)}"):
            assert unverified(post, {**options, "confirmed": [text]}) == rest, text
    assert open_facts(post, {**options, "confirmed": facts}) == []


def test_a_fact_in_quotes_may_have_any_sign(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fact = "#506x, #502x and #504x of axes at rest differ by constants"
    profile(cell, f'- "{fact}"', post="fanuc")
    assert call("plan", "-C", cell) == 0
    assert fact not in capsys.readouterr().out
    profile(cell, "- G53 G0 turns a rotary axis", f"- {fact}", post="fanuc")
    assert call("plan", "-C", cell) == 2
    assert re.search(r"tango\.yaml:10: .* found nothing in place 2; allowed: texts; put it in quotes", capsys.readouterr().err)


def test_a_doubt_that_an_option_brings_is_there_with_the_option_only() -> None:
    post, said = load("heidenhain"), {"confirmed": ["the text of cycle 444"]}
    cycle = {"cycle": 444}
    (gone,) = set(unverified(post, cycle)) - set(unverified(post, cycle | said))
    assert gone.startswith("the text of cycle 444 and of its parameters")
    with pytest.raises(InputError, match="found 'the text of cycle 444', which is no fact that this post leaves open"):
        settings(post, said)


def test_it_is_no_option_that_a_step_sees() -> None:
    post = load("heidenhain")
    assert settings(post, {"confirmed": ["nothing has left cycle 26"]}) == settings(post, {}) == settings(post, {"confirmed": []})


@pytest.mark.parametrize(
    ("stated", "left"),
    [
        (
            "the probe is on",
            ["the probe is on at the start", "#1 is on", "$1 is on", "датчик готов"],
        ),  # whole, though another begins so
        ("THE PROBE IS ON", ["the probe is on at the start", "#1 is on", "$1 is on", "датчик готов"]),
        ("THE PROBE IS ON AT", ["the probe is on", "#1 is on", "$1 is on", "датчик готов"]),
        ("$1 is on", ["the probe is on", "the probe is on at the start", "#1 is on", "датчик готов"]),
        ("датчик готов", ["the probe is on", "the probe is on at the start", "#1 is on", "$1 is on"]),
    ],
)
def test_doubts_that_look_alike_are_told_apart_by_their_text(stated: str, left: list[str]) -> None:
    alike = ("the probe is on", "the probe is on at the start", "#1 is on", "$1 is on", "датчик готов")
    post = replace(load("grbl"), doubts=alike, further=lambda given: alike[:1])  # the first one is said twice
    said = unverified(post, {"confirmed": [stated]})
    assert list(dict.fromkeys(text for text in said if text in alike)) == left


@pytest.mark.parametrize(
    ("name", "settled", "open_still"),
    [
        ("fanuc", ("reading ahead", "when nothing is met", "wait = "), ("ends at once when the probe is deflected",)),
        ("haas", ("G53 alone stop the control", "when nothing is met"), ("wait = G103 P1", "ends at once")),
        ("mitsubishi", ("G31 ends at once", "when nothing is met"), ("reading ahead",)),
        ("mazak", (), ("ends at once", "when nothing is met", "reading ahead")),
    ],
)
def test_what_a_manual_has_settled_is_no_doubt_any_more(name: str, settled: tuple[str, ...], open_still: tuple[str, ...]) -> None:
    """B-63614EN p. 322 and the 15i manual p. 674; Haas' page on G31; M700V p. 547."""
    listed = "\n".join(unverified(load(name), {}))
    assert [text for text in settled if text in listed] == [] and [text for text in open_still if text not in listed] == []


def test_a_post_without_doubts_has_nothing_to_confirm() -> None:
    with pytest.raises(InputError, match="found 'anything'; allowed: nothing, as this post has no doubts; leave the key out"):
        settings(replace(load("grbl"), doubts=(), further=lambda given: ()), {"confirmed": ["anything"]})


def test_grbl_with_three_axes_has_no_rotary_letters_to_confirm() -> None:
    letters = "the letters of the rotary axes are those of the build"
    assert letters in unverified(load("grbl"), {}) and letters not in unverified(load("grbl"), {"control": "grbl"})


# What is refused


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ("TRACK of the probe table is off", "found 'TRACK of the probe table is off'; allowed: a list, one fact a line"),
        ("", "found nothing; allowed: a list"),
        ("444", "found 444; allowed: a list"),
        ("[444]", "found 444 in place 1; allowed: texts"),
        ("[[nothing has left cycle 26]]", r"found \['nothing has left cycle 26'\] in place 1; allowed: texts"),
        ("['']", r"found '', which is no fact that this post leaves open; allowed: .*:\n  the text of TCH PROBE 4"),
        ("[TRACK]", rf"found 'TRACK', which says too little; .*12 letters and digits or more.* Did you mean '{TRACK}'"),
        ("[t]", r"found 't', with which \d facts begin; allowed: one; write more of it.*:\n  the text of"),
        (
            "[no such thing at all]",
            r"found 'no such thing at all', which is no fact that this post leaves open; .*:\n  the text of TCH PROBE 4",
        ),
        (
            "[the probe table is off]",
            f"found 'the probe table is off', which is no fact that this post leaves open; .* Did you mean '{TRACK}'",
        ),
        ("[clamp]", "found 'clamp', which is a key of its own; .*write clamp with its value under controller:"),
        (
            "['positioning_feed = 2000.0: mm/min']",
            "found 'positioning_feed = .*', which is a key of its own; .*write positioning_feed with its value",
        ),
        (
            "[nothing has left cycle 26, NOTHING HAS LEFT CYCLE]",
            "found 'NOTHING HAS LEFT CYCLE', which is 'nothing has left cycle 26' once more; allowed: each fact once",
        ),
    ],
)
def test_what_is_none_is_told_so(stated: str, said: str) -> None:
    with pytest.raises(InputError, match=rf"(?s)controller\.confirmed: {said}"):
        settings(load("heidenhain"), {"confirmed": yaml.safe_load(stated)})


def test_a_beginning_is_long_enough_from_twelve_letters_and_digits_on() -> None:
    post = load("heidenhain")
    assert set(unverified(post, {})) - set(unverified(post, {"confirmed": ["track-OF the pr"]})) == {TRACK}
    with pytest.raises(InputError, match="found 'track-OF the p', which says too little"):
        settings(post, {"confirmed": ["track-OF the p"]})


def test_the_key_is_named_where_another_is_misspelt() -> None:
    with pytest.raises(InputError, match=r"'confirm'; allowed: post, port, confirmed, .* Did you mean 'confirmed'"):
        settings(load("fanuc"), {"confirm": []})
