"""Nights by the thousand, each out of one seed: nothing lost, nothing invented, machine safe, something said, an end.

make nights SEED=17          the year of that seed again, step for step
TANGO_YEARS=1000             how many the campaign plays
"""

from __future__ import annotations

import importlib
import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from scipy import special
from support.years import FAULTS, Bench, Broken, Year, bench

from tango_cnc.files import read_cell, read_world

MANY = {name: 3 * p for name, p in FAULTS.items()} | {"power": 0.15, "mail down": 0.06, "database down": 0.04}


@pytest.fixture(scope="module")
def small(root: Path) -> Bench:
    """Every fourth indexation of the example machine."""
    cell = read_cell(root / "examples" / "hu40t")
    strategy = replace(cell.strategy, indexations=cell.strategy.indexations[::4])
    return bench(replace(cell, strategy=strategy), read_world(root / "examples" / "hu40t" / "world.yaml"))


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
    seed = os.environ.get("TANGO_SEED")
    seeds = [int(seed)] if seed else range(int(os.environ.get("TANGO_YEARS", "1000")))
    became: Counter[str] = Counter()
    false = true = measured = knocks = 0
    for number in seeds:
        result = Year(small, number).run()
        became.update(result["became"])
        false, true = false + result["false"], true + result["true"]
        measured, knocks = measured + result["measured"], knocks + result["knocks"]
        low = float(special.gammaincinv(false, 0.025)) if false else 0.0
        high = float(special.gammaincinv(false + 1, 0.975))
        print(
            f"seed {number}: {dict(became)}; {false} false alarms in {measured} measured nights, "
            f"one in {measured / max(false, 1):.0f} ({measured / high:.0f} … {measured / low if low else float('inf'):.0f}), "
            f"{true} true ones of {knocks} knocks",
            flush=True,
        )
    assert low <= 1.2 * measured / 730, "false alarms are more frequent than stated"


# What a programmer could get wrong: module, what stands there, what it becomes.
BUGS = {
    "the preflight is not looked at": ("nightly.night", "failed = [p for p in points if not p.passed]", "failed = []"),
    "the lock is not taken": ("nightly.night", "with world.lock:", "if True:"),
    "nobody is told": ("nightly.night", "_told(record, trouble, left, world, stamp, settings.templates)\n    if kept", "if kept"),
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
WEATHER = ({}, *({name: 0.6} for name in FAULTS), MANY)


@pytest.mark.campaign
@pytest.mark.parametrize("name", BUGS)
def test_a_planted_bug_is_found(small: Bench, name: str) -> None:
    with planted(name), pytest.raises((Exception, Broken)) as found:  # what no night may do, or an error that nobody catches
        for seed, rates in enumerate(WEATHER):
            Year(small, seed, rates=rates).run(10 if rates is not MANY else 120)
    print(f"{name}: {found.type.__name__}: {str(found.value).splitlines()[0][:150]}")


@pytest.mark.campaign
def test_nothing_is_found_where_no_bug_is_planted(small: Bench) -> None:
    for seed, rates in enumerate(WEATHER):
        Year(small, seed, rates=rates).run(10 if rates is not MANY else 120)
