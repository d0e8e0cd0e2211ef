"""Would the tests notice? A fresh random sample of small mistakes, put into the code one after the other.

    python benchmarks/mutants.py [--count 40] [--seed 7] [--part 1/4] [--minutes 3] [--area check] [--at FILE:LINE]

Each mistake changes one operator, comparison or condition of a module in which a machine can be hit or a reading lost.
The default tests run once with coverage, which says which tests reach which line, and with them all cases of those of which the
default run has `few`. Then every mistake meets the tests that reach its line and, when none of them notices, the others of the
test files that reach its module. One that no test notices is printed with its place: a test is missing there, or it changes
nothing. What is known to change nothing is in changes_nothing.py, with its reason, and is counted apart.
The source is changed in a copy of the repository, never in the repository itself.

What has been found is kept in build/mutants as long as no file changes: the same command goes on where it stopped (by Ctrl-C,
or after --minutes), and its last line is the score of all parts so far.
"""

from __future__ import annotations

import argparse
import ast
import compileall
import hashlib
import json
import os
import py_compile
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from xml.etree import ElementTree

import coverage
import hypothesis  # noqa: F401 - imported once here, not in every fork
import jinja2  # noqa: F401
import pytest
import scipy.linalg
import scipy.optimize
import scipy.spatial
import scipy.stats  # noqa: F401
import sqlalchemy.orm  # noqa: F401
from changes_nothing import NOTHING

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "build" / "mutants"
CODE = ("tango_cnc", "postprocessors", "sim_controller", "tests", "examples")  # what a verdict depends on
AT_ONCE = 6  # files of tests that are run with coverage before what they reach is kept
WRITTEN = ("test_readback*.py", "test_gate.py", "contracts/test_posts.py", "test_siemens_handshake.py", "test_habits.py")
AREAS = {
    "link": (
        "tango_cnc/link",
        ("contracts/test_links.py", "test_link_*.py", "test_run*.py", "test_segments.py", "test_night_preflight.py"),
    ),
    "plan": (
        "tango_cnc/plan",
        (
            "test_plan*.py",
            "test_check*.py",
            "test_bodies.py",
            "test_left_out.py",
            "test_locate.py",
            "test_double_touch.py",
            "test_second_stylus.py",
            "test_stylus_safe.py",
        ),
    ),
    "check": ("tango_cnc/check", ("test_check*.py", "test_bodies.py", "test_plan*.py", "test_left_out.py")),
    "readback": ("tango_cnc/readback", (*WRITTEN, "test_cycle_444.py")),
    "posts": (
        "postprocessors",
        (*WRITTEN, "test_post_*.py", "test_dialects*.py", "test_own_post.py", "test_confirmed.py"),
    ),
}
ASKED = "(few or not long) and not campaign"  # of what the default run has a few, all
LONGEST = 60  # s for one test: what takes longer hangs, which somebody notices
BUDGET = 120.0  # s of tests, as they took with coverage, are asked about a mistake, the quick ones first; then as many others
OPERATORS = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
COMPARED = {
    ast.Lt: "<=",
    ast.LtE: "<",
    ast.Gt: ">=",
    ast.GtE: ">",
    ast.Eq: "!=",
    ast.NotEq: "==",
    ast.In: "not in",
    ast.Is: "is not",
}


@dataclass(frozen=True)
class Mutant:
    """One mistake: in this file, at this line, instead of that text; `start` and `stop` are places in the bytes of the file."""

    area: str
    file: str
    line: int
    start: int
    stop: int
    old: str
    new: str


def mutants(area: str, file: Path) -> Iterator[Mutant]:
    """area, source file → every mistake that can be made in it."""
    source = file.read_bytes()
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def made(node: ast.expr, new: str) -> Mutant:
        start = starts[node.lineno - 1] + node.col_offset
        stop = starts[(node.end_lineno or node.lineno) - 1] + (node.end_col_offset or 0)
        return Mutant(area, str(file.relative_to(ROOT)), node.lineno, start, stop, source[start:stop].decode(), new)

    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS and not _text(node):
            yield made(node, f"({ast.unparse(node.left)}) {OPERATORS[type(node.op)]} ({ast.unparse(node.right)})")
        elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in COMPARED:
            yield made(node, f"({ast.unparse(node.left)}) {COMPARED[type(node.ops[0])]} ({ast.unparse(node.comparators[0])})")
        elif isinstance(node, ast.BoolOp):
            other = ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)
            yield made(node, f"({ast.unparse(other)})")
        elif isinstance(node, ast.If | ast.IfExp | ast.While):
            yield made(node.test, f"(not ({ast.unparse(node.test)}))")


