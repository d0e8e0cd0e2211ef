"""Would the tests notice? A fresh random sample of small mistakes, put into the code one after the other.

    python benchmarks/mutants.py [--count 40] [--seed 7] [--area check] [--tests 'test_check*.py']

Each mistake changes one operator, comparison or condition of a module in which a machine can be hit or a reading lost.
The default tests run once with coverage, which says which tests reach which line. Then every mistake meets the tests that reach
its line and, when none of them notices, the others of the test files that reach its module. One that no test notices is printed
with its place: a test is missing there, or it changes nothing.
The source is changed in a copy of the repository, never in the repository itself.
"""

from __future__ import annotations

import argparse
import ast
import compileall
import os
import py_compile
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
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

ROOT = Path(__file__).resolve().parents[1]
AREAS = {
    "link": ("tango_cnc/link", ("test_link_*.py", "test_segments.py")),
    "plan": ("tango_cnc/plan", ("test_plan*.py", "test_check*.py", "test_left_out.py", "test_double_touch.py")),
    "check": ("tango_cnc/check", ("test_check*.py", "test_plan*.py", "test_left_out.py")),
    "readback": ("tango_cnc/readback", ("test_readback*.py", "test_gate.py", "test_cycle_444.py")),
    "posts": ("postprocessors", ("test_post_*.py", "test_dialects*.py", "test_own_post.py", "test_readback*.py", "test_gate.py")),
}
LONGEST = 60  # s for one test: what takes longer hangs, which somebody notices
BUDGET = 30.0  # s of tests are asked about a mistake, the quick ones first; as many again when none of them notices
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
    """Which tests (`tests/test_x.py::test_y`) reach which line, by a run without a mistake; how many seconds each took."""

    data: coverage.CoverageData
    seconds: Mapping[str, float]

    def tests(self, file: Path, line: int) -> tuple[list[str], list[str]]:
        """file, line → tests that run the line; then the others of these test files that run the file. The quick ones come first.

        What a fixture or a cache keeps is run by one test and asserted by others: only the second list has those.
        """
        by_line = self.data.contexts_by_lineno(str(file))
        near = self._quick(by_line.get(line, []))
        anywhere = self._quick([context for contexts in by_line.values() for context in contexts])
        modules = {test.partition("::")[0] for test in anywhere}
        beside = [test for test in sorted(self.seconds, key=lambda test: self.seconds[test]) if test.partition("::")[0] in modules]
        far = [test for test in dict.fromkeys([*anywhere, *beside]) if test not in near]
        return self._within(near), self._within(far)

    def _quick(self, contexts: Iterable[str]) -> list[str]:
        """names as coverage writes them (module.function) → tests, the quick ones first."""
        parts = [context.split(".") for context in set(contexts) if context]
        tests = {f"tests/{p[-2]}.py::{p[-1]}" for p in parts if len(p) > 1}
        return sorted(tests & self.seconds.keys(), key=lambda test: (self.seconds[test], test))

    def _within(self, tests: list[str]) -> list[str]:
        """tests, the quick ones first → as many of them as fit into BUDGET, at least one."""
        total = 0.0
        for i, test in enumerate(tests):
            total += self.seconds[test]
            if i and total > BUDGET:
                return tests[:i]
        return tests


