"""Nights by the thousand, each out of one seed: nothing lost, nothing invented, machine safe, something said, an end.

make nights SEED=17              the year of that seed again, step for step
make nights YEARS=1000 JOBS=2    a thousand years, and their sum; TANGO_YEARS=5 for those of the campaign below
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest
from support import yearbook
from support.imports import modules
from support.years import FAULTS, Bench, Broken, Year

MANY = {name: 3 * p for name, p in FAULTS.items()} | {"power": 0.15, "mail down": 0.06, "database down": 0.04}


@pytest.fixture(scope="module")
def small() -> Bench:
    """Every fourth indexation of the example machine."""
    return yearbook.small()


@pytest.mark.long
def test_forty_nights_with_faults_of_every_kind(small: Bench) -> None:
    result = Year(small, 3, rates=MANY).run(40)
    assert len(set(result["became"])) >= 3


@pytest.mark.long
def test_a_seed_is_the_same_year_again(small: Bench) -> None:
    one, two = Year(small, 5, rates=MANY), Year(small, 5, rates=MANY)
    one.run(8)
    two.run(8)
    assert one.heard == two.heard and one.trace == two.trace


@pytest.mark.campaign
def test_years_of_nights(small: Bench) -> None:
    code = yearbook.code()
    years = [yearbook.played(small, seed, code) for seed in range(int(os.environ.get("TANGO_YEARS", "1000")))]
    print(yearbook.summary(years, code))
    assert not [year for year in years if "broken" in year]
    low, _ = yearbook.bounds(sum(year["false"] for year in years))
    assert low <= 1.2 * sum(year["measured"] for year in years) / 730, "false alarms are more frequent than stated"


@pytest.mark.long
def test_a_year_that_is_done_is_kept_and_counted_once(small: Bench, tmp_path: Path) -> None:
    kept, code = tmp_path / "years.jsonl", "0123456789abcdef"
    line = yearbook.played(small, 3, code, 10)
    assert line["nights"] == 10 and sum(line["became"].values()) == 10 and line["measured"] <= 10
    yearbook.keep(line, kept)
    yearbook.keep(line | {"false": 1}, kept)
    yearbook.keep(line | {"seed": 4, "code": "of another code"}, kept)
    yearbook.keep({"seed": 5, "code": code, "broken": "seed 5, night 0, fault '': a night without a message"}, kept)
    with kept.open("a", encoding="utf-8") as file:
        file.write('{"seed": 6, "code": "0123456789abc')  # the power went
    years = yearbook.years(code, kept)
    assert sorted(year["seed"] for year in years) == [3, 5]
    said = yearbook.summary(years, code)
    assert f"2 years (10 nights) on code {code}: 1 false alarms in {line['measured']} measured nights" in said
    assert "0 moves after a preflight that failed, 1 nights without a message" in said and "seeds 3, 5" in said


@pytest.mark.long
def test_the_hash_of_the_code_is_of_what_a_night_does() -> None:
    """Another comment is the same code, another number is not; and what a night imports belongs to it, as far as it goes."""
    one = '"""What it does."""\n\ndef found(a: int) -> int:\n    """a → a."""\n    return a + 1  # one more\n'
    assert yearbook.meaning(one) == yearbook.meaning(
        one.replace("one more", "else").replace("a → a", "else").replace("What", "That")
    )
    assert yearbook.meaning(one) != yearbook.meaning(one.replace("a + 1", "a + 2"))
    needed = {"nightly.night", "nightly.analysis", "state.filter", "history.store", "history.migrations", "texts", "model"}
    assert {f"tango_cnc.{name}" for name in needed} <= set(yearbook.reached())


@pytest.mark.long
def test_what_is_left_out_of_that_hash_does_nothing_in_a_night(small: Bench) -> None:
    ran = set[str]()

    def called(frame: FrameType, what: str, _: object) -> None:
        if what == "call" and frame.f_code.co_name not in ("<module>", "<genexpr>", "<listcomp>", "<dictcomp>", "<lambda>"):
            ran.add(frame.f_code.co_filename)

    Year(small, 3, rates=MANY).run(1)  # what is imported late runs what makes its tables
    sys.setprofile(called)
    try:
        Year(small, 3, rates=MANY | {"knock": 0.1}).run(30)
    finally:
        sys.setprofile(None)
    known = {str(file): name for name, file in modules(yearbook.ROOT).items() if not name.startswith("tests")}
    aside = {known[file] for file in ran if file in known} - set(yearbook.reached())
    assert not aside and len(ran & set(known)) > 50


def test_years_are_counted_by_what_they_broke() -> None:
    """A sentence of the campaign that no word fits would be counted as another thing."""
    said = re.findall(r'Broken\(f?"([^"]+)"', (Path(__file__).parent / "support" / "years.py").read_text(encoding="utf-8"))
    kinds = {text: yearbook.kind_of(text) for text in said}
    assert kinds["moved after a failed preflight"] == kinds["the machine moves and the folder is not locked"] == "moves"
    assert kinds["a night without a message"] == "silent" and kinds["a night that does not end"] == "hangs"
    assert yearbook.kind_of("mail is up, and the message 2026-01-09T020259Z waits") == "silent"
    assert yearbook.kind_of("a check where a full night is due") == "other"
    assert kinds["readings are lost or invented"] == "history"
    assert yearbook.spans([9, 3, 4, 5, 7]) == "3 … 5, 7, 9"


# What a programmer could get wrong: module, what stands there, what it becomes.
BUGS = {
    "the preflight is not looked at": ("nightly.night", "failed = [p for p in points if not p.passed]", "failed = []"),
    "the lock is not taken": ("nightly.night", "with world.lock:", "if True:"),
    "nobody gets a message": (
        "nightly.night",
        "_told(record, trouble, left, world, stamp, settings.templates)\n    if kept",
        "if kept",
    ),
    "a message is thrown away though it was not delivered": (
        "nightly.night",
        "if waiting and all(d.sent for d in deliveries):",
        "if waiting:",
    ),
    "what waits is not sent again and the outbox is cleared": (
        "nightly.night",
        "for old, words in [*unsent, (stamp",
        "for old, _ in unsent:\n        world.disk.sent(old)\n    for old, words in [(stamp",
    ),
    "only link errors are caught": (
        "nightly.night",
        "except Exception as error:  # whatever it is: no",
        "except LinkError as error:  #",
    ),
    "a dead line is not caught": (
        "nightly.night",
        "except LinkError as error:\n        found |= {} if isinstance",
        "except ZeroDivisionError as error:\n        found |= {} if isinstance",
    ),
    "a history that fails ends the night": (
        "nightly.night",
        "except (TangoError, OSError) as error:\n        kept",
        "except ZeroDivisionError as error:\n        kept",
    ),
    "the readings are not kept": (
        "nightly.night",
        "world.past.add_night(record, readings, knowledge)",
        "world.past.add_night(record)",
    ),
    "the night is not kept": ("nightly.night", "world.past.add_night(record, readings, knowledge)\n        kept", "kept"),
    "a partial night is kept twice": (
        "nightly.night",
        "world.past.add_night(record, readings, knowledge)\n",
        "world.past.add_night(record, readings, knowledge)\n        world.disk.write(stamp, 'readings.csv', '')\n        world.disk.write(stamp, 'readings.csv', '')\n",
    ),
    "the disk is not asked": ("nightly.night", "enough = free >= settings.free_mb", "enough = True"),
    "two commits instead of one": (
        "history.store",
        "if readings is not None:\n                packed",
        "connection.commit()\n            if readings is not None:\n                packed",
    ),
    "a commit does not wait for the disk": ("history._database", "synchronous=FULL", "synchronous=OFF"),
    "a link to the wrong entry": ("history.store", "(last.number + 1, last.hash)", "(last.number + 1, _chain.FIRST)"),
    "rows of the readings are lost": (
        "history.store",
        "packed = zlib.compress(readings.encode(), 6)",
        "packed = zlib.compress(readings.encode()[:-80], 6)",
    ),
    "covariance packed by the upper triangle": (
        "history.store",
        "np.tril_indices(p)]\n    return zlib",
        "np.triu_indices(p)]\n    return zlib",
    ),
    "the last night that measured is any night": (
        "nightly.night",
        '{"last_measured": last.night',
        '{"last_measured": nights[0].night',
    ),
    "a night in doubt asks for nothing": ("nightly.before", 'measured.verdict == "doubtful" or self._asked', "self._asked"),
    "no check asks for a full night": (
        "nightly.before",
        "return anew(past.records_of([measured.entry])",
        "return False and anew(past.records_of([measured.entry])",
    ),
    "a full night comes too late": (
        "nightly.before",
        "age > self.settings.full_every_days - 0.5",
        "age > self.settings.full_every_days + 2",
    ),
    "a repair asks for nothing": ("nightly.before", "        if repaired:\n", "        if False:\n"),
    "what was repaired stands": (
        "nightly.standing",
        'if held.closed(alarm["id"]) or',
        'if (held.closed(alarm["id"]) and getattr(decision, "action", "") != "repaired") or',
    ),
    "what nobody has closed is forgotten": (
        "nightly.standing",
        "found.append(told)\n    return by_urgency([_with",
        "found = [told]\n    return by_urgency([_with",
    ),
    "what is ignored stands": (
        "nightly.standing",
        'or (decision is not None and decision.action == "ignore"):',
        "or False:",
    ),
    "what is ignored is not named": ("nightly.standing", "    if not wanted:\n", "    if wanted:\n"),
    "a night that never began is not put on record": ("nightly.left_behind", "for back in reversed(free):", "for back in ():"),
    "a refused night does not name what is missing": (
        "nightly.night",
        "known = with_left(known, machine",
        "with_left(known, machine",
    ),
    "what never began before a refused night is forgotten": (
        "nightly.left_behind",
        "[s for s in known if s not in marked] or list(known)",
        "list(known)",
    ),
    "a probe that scatters is believed": ("state.filter", "if p_noise < NOISY else 1.0", "if p_noise < -1.0 else 1.0"),
    "the mark stays": ("nightly.night", "            world.disk.ended(stamp)\n        except", "            pass\n        except"),
    "a message that was delivered is sent again": ("nightly.night", "            disk.sent(stamp)\n", "            pass\n"),
    "what waits is not sent": ("nightly.night", "for old, words in [*unsent, (stamp", "for old, words in [(stamp"),
    "the message has no hash": (
        "nightly.night",
        'message(record, trouble, left, _newest(record["machine"], world), t=t)',
        "message(record, trouble, left, None, t=t)",
    ),
    "an alarm of an earlier night is no reason for the verdict": (
        "nightly.analysis",
        "changed = bool(alarms or waiting)",
        "changed = bool(alarms)",
    ),
    "every alarm of a night has one id": ("nightly.night", '-{started:%H%M%S}-{number}"', '-{started:%H%M%S}"'),
    "half an interval": ("nightly.parts", '"high": mean + COVER * float(std[i])', '"high": mean + float(std[i])'),
    "the oldest state instead of the newest": (
        "history.store",
        "row = self._rows(asked.knowledge(frozenset(given)), given)",
        "row = self._rows(asked.knowledge(frozenset(given)).order_by(None).order_by(t.night.c.start_utc), given)",
    ),
    "the step of the update has the wrong sign": (
        "state.filter",
        "mean=state.mean + state.root @ change",
        "mean=state.mean - state.root @ change",
    ),
    "the update forgets the root of the state": (
        "state.filter",
        "mean=state.mean + state.root @ change",
        "mean=state.mean + change",
    ),
    "the covariance never grows and shrinks twice": (
        "state.filter",
        "stacked = np.vstack([np.column_stack([np.eye(p), np.zeros(p)])",
        "stacked = np.vstack([np.column_stack([30 * np.eye(p), np.zeros(p)])",
    ),
}


def test_every_bug_has_its_place_in_the_code() -> None:
    """Code that is written anew takes a bug out of the campaign, and nobody sees it before the next one."""
    for name, (where, old, _) in BUGS.items():
        source = Path(str(importlib.import_module(f"tango_cnc.{where}").__file__)).read_text(encoding="utf-8")
        assert source.count(old) == 1, f"{name}: {source.count(old)} places"


@contextmanager
def planted(name: str) -> Iterator[None]:
    """One bug in the product, for as long as the block lasts."""
    where, old, new = BUGS[name]
    module = importlib.import_module(f"tango_cnc.{where}")
    source = Path(str(module.__file__)).read_text(encoding="utf-8")
    assert source.count(old) == 1, f"{name}: {source.count(old)} places"
    kept = dict(vars(module))
    spoilt: dict[str, object] = {k: kept[k] for k in ("__name__", "__package__", "__spec__", "__file__")}
    exec(compile(source.replace(old, new), str(module.__file__), "exec"), spoilt)
    for key, value in kept.items():
        if key.startswith("__") or key not in spoilt:
            continue
        if callable(value) and hasattr(value, "__code__"):
            value.__code__, spoilt[key] = spoilt[key].__code__, value.__code__  # type: ignore[attr-defined]
        elif isinstance(value, type) and value.__module__ == module.__name__:
            for method, own in vars(value).items():
                if hasattr(own, "__code__"):
                    other = vars(spoilt[key])[method]
                    own.__code__, other.__code__ = other.__code__, own.__code__
    try:
        yield
    finally:
        for key, value in kept.items():
            if key.startswith("__") or key not in spoilt:
                continue
            if callable(value) and hasattr(value, "__code__"):
                value.__code__ = spoilt[key]  # type: ignore[assignment]
            elif isinstance(value, type) and value.__module__ == module.__name__:
                for method, own in vars(value).items():
                    if hasattr(own, "__code__"):
                        own.__code__ = vars(spoilt[key])[method].__code__


# Years that are short and of one kind of fault each find in a minute what a year of all kinds finds in ten.
WEATHER = (
    *((rates, 10) for rates in ({}, *({name: 0.6} for name in FAULTS))),
    ({"within": 0.2}, 20),
    ({"knocks": 0.2, "knock": 0.3}, 40),
    ({"scatter": 0.2}, 20),
    ({"asleep": 0.3, "operator": 0.7}, 60),
    ({"asleep": 0.4, "database down": 0.5}, 20),
    (MANY, 120),
)


@pytest.mark.campaign
@pytest.mark.parametrize("name", BUGS)
def test_a_planted_bug_is_found(small: Bench, name: str) -> None:
    with planted(name), pytest.raises((Exception, Broken)) as found:  # what no night may do, or an error that nobody catches
        for seed, (rates, nights) in enumerate(WEATHER):
            Year(small, seed, rates=rates).run(nights)
    print(f"{name}: {found.type.__name__}: {str(found.value).splitlines()[0][:150]}")


@pytest.mark.campaign
def test_nothing_is_found_where_no_bug_is_planted(small: Bench) -> None:
    for seed, (rates, nights) in enumerate(WEATHER):
        Year(small, seed, rates=rates).run(nights)