def _text(node: ast.BinOp) -> bool:
    """operation → whether it puts texts together, where another operator is an error at once."""
    return any(
        isinstance(part, ast.JoinedStr) or (isinstance(part, ast.Constant) and isinstance(part.value, str | bytes))
        for part in ast.walk(node)
    )


def _within(copy: Path) -> dict[str, str]:
    """copy of the repository → the surroundings of a process that imports from it, whatever is installed."""
    return {**os.environ, "PYTHONPATH": str(copy), "OPENBLAS_NUM_THREADS": "1"}


@dataclass(frozen=True)
class Reached:
    """Which tests (`tests/test_x.py::test_y`) reach which line, by runs without a mistake; how many seconds each took."""

    runs: Sequence[coverage.CoverageData]
    seconds: Mapping[str, float]

    def tests(self, file: Path, line: int) -> tuple[list[str], list[str]]:
        """file, line → tests that run the line; then the others of these test files that run the file. The quick ones come first.

        What a fixture or a cache keeps is run by one test and asserted by others: only the second list has those.
        """
        by_line: dict[int, list[str]] = {}
        for run in self.runs:
            for number, contexts in run.contexts_by_lineno(str(file)).items():
                by_line.setdefault(number, []).extend(contexts)
        near = self._quick(by_line.get(line, []))
        anywhere = self._quick([context for contexts in by_line.values() for context in contexts])
        modules = {test.partition("::")[0] for test in anywhere}
        beside = [test for test in sorted(self.seconds, key=lambda test: self.seconds[test]) if test.partition("::")[0] in modules]
        far = [test for test in dict.fromkeys([*anywhere, *beside]) if test not in near]
        return self._within(near), self._within(far)

    def _quick(self, contexts: Iterable[str]) -> list[str]:
        """names as coverage writes them (module.function) → tests, the quick ones first."""
        parts = [context.split(".") for context in set(contexts) if context]
        known = {(Path(test.partition("::")[0]).stem, test.partition("::")[2]): test for test in self.seconds}  # in any folder
        tests = {known[p[-2], p[-1]] for p in parts if len(p) > 1 and (p[-2], p[-1]) in known}
        return sorted(tests, key=lambda test: (self.seconds[test], test))

    def _within(self, tests: list[str]) -> list[str]:
        """tests, the quick ones first → as many of them as fit into BUDGET, at least one."""
        total = 0.0
        for i, test in enumerate(tests):
            total += self.seconds[test]
            if i and total > BUDGET:
                return tests[:i]
        return tests


