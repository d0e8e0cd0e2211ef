"""Would the tests notice? A fresh random sample of small mistakes, put into the code one after the other.

    python benchmarks/mutants.py [--count 40] [--seed 7] [--area check]

Each mistake changes one operator, comparison, number or condition of a module in which a machine can be hit or a reading lost.
The default tests run once with coverage, which says which tests reach which line. Then every mistake meets the tests that reach
its line, no others. One that no test notices is printed with its place: a test is missing there, or it changes nothing.
The source is changed in a copy of the repository, never in the repository itself.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import coverage

ROOT = Path(__file__).resolve().parents[1]
AREAS = {
    "link": ("tango_cnc/link", ("test_link_*.py", "test_segments.py")),
    "plan": ("tango_cnc/plan", ("test_plan*.py", "test_check*.py", "test_left_out.py", "test_double_touch.py")),
    "check": ("tango_cnc/check", ("test_check*.py", "test_plan*.py", "test_left_out.py")),
    "readback": ("tango_cnc/readback", ("test_readback*.py", "test_gate.py", "test_cycle_444.py")),
    "posts": ("postprocessors", ("test_post_*.py", "test_dialects*.py", "test_own_post.py", "test_readback*.py", "test_gate.py")),
}
LONGEST = 120.0  # s for the tests of one mistake: what takes longer hangs, which somebody notices
MOST = 60  # tests that reach a line are asked, the others are like them
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
    return {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1", "OPENBLAS_NUM_THREADS": "1"}


def reached(copy: Path, files: list[str]) -> coverage.CoverageData:
    """copy of the repository, test files → which tests reach which line."""
    settings = copy / "reached.cfg"
    settings.write_text("[run]\ndynamic_context = test_function\nsource = tango_cnc,postprocessors\ndata_file = reached.db\n")
    command = [sys.executable, "-m", "coverage", "run", "--rcfile", str(settings), "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run([*command, *files], cwd=copy, env=_within(copy), capture_output=True, text=True, check=False)
    print(done.stdout.strip().splitlines()[-1] if done.stdout.strip() else done.stderr[-300:], flush=True)
    data = coverage.CoverageData(str(copy / "reached.db"))
    data.read()
    return data


def _tests(copy: Path, contexts: list[str]) -> list[str]:
    """names as coverage writes them (module.function) → what pytest takes, at most MOST."""
    found = set()
    for context in filter(None, contexts):
        module, _, function = context.rpartition(".")
        file = copy / "tests" / f"{module.split('.')[-1]}.py"
        if function.startswith("test_") and file.exists():
            found.add(f"tests/{file.name}::{function}")
    return sorted(found)[:MOST]


def noticed(copy: Path, mutant: Mutant, tests: list[str]) -> bool:
    """copy, mistake, tests that reach it → whether one of them fails."""
    file = copy / mutant.file
    source = file.read_bytes()
    file.write_bytes(source[: mutant.start] + mutant.new.encode() + source[mutant.stop :])
    try:
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests]
        return (
            subprocess.run(command, cwd=copy, env=_within(copy), capture_output=True, timeout=LONGEST, check=False).returncode != 0
        )
    except subprocess.TimeoutExpired:
        return True
    finally:
        file.write_bytes(source)


def main() -> int:
    """→ exit status: 1 where less than nine of ten mistakes on lines that tests reach are noticed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=40, help="how many mistakes are made")
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**6), help="draws the same ones again")
    parser.add_argument("--area", choices=AREAS, action="append", help="only there; may be given again")
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
        patterns = {pattern for area in areas for pattern in AREAS[area][1]}
        files = sorted({str(file.relative_to(copy)) for pattern in patterns for file in (copy / "tests").glob(pattern)})
        data = reached(copy, files)
        score = {area: [0, 0, 0] for area in areas}  # noticed, not noticed, reached by no test
        for mutant in drawn:
            contexts = data.contexts_by_lineno(str(copy / mutant.file)).get(mutant.line, [])
            tests = _tests(copy, contexts)
            which = 2 if not tests else 0 if noticed(copy, mutant, tests) else 1
            score[mutant.area][which] += 1
            if which:
                said = "no test of these reaches it" if which == 2 else f"{len(tests)} tests do not notice"
                print(f"{mutant.file}:{mutant.line}: {mutant.old}  →  {mutant.new}   ({said})", flush=True)
    for area, (good, bad, unreached) in score.items():
        print(f"{area:9} {good:3} of {good + bad} noticed, {unreached} reached by no test")
    good, bad, unreached = (sum(column) for column in zip(*score.values(), strict=True))
    print(f"{'all':9} {good:3} of {good + bad} noticed, {unreached} reached by no test; seed {wanted.seed}")
    return 0 if good >= 0.9 * (good + bad) else 1


if __name__ == "__main__":
    sys.exit(main())
