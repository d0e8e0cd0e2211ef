"""Every doubt is an experiment: where exactly one belief about a control is wrong, exactly this one fails, and nothing is hit."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.controls import GOLDEN, Ran, golden
from support.dialects import EVERY
from support.gates import NEAR, ran
from support.namedcontrols import differs
from support.proof_parts import keys_here
from support.randomplans import example
from support.rows import command, writing
from support.wrongcontrols import OPTIONS, Case, by_option, cases, declared, pointless, sees, table, turned_round

from postprocessors import companions, load, program, unverified
from postprocessors import settings as settings_of
from tango_cnc import commission, readback
from tango_cnc.cli import guarded, tango
from tango_cnc.commands.commission import record_of
from tango_cnc.commands.init import write_example
from tango_cnc.commission import flight
from tango_cnc.files import read_cell
from tango_cnc.files.commissioning import Proof, add_proofs, latest, read_commissioning
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import Cell, InputError, Machine, Plan

ALL_RIGHT = Case(None)
LIMIT = math.radians(365.0)  # of C: room for 350 deg, and none for 370
IN_THE_AIR = {e.belief for e in commission.experiments() if not e.touches}  # the others: test_commission_touch.py
QUICK = ("fanuc", "linuxcnc")  # by default; the others in CI
DIALECTS = [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in sorted(EVERY)]


def wrong(name: str) -> dict[str, Case]:
    """dialect → {belief, or option whose usual value is wrong: the control}; what is in both is there once."""
    known = cases(name)
    return known | {option: case for option, case in by_option(name).items() if case not in known.values()}


CASES = [
    pytest.param(name, belief, marks=() if name == "fanuc" else pytest.mark.long)
    for name in sorted(EVERY)
    for belief in wrong(name)
]


@cache
def air(
    stands: Callable[[Cell], Cell] = ALL_RIGHT.stands, restated: Callable[[Machine], Machine] = lambda machine: machine
) -> Plan:
    """what cell it is, what machine.yaml states instead → the plan in the air, from 350 to 10 deg of C at its end."""
    whole = stands(read_cell(GOLDEN))
    axes = tuple(replace(a, travel=(-LIMIT, LIMIT)) if a.name == "C" else a for a in whole.machine.axes)
    cell = replace(whole, machine=restated(replace(whole.machine, axes=axes)))
    return commission.air(plan(commission.rolling(cell)), own=len(cell.strategy.indexations))


def profile(name: str, stated: Mapping[str, Any]) -> dict[str, Any]:
    return {**stated, **({"misses": 20} if any(option.name == "misses" for option in load(name).options) else {})}


def stops_when_held(name: str, made: Plan, stated: Mapping[str, Any], habits: Mapping[str, Any], ignored: bool) -> bool:
    """dialect, plan, profile, habits, whether skip moves ignore a deflected probe → whether the program for a held stylus stops."""
    found = with_a_hand(name, made, stated, habits, probe="inverted", begins_deflected=ignored)
    return "TANGO END" not in found.out.decode("ascii", "replace")


def ends_at(made: Plan) -> dict[str, float]:
    """plan → {axis: mm or rad} where the machine stands at its end."""
    at: dict[str, float] = {}
    for move in made.moves:
        at.update(move.target)
    return at


def with_a_hand(name: str, made: Plan, stated: Mapping[str, Any], habits: Mapping[str, Any], **who: Any) -> Ran:
    """dialect, plan in the air, profile, habits, how the probe is → what came of the program for a hand, begun at its end.

    Nobody else is there: a signal that is on is the hand.
    """
    options = profile(name, stated) | {"gate": "none", "positioning_feed": commission.HELD_FEED}
    return ran(name, commission.held(made), options, habits, stands=ends_at(made), person=False, **who)


@pytest.mark.few(4)
@pytest.mark.parametrize("name", sorted(EVERY))
@pytest.mark.parametrize("ignored", [False, True])
def test_beside_a_hand_nothing_moves_more_than_a_millimetre_or_turns_or_moves_fast(name: str, ignored: bool) -> None:
    """On the control that it looks for, which goes on with a deflected probe, it is the hand that would be met."""
    made, options = air(), profile(name, {}) | {"gate": "none", "positioning_feed": commission.HELD_FEED}
    post, slight = load(name), commission.held(made)
    lines = list(program(post, slight, options, plan_hash(slight))[2]())
    readback.check(
        lambda: iter(lines), slight, settings_of(post, options), companions(post, slight, options), written_in=post.language
    )
    assert plan_hash(slight) not in (plan_hash(made), plan_hash(replace(slight, only=None)))
    found = with_a_hand(name, made, {}, {}, probe="inverted" if ignored else "alive", begins_deflected=ignored)
    begun = ends_at(made)
    moved = [abs(place[n] - begun[n]) for place in found.places for n in made.machine.linear]
    assert max(moved, default=0.0) < 1.0, moved
    turned = [
        math.remainder(place[n] - math.degrees(begun[n]), 360.0) for place in found.places for n in (*made.machine.rotary, "S")
    ]
    assert not np.any(np.abs(turned) > 0.01), turned  # grbl: its driver says an angle anew
    assert ignored or ("TANGO END" in found.out.decode() and moved and found.clock() > 0.4), (differs(name), found.why)


def seen(
    name: str,
    case: Case = ALL_RIGHT,
    stated: Mapping[str, Any] | None = None,
    restated: Callable[[Machine], Machine] | None = None,
) -> tuple[commission.Seen, list[str]]:
    """dialect, what is wrong, profile, what machine.yaml states instead → what the command sees, and the events of the machine."""
    believed, kept = air(case.stands), case.stated if stated is None else stated
    made = air(case.stands, restated) if restated else believed
    truly = case.truly(believed.machine) if case.truly else believed.machine
    how = case.wrong
    found = ran(name, made, profile(name, kept), truly=truly, **how)
    lines = printed(case.printed(found.out))
    touched = [line for line in lines if line.lstrip().startswith("P")]
    records = {r[0]: r[1:] for line in touched if (r := record_of(line, made))}
    refused = tuple(line for line in touched if record_of(line, made) is None)
    said = found.why or " ".join(found.stops)
    begun, ended = (any(f"TANGO {word} " in line for line in lines) for word in ("START", "END"))
    held = stops_when_held(name, made, kept, how.get("habits", {}), ignored=case.fails == "deflected")
    turned, kept_records = turned_down(name, kept, found.out, how, case) if not said else (None, None)
    asked = {b: {w: q.text for w, q in each.items()} for b, each in commission.questions(made).items()}
    farthest = max((place["C"] for place in found.places), default=0.0)
    answers = sees(made, truly, asked, case.person, farthest)
    if not case.person:  # one thing is not as it should be
        well = bool(case.oriented) and kept.get("orient") == case.oriented  # the word that turns this spindle
        answers = {b: {w: well or b != case.fails for w in each} for b, each in answers.items()}
    times = dict(enumerate(found.stamps, 1))
    stored = name != "grbl"
    what = commission.Seen(made, records, begun, ended, refused, said, None, held if not said else None, answers, times=times)
    what = replace(what, obeys=kept.get("feed_override") == "acts", anew=kept.get("records_file") == "anew")
    what = replace(what, unheard=unheard(found.events), doubts=unverified(load(name), kept))
    return replace(what, dialled=turned, kept=kept_records, stored=stored), [event for event, _ in found.events]


def unheard(events: Iterable[tuple[str, Mapping[str, Any]]]) -> bool:
    """events of the machine → whether the slow move up went on although somebody touched the stylus."""
    return any(event == "skip" and data.get("finger") and data["result"] == "miss" for event, data in events)


def printed(text: bytes) -> list[str]:
    return text.decode("ascii", "replace").replace("\x12", "").replace("\x14", "").splitlines()


@cache
def little() -> Plan:
    return commission.air(golden(), 1)


def turned_down(
    name: str, stated: Mapping[str, Any], first: bytes, how: Mapping[str, Any], case: Case
) -> tuple[dict[int, float], bool]:
    """dialect, profile, records of the first program, what is wrong → times of the second one with the feed override turned down,
    and whether the file holds both."""
    few = little()
    again = ran(name, few, profile(name, stated) | {"gate": "none"}, **{**how, "override": commission.DIAL})
    file = again.out if case.overwrites else first + again.out
    return dict(enumerate(again.stamps, 1)), file.count(b"TANGO START") == 2


def verdicts(what: commission.Seen, verdict: str) -> list[str]:
    return [j.experiment.belief for j in commission.judge(what) if j.verdict.verdict == verdict]


@pytest.mark.parametrize("probe", ["dead", "other"])
@pytest.mark.parametrize("name", [n if n == "fagor" else pytest.param(n, marks=pytest.mark.long) for n in sorted(EVERY)])
def test_a_dead_probe_beside_an_alarm_of_a_miss_is_found_first_or_right_after_it(name: str, probe: str) -> None:
    """Such an alarm comes at the first guarded move, before a finger is asked for: then the text says that the probe is unknown."""
    alarm = cases(name)["miss"].wrong
    what, events = seen(name, Case("alive", {**alarm, "probe": probe}))
    assert not set(NEAR) & set(events)
    (failed,) = [judged for judged in commission.judge(what) if judged.verdict.verdict == "FAIL"]
    if not what.unheard and name != "grbl":  # whose driver says it by itself
        assert failed.experiment.belief == "miss" and "nobody knows yet whether the control hears the probe" in failed.verdict.found
        what, events = seen(name, Case("alive", {"probe": probe}))  # the parameter is right now
        assert not set(NEAR) & set(events)
    assert verdicts(what, "FAIL") == ["alive"]


@pytest.mark.few(4)
@pytest.mark.parametrize("name", sorted(EVERY))
def test_its_program_is_read_back(name: str) -> None:
    made, options = air(), profile(name, {})
    post = load(name)
    lines = program(post, made, options, plan_hash(made))[2]
    beside = companions(post, made, options)
    assert not readback.check(lines, made, settings_of(post, options), beside, written_in=post.language)


@pytest.mark.parametrize("name", DIALECTS)
def test_a_control_on_which_all_is_right_passes(name: str) -> None:
    what, events = seen(name)
    assert set(verdicts(what, "PASS")) == IN_THE_AIR, (differs(name), what.said, commission.judge(what))
    assert not set(NEAR) & set(events)


@pytest.mark.parametrize("name", DIALECTS)
def test_a_signal_the_wrong_way_round_stops_the_program_up_there_and_the_text_says_to_turn_it(name: str) -> None:
    """Who looks at the probe says deflected (`alive`); who only sees a move stopped short cannot tell it from a frame."""
    what, events = seen(name, Case(None, {"probe": "inverted"}))
    assert not set(NEAR) & set(events) and not what.records
    (failed,) = verdicts(what, "FAIL")
    assert failed in ("alive", "frames") and "polarity" in next(e.advice for e in commission.experiments() if e.belief == failed)


@pytest.mark.parametrize(("name", "habit"), [("centroid", {"sticks": True}), ("fagor", {"status": "sticks"})])
def test_a_control_that_says_contact_where_nothing_was_met_is_no_wrong_frame(name: str, habit: dict[str, Any]) -> None:
    what, events = seen(name, Case("miss", {"habits": habit}))
    assert verdicts(what, "FAIL") == ["miss"] and not set(NEAR) & set(events)
    assert "CONTROL SAYS CONTACT WHERE NOTHING WAS MET" in what.said


def test_a_windows_with_a_decimal_comma_fails_records_and_nothing_else() -> None:
    what, events = seen("mach3", Case("records", {"habits": {"comma": True}}))
    assert verdicts(what, "FAIL") == ["records"] and not set(NEAR) & set(events)


@pytest.mark.parametrize("option", OPTIONS)
def test_a_dialect_that_declares_such_an_option_has_a_control_on_which_its_usual_value_is_wrong(option: str) -> None:
    """Only those of one language had one, by a typed list; a control that widens its fields needs none."""
    needless = {"print_format": ("overflow", "expanded")}
    key, value = needless.get(option, ("", None))
    having = [name for name in sorted(EVERY) if option in declared(name) and EVERY[name].settings.get(key, "") != value]
    assert having and all(option in by_option(name) for name in having), (
        f"{[name for name in having if option not in by_option(name)]}: the simulated control of it has no habit for {option} "
        "(tests/support/wrongcontrols.py, by_option)"
    )


def restated(case: Case, number: float, machine: Machine) -> Machine:
    """case, number that was found, machine.yaml → what it states afterwards."""
    assert case.restated is not None
    return case.restated(machine, number)


@pytest.mark.few(1)
@pytest.mark.parametrize(("name", "belief"), CASES)
def test_where_one_belief_is_wrong_this_one_fails_and_what_the_text_says_mends_it(name: str, belief: str) -> None:
    case = wrong(name)[belief]
    what, events = seen(name, case)
    assert not set(NEAR) & set(events)
    asked = ([case.fails] if case.fails else [], case.wrong, case.stated)
    assert verdicts(what, "FAIL") == asked[0], (differs(name), "fails, control, profile", asked, what.said, commission.judge(what))
    if case.fails is None:  # the program looks twice: nothing to mend
        return
    advice = next(e for e in commission.experiments() if e.belief == case.fails)
    own = " ".join(load(name).remedies.get(case.fails, ()))
    assert case.names in f"{advice.advice} {what.said}", advice
    if case.mended is not None:  # the control stays as it is
        after, events = seen(name, case, stated={**case.stated, **case.mended})
    elif case.restated is not None:
        number = next(j.verdict.value for j in commission.judge(what) if j.experiment.belief == case.fails)
        after, events = seen(name, case, restated=partial(restated, case, number or 0.0))
    else:  # a setting of the control, which its post names
        assert own, (
            f"postprocessors/{name}.py: nothing says what of the control mends {case.fails}: state remedies=… in POST, "
            f"with a row for {case.fails!r} (MACRO_B of _remedies.py is one to begin with; docs/dialects.md, Writing one)"
        )
        after, events = seen(name, ALL_RIGHT, stated=case.stated)
    assert set(verdicts(after, "PASS")) == IN_THE_AIR, (differs(name), "mended by", case.mended, commission.judge(after))
    assert not set(NEAR) & set(events)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", [name for name in sorted(EVERY) if "records" in cases(name)])
def test_records_without_their_decimal_points_fail_by_themselves(name: str) -> None:
    """Their sum has lost its point with them, so that each line is believed; no other experiment may judge what nobody can read."""
    what, events = seen(name, Case("records", printed=pointless))
    assert not set(NEAR) & set(events)
    assert verdicts(what, "FAIL") == ["records"], commission.judge(what)
    found = next(j.verdict.found for j in commission.judge(what) if j.experiment.belief == "records")
    assert "the decimal point is lost" in found or "not a record" in found
    if "lost" in found:
        assert {"frames", "mirror", "rotary", "widths", "miss"} <= set(verdicts(what, "OPEN"))


UNKNOWN = (  # dialect, word, what settles it, what is named
    ("fanuc", "G69", "frames", "reset"),
    ("fanuc", "#4008", "frames", "length_check"),
    ("siemens", "CYCLE800", "frames", "cycle800"),
    ("siemens", "TRAFOOF", "frames", "trafoof"),
    ("siemens", "$P_ACTFRAME", "frames", "frame_check"),
    ("siemens", "$MN_SCALING_SYSTEM_IS_METRIC", "frames", "metric_check"),
    ("siemens", "$VA_IM", "rotary", "rotary_position"),
    ("siemens", "SPRINT", "records", "SPRINT with"),
    ("heidenhain", "PLANE RESET", "frames", "plane_reset"),
    ("heidenhain", "FUNCTION RESET TCPM", "frames", "tcpm_reset"),
    ("heidenhain", "ID240 NR8", "frames", "ID240 NR8"),
    ("heidenhain", "DIST", "alive", "distance = "),
    ("okuma", "VSAP", "frames", "contact"),
    ("okuma", "VACOD", "frames", "frame_check"),
    ("okuma", "G170", "frames", "reset"),
    ("fagor", "#TLC", "frames", "off"),
    ("fagor", "V.A.ATIPMEAS", "frames", "contact"),
    ("fagor", "V.G.PRBST1", "deflected", "probe_state"),
    ("centroid", "G69", "frames", "reset"),
    ("mach3", "G69", "frames", "reset"),
    ("mach4", "G69", "frames", "reset"),
)


@pytest.mark.few(3)
@pytest.mark.parametrize(("name", "word", "belief", "named"), UNKNOWN)
def test_a_word_that_the_control_does_not_know_names_the_key_it_comes_from(name: str, word: str, belief: str, named: str) -> None:
    """The likeliest thing to happen at a first start; the screen shows the word, or its block."""
    what, events = seen(name, Case(belief, {"lacks": word}))
    assert not set(NEAR) & set(events) and what.said
    assert verdicts(what, "FAIL") == [belief], (what.said, commission.judge(what))
    verdict = next(j.verdict for j in commission.judge(what) if j.experiment.belief == belief)
    assert named in verdict.do and "does not know" in verdict.found


def failing(name: str) -> list[str]:
    """dialect → its beliefs whose case fails, each carried out now, with the first line of what it says."""
    found = []
    for belief in cases(name):
        try:
            test_where_one_belief_is_wrong_this_one_fails_and_what_the_text_says_mends_it(name, belief)
        except Exception as error:  # whatever it is: the table would say that it passes
            found.append(f"{belief}: {str(error).partition(chr(10))[0]}")
    return found


def table_in(page: str) -> str:
    """docs/commissioning.md → its table dialect × belief."""
    return page[page.index("| dialect | ") :].partition("\n\n")[0]


def with_table(page: str, made: str, fails: Callable[[str], list[str]]) -> tuple[str, dict[str, list[str]]]:
    """page, table, which cases of a dialect fail → the page with it, {dialect: beliefs that fail}: their rows are not written.

    Only dialects whose rows are new or others than before are asked. The number of cases is written when all rows are.
    """
    old = table_in(page)
    new = [row.split(" | ")[0].strip("| ") for row in made.splitlines()[2:] if row not in old.splitlines()]
    wrong = {name: beliefs for name in new if (beliefs := fails(name))}
    rows = {row.split(" | ")[0].strip("| "): row for row in old.splitlines()[2:]}
    kept = [
        rows.get(row.split(" | ")[0].strip("| ")) if row.split(" | ")[0].strip("| ") in wrong else row for row in made.splitlines()
    ]
    text = page.replace(old, "\n".join(row for row in kept if row is not None))
    return text if wrong else re.sub(r"\b\d+ cases\)", f"{len(CASES)} cases)", text), wrong


def test_the_table_of_the_docs_is_what_these_cases_are() -> None:
    """A row for each dialect, and how many cases there are; the command that the failure prints writes both, of cases that pass."""
    page, made = Path(__file__).parent.parent / "docs" / "commissioning.md", table(sorted(EVERY))
    write, before = command("tests/test_commission.py -k table"), page.read_text(encoding="utf-8")
    if writing():
        text, wrong = with_table(before, made, failing)
        page.write_text(text, encoding="utf-8")
        assert not wrong, (
            f"docs/commissioning.md, How sure this is: a row says that its cases pass, and these fail: {wrong}. "
            f"pytest tests/test_commission.py -m 'not campaign' -k '[NAME' says more. {' '.join(map(differs, wrong))}"
        )
        before = text
    lacking = sorted(set(made.splitlines()) - set(before.splitlines()))
    assert table_in(before) == made and f"{len(CASES)} cases)" in before, (
        f"docs/commissioning.md, How sure this is: the table or the number of cases ({len(CASES)}) is of other dialects. {write} "
        "carries out the cases of each dialect whose row is missing, some minutes, and writes both where they pass. Rows that are "
        "missing:\n" + "\n".join(lacking)
    )


def test_a_row_is_written_where_its_cases_pass() -> None:
    """The table said of a dialect that everything passed, and none of its programs had run to its end."""
    page = "(1 cases)\n\n| dialect | a |\n|---|---|\n| old | x |\n| same | y |\n\nEnd (2 touches)\n"
    made = "| dialect | a |\n|---|---|\n| new | x |\n| old | z |\n| same | y |"
    assert with_table(page, made, lambda name: ["a"]) == (page, {"new": ["a"], "old": ["a"]})
    text, wrong = with_table(page, made, lambda name: ["a"] if name == "new" else [])
    assert "| old | z |" in text and "new" not in text and "(1 cases)" in text and wrong == {"new": ["a"]}
    text, wrong = with_table(page, made, lambda name: [])
    assert table_in(text) == made and f"({len(CASES)} cases)" in text and not wrong and text.endswith("End (2 touches)\n")


def keys_with(machine: Machine | None = None, port: str = "", **stated: Any) -> dict[str, str]:
    """what the profile states → keys of a Fanuc."""
    return commission.keys(machine or golden().machine, "fanuc", "", settings_of(load("fanuc"), stated), port)


def test_what_was_proven_is_kept_as_long_as_what_it_depends_on(tmp_path: Any) -> None:
    now = keys_with()
    add_proofs(
        tmp_path,
        "fanuc",
        [Proof("alive", "FAIL", "no", profile=now["alive"]), Proof("miss", "PASS", "yes", 3.0, "touches", profile=now["miss"])],
    )
    add_proofs(
        tmp_path,
        "fanuc",
        [Proof("alive", "PASS", "stopped", profile=now["alive"]), Proof("frames", "OPEN", "", profile=now["frames"])],
    )
    proofs = read_commissioning(tmp_path)
    assert [proof.verdict for proof in proofs] == ["FAIL", "PASS", "PASS", "OPEN"]
    assert {b: p.verdict for b, p in latest(proofs, now).items()} == {"alive": "PASS", "miss": "PASS"}
    assert set(latest(proofs, keys_with(skip="G31 P1"))) == set()
    assert set(latest(proofs, keys_with(probe_on="M80"))) == {"miss"}
    (tmp_path / "commissioning.yaml").write_text("format: something\n")
    with pytest.raises(InputError, match="allowed: tango-commissioning/1"):
        read_commissioning(tmp_path)


def changed(other: Mapping[str, str]) -> set[str]:
    return {belief for belief, key in keys_with().items() if other[belief] != key}


def test_each_belief_has_its_own_dependence() -> None:
    every = set(keys_with())
    harmless = {
        "memory": 2048,
        "positioning_feed": 500.0,
        "misses": 5,
        "gate": "facet",
        "program_number": 7800,
        "confirmed": ["G53 G0 turns a rotary axis"],
    }
    assert not changed(keys_with(**harmless))
    assert not changed(keys_with(skip="G31", wait="G53"))  # the defaults, stated
    assert changed(keys_with(unclamp={"B": "M11"}, clamp={"B": "M10"})) == {"rotary"}
    assert changed(keys_with(probe_state=1004)) == {"deflected"}
    assert changed(keys_with(port="serial:///dev/ttyS1")) == {"append", "records", "end", "pace"}
    assert changed(keys_with(macros="called")) == every  # no experiment says what it is for
    machine = golden().machine
    assert changed(keys_with(turned_round(machine, "B"))) == {"pivots", "rollover", "rotary", "sense"}
    assert changed(keys_with(turned_round(machine, "X"))) == {"directions"}
    assert changed(commission.keys(machine, "fanuc", "another text", settings_of(load("fanuc"), {}), "")) == every


def test_a_proof_takes_what_it_settles_off_the_list_and_the_rest_is_ordered_by_danger() -> None:
    from postprocessors import unverified

    doubts = unverified(load("fanuc"), {})
    turns, skip = (next(d for d in doubts if word in d) for word in ("turns a rotary axis", "skip = "))
    left = commission.remaining(doubts, {"rotary": "PASS", "frames": "PASS", "alive": "FAIL"})
    listed = [text for _, texts in left for text in texts]
    assert turns not in listed and skip in listed
    dangers = [experiment.danger for experiment, _ in left if experiment]
    assert dangers == sorted(dangers) and dangers[0] == 1
    half = commission.remaining(doubts, {"frames": "PASS"})  # that one needs both
    assert turns in [text for _, texts in half for text in texts]
    every = {e.belief: "PASS" for e in commission.experiments()}
    assert [experiment for experiment, _ in commission.remaining(doubts, every)] == [None]


def test_every_doubt_of_every_dialect_has_an_experiment_or_is_a_matter_of_each_run() -> None:
    """What somebody may have left on before a run, and which variables are free, no experiment proves for ever."""
    every = {e.belief: "PASS" for e in commission.experiments()}
    patterns = "; ".join(f"{e.belief}: {e.settles.pattern}" for e in commission.experiments())
    of_each_run = re.compile(r"^must_be_off|^common =|(is|are|has left cycle 26.*) (on|off)\b|compare one touch by hand")
    for name in EVERY:
        left = [text for _, texts in commission.remaining(unverified(load(name), {}), every) for text in texts]
        unproven = [text for text in left if not of_each_run.search(text)]
        assert not unproven, (
            f"postprocessors/{name}.py: no experiment proves the doubts {unproven}. Word each so that a pattern fits, or write an "
            f"experiment. Files of tango_cnc/commission/experiments/ and their `settles`: {patterns}"
        )


@pytest.fixture
def control(tmp_path: Path) -> Iterator[tuple[Path, str]]:
    """→ a cell with the example's Fanuc, and the port of its simulated control."""
    write_example(tmp_path / "cell", "hu40t")
    command = [sys.executable, "-m", "sim_controller", "--cell", str(tmp_path / "cell"), "--tcp", "127.0.0.1:0", "--speed", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield tmp_path / "cell", process.stdout.readline().strip()
        finally:
            process.kill()


def call(*arguments: object) -> int:
    return guarded(tango.main, [str(a) for a in arguments], prog_name="tango", standalone_mode=False)


@pytest.mark.long
def test_from_the_command_line_only_what_is_new_is_tried(
    control: tuple[Path, str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pace = sys.modules["tango_cnc.commission.experiments.pace"]  # the package has its experiment under this name
    monkeypatch.setattr(pace, "FASTER", -1.0)  # this control moves in no time
    cell, port = control
    tries = ("commission", "-C", cell, "--port", port, "--answers", "yes", "--json", "-")
    plans = ("plan", "-C", cell, "--json", "-")
    call(*plans)
    before = json.loads(capsys.readouterr().out)
    assert before["proven"] == {}
    assert call(*tries) == 0
    found = json.loads(capsys.readouterr().out)
    verdicts = {item["belief"]: item["verdict"] for item in found["beliefs"]}
    assert {b for b, v in verdicts.items() if v != "PASS"} == {
        "deflected",
        "feed",
    }  # nobody was there to hold it, or to turn a dial
    call(*plans)
    after = json.loads(capsys.readouterr().out)
    gone = set(before["unverified"]) - set(after["unverified"])
    assert after["program_hash"] == before["program_hash"] and len(gone) > 12
    assert any(text.startswith("unclamp =") for text in gone) and any(
        text.startswith("the program does not look at the input of the probe") for text in after["unverified"]
    )
    assert call(*tries) == 0 and "only deflected and feed are not proven" in capsys.readouterr().out  # nothing is run
    settings = cell / "tango.yaml"
    settings.write_text(settings.read_text() + "  memory: 2048\n")
    assert call(*tries) == 0 and "only deflected and feed are not proven" in capsys.readouterr().out
    settings.write_text(settings.read_text() + "  unclamp: {B: M11}\n")
    call(*plans)
    assert any(text.startswith("clamp =") for text in json.loads(capsys.readouterr().out)["unverified"])
    assert call(*tries) == 0
    again = json.loads(capsys.readouterr().out)
    assert [item["belief"] for item in again["beliefs"]] == ["deflected", "rotary", "feed"]


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["hu40t", "huron", "trunnion", "fork_head", "split"])
def test_every_rotary_axis_that_the_strategy_turns_is_turned_and_asked_about(name: str) -> None:
    """The swivel head of split stands still at the first six indexations, and at many of an order by chance."""
    cell = example(name)
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(cell.strategy.indexations))[:30] if seed else range(30)
        few = tuple(cell.strategy.indexations[i] for i in order if i < len(cell.strategy.indexations))
        made = plan(replace(cell, strategy=replace(cell.strategy, indexations=few)), "leave-out")
        places = np.array([touch.over for touch in made.touches])
        turned = {axis for axis in made.machine.rotary if np.ptp(places[:, made.machine.column(axis)]) >= math.radians(5)}
        assert turned and set(flight.turning(flight.air(made))) == turned, seed
        assert len({touch.indexation for touch in flight.air(made).touches}) <= 6


def test_what_to_change_says_which_keys_this_post_has() -> None:
    experiment = next(one for one in commission.experiments() if one.belief == "frames")
    assert "Of the keys that are named here, " in keys_here(load("heidenhain"), experiment)
    own = {option.name for option in load("heidenhain").options}
    said = keys_here(load("heidenhain"), experiment).partition(" has ")[2].rstrip(".")
    assert said == "none" or set(said.split(", ")) <= own