def reached(copy: Path, files: list[str]) -> Reached:
    """copy of the repository, test files → which tests reach which line, and how long each takes."""
    settings, times = copy / "reached.cfg", copy / "reached.xml"
    settings.write_text("[run]\ndynamic_context = test_function\nsource = tango_cnc,postprocessors\ndata_file = reached.db\n")
    command = [sys.executable, "-m", "coverage", "run", "--rcfile", str(settings), "-m", "pytest", "-q", f"--junitxml={times}"]
    done = subprocess.run([*command, *files], cwd=copy, env=_within(copy), capture_output=True, text=True, check=False)
    print(done.stdout.strip().splitlines()[-1] if done.stdout.strip() else done.stderr[-300:], flush=True)
    if done.returncode:
        sys.exit(f"A test fails without any mistake. Mend it first.\n{done.stdout[-2000:]}")
    data = coverage.CoverageData(str(copy / "reached.db"))
    data.read()
    seconds: dict[str, float] = {}
    for case in ElementTree.parse(times).iter("testcase"):
        test = f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name', '').partition('[')[0]}"
        seconds[test] = seconds.get(test, 0.0) + float(case.get("time", 0.0))
    return Reached(data, seconds)


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
        os._exit(int(pytest.main(["-q", "-x", "-p", "no:cacheprovider", "--timeout", str(LONGEST), *tests]) != 0))
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


def score_of(drawn: list[Mutant], copy: Path, data: Reached) -> dict[str, list[int]]:
    """mistakes, copy, what tests reach → by area how many are noticed, not noticed, reached by no test. Prints the last two."""
    score: dict[str, list[int]] = {mutant.area: [0, 0, 0] for mutant in drawn}
    for mutant in drawn:
        near, far = data.tests(copy / mutant.file, mutant.line)
        which = 0 if noticed(copy, mutant, near, far) else 1 if near else 2
        score[mutant.area][which] += 1
        if which:
            said = "no test of these reaches it" if which == 2 else f"{len(near)} tests run it, {len(far)} run the file"
            print(f"{mutant.file}:{mutant.line}: {mutant.old}  →  {mutant.new}   ({said})", flush=True)
    return score


def main() -> int:
    """→ exit status: 1 where less than nine of ten mistakes on lines that tests reach are noticed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=40, help="how many mistakes are made")
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**6), help="draws the same ones again")
    parser.add_argument("--area", choices=AREAS, action="append", help="only there; may be given again")
    parser.add_argument("--tests", action="append", help="only these files of tests, such as 'test_check*.py'; may be given again")
    wanted = parser.parse_args()
    areas = wanted.area or list(AREAS)
    print(f"seed {wanted.seed}", flush=True)
    chance = random.Random(wanted.seed)
    drawn: list[Mutant] = []
    for i, area in enumerate(areas):  # as many in each, whatever its size
        all_of_it = [m for file in sorted((ROOT / AREAS[area][0]).rglob("*.py")) for m in mutants(area, file)]
        share = wanted.count // len(areas) + (i < wanted.count % len(areas))
        drawn += chance.sample(all_of_it, min(share, len(all_of_it)))
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, "copy")
        kept = shutil.ignore_patterns(".git", ".venv", "__pycache__", ".*_cache", ".hypothesis", "demo", "campaign")
        shutil.copytree(ROOT, copy, ignore=kept)
        Path(folder, "shared").symlink_to(ROOT.parent / "shared")  # what some tests compare with
        patterns = set(wanted.tests or (pattern for area in areas for pattern in AREAS[area][1]))
        for folder_of_code in ("tango_cnc", "postprocessors", "sim_controller", "tests/support"):
            # Compiled once, and known again by content, not by the second in which it was written.
            compileall.compile_dir(copy / folder_of_code, quiet=2, invalidation_mode=py_compile.PycInvalidationMode.CHECKED_HASH)
        files = sorted({str(file.relative_to(copy)) for pattern in patterns for file in (copy / "tests").glob(pattern)})
        data = reached(copy, files)
        score = score_of(drawn, copy, data)
    for area, (good, bad, unreached) in score.items():
        print(f"{area:9} {good:3} of {good + bad} noticed, {unreached} reached by no test")
    good, bad, unreached = (sum(column) for column in zip(*score.values(), strict=True))
    print(f"{'all':9} {good:3} of {good + bad} noticed, {unreached} reached by no test; seed {wanted.seed}")
    return 0 if good >= 0.9 * (good + bad) else 1


if __name__ == "__main__":
    sys.exit(main())
