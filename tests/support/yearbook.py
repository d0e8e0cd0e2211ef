"""Years of nights that are kept: what became of each, on which code, and the sum of all on one code.

A year is a line of JSON in `build/years.jsonl`. A year that is there on this code is not played again, so years are added to a sum
in as many sessions as they take. The code is what a night is made of: every module that one reaches by its imports, without
comments and docstrings, and the cell and the world that the years are played in. How a sentence is worded changes no night.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import threading
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from scipy import special

from support.imports import modules, statements, tree
from support.years import Bench, Broken, Year, bench
from tango_cnc.files import read_cell, read_world

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "build" / "years.jsonl"
CELL = ROOT / "examples" / "hu40t"
STATED = 730  # nights between two false alarms
HANGS = 60.0  # s of the processor without a new night, which takes less than one
STANDS = 3600.0  # s of the clock without one: it waits for something; a campaign in the background may wait for a processor, too
BEGINS = ("tango_cnc.nightly.night", "tango_cnc.commands._cell_nights", "tango_cnc.history", "sim_controller.simulate")
# Years ask for no diagnosis and no plausibility, and have no control to commission: these are imported and not run.
ASIDE = tuple(f"tango_cnc.{name}" for name in ("commission", "diagnose", "gate", "noise", "plausible"))
HARNESS = ("tests/support/years.py", "tests/support/night_contract.py", "tests/support/nights_parts.py")
# What is broken, by a word of the sentence that says so; what none of them fits is `other`.
BREAKS = {
    "moves": ("moves", "moved", "and it was measured"),
    "silent": ("without a message", "is taken out and was not delivered", "and the message", "a message comes twice"),
    "hangs": ("does not end", "hangs"),
    "history": ("history", "entry", "entries", "readings", "kept", "chain", "overwritten", "state of the night", "on record"),
}


def small() -> Bench:
    """Every fourth indexation of the example machine."""
    cell = read_cell(CELL)
    strategy = replace(cell.strategy, indexations=cell.strategy.indexations[::4])
    return bench(replace(cell, strategy=strategy), read_world(CELL / "world.yaml"))


def reached(begins: Iterable[str] = BEGINS) -> dict[str, Path]:
    """modules where a night begins → every module that these import, wherever in them, with its file."""
    known, found = modules(ROOT), dict[str, Path]()
    left = [*begins, *(name for name in known if name.startswith("tango_cnc.history.migrations"))]
    while left:
        name = left.pop()
        aside = any(f"{name}.".startswith(f"{one}.") for one in ASIDE)
        if name in found or name not in known or aside:
            continue
        found[name] = known[name]
        package = name if known[name].name == "__init__.py" else name.rpartition(".")[0]
        left += [name.rpartition(".")[0]]
        for node in statements(tree(known[name])):
            if isinstance(node, ast.Import):
                left += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                above = package.rsplit(".", node.level - 1)[0] if node.level else ""
                module = ".".join(part for part in (above, node.module) if part)
                left += [module, *(f"{module}.{alias.name}" for alias in node.names)]
    return found


def meaning(source: str) -> str:
    """text of a module → what of it does something: no comments, no docstrings, no lines."""
    whole = ast.parse(source)
    for node in ast.walk(whole):
        body = getattr(node, "body", None)
        documented = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        if (
            documented
            and isinstance(body, list)
            and body
            and isinstance(body[0], ast.Expr)
            and isinstance(body[0].value, ast.Constant)
        ):
            body[0] = ast.Pass()
    return ast.unparse(whole)


def code() -> str:
    """→ hash of what the years are played on: that of another day is the same where nothing of it has changed."""
    whole = hashlib.sha256()
    for name, file in sorted(reached().items()):
        whole.update(f"{name}\n{meaning(file.read_text(encoding='utf-8'))}\n".encode())
    for own in HARNESS:
        whole.update(meaning((ROOT / own).read_text(encoding="utf-8")).encode())
    for file in sorted(CELL.glob("*.yaml")):
        whole.update(file.name.encode() + file.read_bytes())
    return whole.hexdigest()[:16]


def kind_of(broken: str) -> str:
    """what a year has broken → moves, silent, hangs, history or other."""
    return next((kind for kind, words in BREAKS.items() if any(word in broken for word in words)), "other")


def played(on: Bench, seed: int, code: str, nights: int = 365) -> dict[str, Any]:
    """bench, seed, hash of the code, nights → the line of that year; of one that is broken, by what."""
    year, begun = Year(on, seed), time.process_time()
    told: dict[str, Any] = {"seed": seed, "code": code}
    over = threading.Event()

    def watched() -> None:
        last, since, used = -1, time.monotonic(), time.process_time()
        while not over.wait(1.0):
            if year.number != last:
                last, since, used = year.number, time.monotonic(), time.process_time()
            # Nothing within Python can end it: the year is kept as one that hangs.
            if time.process_time() - used > HANGS or time.monotonic() - since > STANDS:
                keep(told | {"broken": f"night {year.number} hangs"})
                os._exit(9)

    watch = threading.Thread(target=watched, daemon=True)
    watch.start()
    try:
        result = year.run(nights)
    except (Broken, Exception) as error:
        first = str(error).splitlines()[0] if str(error) else ""
        return told | {
            "broken": first if isinstance(error, Broken) else f"{type(error).__name__}: {first}",
            "nights": year.number + 1,
        }
    finally:
        over.set()
        watch.join()
    counts = {key: result[key] for key in ("false", "true", "knocks", "measured")}
    seconds = {"cpu_s": round(time.process_time() - begun, 1)}
    return told | counts | {"nights": len(result["became"]), "became": Counter(result["became"])} | seconds


def keep(line: Mapping[str, Any], kept: Path = KEPT) -> None:
    """line of a year → on disk; one write, so that those of several processes do not mix."""
    kept.parent.mkdir(exist_ok=True)
    with kept.open("ab", buffering=0) as file:
        file.write((json.dumps(line, sort_keys=True) + "\n").encode())


def years(code: str, kept: Path = KEPT) -> list[dict[str, Any]]:
    """hash of the code → lines of its years, one for each seed. It leaves out a line that was cut off."""
    found: dict[int, dict[str, Any]] = {}
    for text in kept.read_text(encoding="utf-8").splitlines() if kept.exists() else ():
        try:
            line = json.loads(text)
        except ValueError:
            continue
        if line.get("code") == code:
            found[line["seed"]] = line  # one that has broken something is played again when it is asked for
    return list(found.values())


def bounds(count: int) -> tuple[float, float]:
    """events that were counted → 95 % interval of how many are expected (Garwood 1936)."""
    low = float(special.gammaincinv(count, 0.025)) if count else 0.0
    return low, float(special.gammaincinv(count + 1, 0.975))


def summary(lines: Sequence[Mapping[str, Any]], code: str) -> str:
    """lines of years, hash of their code → the sum as a sentence."""
    whole = [line for line in lines if "broken" not in line]
    false, measured, true, knocks, nights = (
        sum(line[key] for line in whole) for key in ("false", "measured", "true", "knocks", "nights")
    )
    low, high = bounds(false)
    often = f"one in {measured / false:.0f}" if false else "none"
    interval = f"(95 %: {measured / high:.0f} … {measured / low if low else float('inf'):.0f}; stated: one in {STATED})"
    breaks = Counter(kind_of(line["broken"]) for line in lines if "broken" in line)
    asked = {"moves": "moves after a preflight that failed", "silent": "nights without a message"}
    asked |= {"history": "histories that are inconsistent", "hangs": "hangs", "other": "other invariants broken"}
    seconds = sum(line.get("cpu_s", 0.0) for line in whole)
    return (
        f"{len(lines)} years ({nights} nights) on code {code}: "
        f"{false} false alarms in {measured} measured nights, {often} {interval}; "
        f"{true} true alarms of {knocks} knocks; {', '.join(f'{breaks[key]} {text}' for key, text in asked.items())}; "
        f"seeds {spans([line['seed'] for line in lines])}; {seconds / max(len(whole), 1):.1f} s of a processor a year"
    )


def spans(numbers: Iterable[int]) -> str:
    """numbers → 3 … 7, 9."""
    found: list[list[int]] = []
    for number in sorted(numbers):
        if found and number == found[-1][1] + 1:
            found[-1][1] = number
        else:
            found.append([number, number])
    return ", ".join(f"{a}" if a == b else f"{a} … {b}" for a, b in found) or "none"