def reached(copy: Path, files: Sequence[str], until: float) -> Reached | None:
    """copy of the repository, test files, when to stop → what the tests reach; None: not finished."""
    seconds: dict[str, float] = {}
    runs = []
    for first in range(0, len(files), AT_ONCE):
        some = files[first : first + AT_ONCE]
        name = hashlib.sha256(" ".join(some).encode()).hexdigest()[:12]
        settings, times = copy / f"reached-{name}.cfg", copy / f"reached-{name}.xml"
        if not times.exists():
            if time.monotonic() > until:
                return None
            _run_once(copy, settings, times, some)
        data = coverage.CoverageData(str(settings.with_suffix(".db")))
        data.read()
        runs.append(data)
        for case in ElementTree.parse(times).iter("testcase"):
            test = f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name', '').partition('[')[0]}"
            seconds[test] = seconds.get(test, 0.0) + float(case.get("time", 0.0))
    return Reached(runs, seconds)


def _run_once(copy: Path, settings: Path, times: Path, files: Sequence[str]) -> None:
    """copy, files that are written, test files → they have run with coverage; exits where one fails without any mistake."""
    database, unfinished = settings.with_suffix(".db"), times.with_suffix(".new")
    database.unlink(missing_ok=True)
    settings.write_text(f"[run]\ndynamic_context = test_function\nsource = tango_cnc,postprocessors\ndata_file = {database.name}\n")
    command = [
        sys.executable,
        "-m",
        "coverage",
        "run",
        "--rcfile",
        str(settings),
        "-m",
        "pytest",
        "-q",
        "-m",
        ASKED,
        f"--junitxml={unfinished}",
    ]
    done = subprocess.run([*command, *files], cwd=copy, env=_within(copy), capture_output=True, text=True, check=False)
    print(done.stdout.strip().splitlines()[-1] if done.stdout.strip() else done.stderr[-300:], flush=True)
    if done.returncode not in (0, 5):  # 5: all of them are long
        sys.exit(f"A test fails without any mistake. Mend it first.\n{done.stdout[-2000:]}")
    unfinished.replace(times)


def _fails(copy: Path, tests: list[str]) -> bool:
    """copy with a mistake, tests → whether one of them fails or hangs, in a fork that has the libraries imported already."""
    child = os.fork()
    if not child:
        os.setsid()
        os.chdir(copy)
        os.environ.update(_within(copy))
        for stream in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
        sys.dont_write_bytecode = True  # a mistake of the same length within the same second would be taken for the last one
        sys.path.insert(0, str(copy))
        os._exit(int(pytest.main(["-q", "-x", "-m", ASKED, "-p", "no:cacheprovider", "--timeout", str(LONGEST), *tests]) != 0))
    until = time.monotonic() + LONGEST + 3 * BUDGET
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return status != 0
        time.sleep(0.05)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return True


def noticed(copy: Path, mutant: Mutant, *rounds: list[str]) -> bool:
    """copy, mistake, lists of tests → whether a test fails: those of the first list are asked first."""
    file = copy / mutant.file
    source = file.read_bytes()
    file.write_bytes(source[: mutant.start] + mutant.new.encode() + source[mutant.stop :])
    try:
        return any(_fails(copy, tests) for tests in rounds if tests)
    finally:
        file.write_bytes(source)


def copied(part: str) -> Path:
    """name of a part → a copy of the repository for it, by the content of all files: made, or found as it was left."""
    content = hashlib.sha256()
    for file in sorted(file for folder in CODE for file in (ROOT / folder).rglob("*") if file.is_file() and file.suffix != ".pyc"):
        content.update(f"{file.relative_to(ROOT)}\0".encode() + file.read_bytes())
    home = KEPT / content.hexdigest()[:12]
    copy = home / f"part-{part}"
    if not (copy / "complete").exists():
        for old in KEPT.glob("*"):
            if old != home:
                shutil.rmtree(old)  # of files that have changed since
        shutil.rmtree(copy, ignore_errors=True)
        away = (".git", ".venv", "__pycache__", ".*_cache", ".hypothesis", "demo", "campaign", "build", "*.egg-info")
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(*away))
        if not (home / "shared").is_symlink():
            (home / "shared").symlink_to(ROOT.parent / "shared")  # what some tests compare with
        for folder in ("tango_cnc", "postprocessors", "sim_controller", "tests/support"):
            # Compiled once, and known again by content, not by the second in which it was written.
            compileall.compile_dir(copy / folder, quiet=2, invalidation_mode=py_compile.PycInvalidationMode.CHECKED_HASH)
        (copy / "complete").touch()
    for folder in ("tango_cnc", "postprocessors"):  # a mistake that was left behind when it was stopped
        for file in (ROOT / folder).rglob("*.py"):
            if (left := copy / file.relative_to(ROOT)).read_bytes() != file.read_bytes():
                left.write_bytes(file.read_bytes())
    return copy


def drawn_of(areas: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """areas, how many mistakes, seed → as many in each area, whatever its size."""
    chance = random.Random(seed)
    drawn: list[Mutant] = []
    for i, area in enumerate(areas):
        all_of_it = [m for file in sorted((ROOT / AREAS[area][0]).rglob("*.py")) for m in mutants(area, file)]
        share = count // len(areas) + (i < count % len(areas))
        drawn += chance.sample(all_of_it, min(share, len(all_of_it)))
    return drawn


def made_at(place: str) -> list[Mutant]:
    """file:line → every mistake that can be made there."""
    name, _, line = place.rpartition(":")
    area = next((area for area, (folder, _) in AREAS.items() if name.startswith(folder + "/")), None)
    if area is None or not (ROOT / name).is_file():
        sys.exit(f"--at {place}: FILE:LINE of a file in {', '.join(folder for folder, _ in AREAS.values())}")
    return [mutant for mutant in mutants(area, ROOT / name) if str(mutant.line) == line]


def judge(mutant: Mutant, copy: Path, data: Reached) -> tuple[int, str]:
    """mistake, copy, what tests reach → 0 noticed, 1 not noticed, 2 reached by no test, 3 changes nothing; and why."""
    if reason := NOTHING.get((mutant.file, mutant.old, mutant.new)):
        return 3, f"changes nothing: {reason}"
    near, far = data.tests(copy / mutant.file, mutant.line)
    if noticed(copy, mutant, near, far):
        return 0, "noticed"
    return (1, f"{len(near)} tests run it, {len(far)} run the file") if near else (2, "no test of these reaches it")


def known(home: Path, which: str) -> dict[Mutant, int]:
    """folder of verdicts, sample → what every part has found so far."""
    found = {}
    for file in sorted(home.glob(f"part-*/{which}.jsonl")):
        for line in file.read_text(encoding="utf-8").splitlines():
            entry = json.loads(line)
            found[Mutant(**entry["mistake"])] = int(entry["verdict"])
    return found


def printed(drawn: Sequence[Mutant], found: Mapping[Mutant, int], seed: str) -> int:
    """sample, verdicts → the score by area is printed; exit status."""
    for area in [*dict.fromkeys(mutant.area for mutant in drawn), "all"]:
        verdicts = [found[mutant] for mutant in drawn if mutant in found and area in ("all", mutant.area)]
        good, bad, unreached, nothing = (verdicts.count(verdict) for verdict in range(4))
        print(f"{area:9} {good:3} of {good + bad} noticed, {unreached} reached by no test, {nothing} change nothing")
    left = sum(mutant not in found for mutant in drawn)
    print(f"{seed}; {len(drawn)} mistakes" + (f", {left} still to be judged: the same command goes on" if left else ""))
    good, bad = (list(found.values()).count(verdict) for verdict in range(2))
    return 3 if left else 0 if good >= 0.9 * (good + bad) else 1


def main() -> int:
    """→ exit status: 1 where less than nine of ten mistakes on lines that tests reach are noticed, 3 where some are left."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=40, help="how many mistakes are made")
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**6), help="draws the same ones again")
    parser.add_argument("--part", default="1/1", help="I/N: only every N-th of them, from the I-th on; parts may run side by side")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="stop after about that time; the same command goes on")
    parser.add_argument("--area", choices=AREAS, action="append", help="only there; may be given again")
    parser.add_argument(
        "--at", action="append", help="FILE:LINE: every mistake of that line instead of a sample; may be given again"
    )
    parser.add_argument("--tests", action="append", help="only these files of tests, such as 'test_check*.py'; may be given again")
    wanted = parser.parse_args()
    until = time.monotonic() + 60 * wanted.minutes
    try:
        part, parts = (int(number) for number in wanted.part.split("/"))
        assert 1 <= part <= parts
    except (ValueError, AssertionError):
        parser.error(f"--part {wanted.part}: I/N with 1 ≤ I ≤ N, such as 2/4")
    areas = wanted.area or list(AREAS)
    seed = "places " + " ".join(wanted.at) if wanted.at else f"seed {wanted.seed}"
    print(seed, flush=True)
    drawn = [m for place in wanted.at for m in made_at(place)] if wanted.at else drawn_of(areas, wanted.count, wanted.seed)
    if not drawn:
        sys.exit("No mistake can be made there.")
    patterns = wanted.tests or sorted({pattern for area in {mutant.area for mutant in drawn} for pattern in AREAS[area][1]})
    which = hashlib.sha256(repr((seed, areas, wanted.count, patterns)).encode()).hexdigest()[:12]
    copy = copied(f"{part}of{parts}")
    files = sorted({str(file.relative_to(copy)) for pattern in patterns for file in (copy / "tests").glob(pattern)})
    data = reached(copy, files, until)
    for mutant in drawn[part - 1 :: parts] if data is not None else []:
        if mutant in known(copy.parent, which) or time.monotonic() > until:
            continue
        verdict, why = judge(mutant, copy, data)
        if verdict:
            print(f"{mutant.file}:{mutant.line}: {mutant.old}  →  {mutant.new}   ({why})", flush=True)
        with (copy / f"{which}.jsonl").open("a", encoding="utf-8") as kept:
            kept.write(json.dumps({"mistake": asdict(mutant), "verdict": verdict}, ensure_ascii=False) + "\n")
    return printed(drawn, known(copy.parent, which), seed)


if __name__ == "__main__":
    sys.exit(main())
