"""Spoilt tables: a thousand files with one slip each. None gets through the check; how many a control would swallow is counted."""

from __future__ import annotations

import json
import random
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from support.compensated import example, proposed
from support.few import every

from sim_controller.compensation import read
from tango_cnc.compensate import loop, targets
from tango_cnc.records import InputError, TangoError

NUMBER = re.compile(r"[-+]?\d+\.\d+")


def _numbers(line: str) -> list[re.Match[str]]:
    return [m for m in NUMBER.finditer(line) if float(m[0])]


def _swap(line: str, r: random.Random, change: Callable[[str], str]) -> str | None:
    found = _numbers(line)
    if not found:
        return None
    m = r.choice(found)
    new = line[: m.start()] + change(m[0]) + line[m.end() :]
    return new if new != line else None


def sign(line: str, r: random.Random) -> str | None:
    return _swap(line, r, lambda t: t[1:] if t[0] == "-" else f"-{t.lstrip('+')}")


def unit(line: str, r: random.Random) -> str | None:
    return _swap(line, r, lambda t: f"{float(t) * r.choice((1e3, 1e-3, 25.4, 57.29578)):.6f}")


def decimal_comma(line: str, r: random.Random) -> str | None:
    return _swap(line, r, lambda t: t.replace(".", ","))


def digit(line: str, r: random.Random) -> str | None:
    return _swap(line, r, lambda t: t[:-1] + str((int(t[-1]) + r.randint(1, 9)) % 10))


def comment(line: str, r: random.Random) -> str | None:
    return f"{line} {r.choice(('; checked', '# checked', '// checked', '(checked)'))}" if line.strip() else None


def axis(line: str, r: random.Random) -> str | None:
    found = list(re.finditer(r"(?<![A-Z])[XYZABC](?![A-Z])|AX[1-5]", line))
    if not found:
        return None
    m = r.choice(found)
    other = r.choice([a for a in (["AX1", "AX2", "AX3", "AX4"] if len(m[0]) > 1 else list("XYZABC")) if a != m[0]])
    return line[: m.start()] + other + line[m.end() :]


def index(line: str, r: random.Random) -> str | None:
    m = re.search(r"(?<=[\[,$_N])\d+(?=[\],=\s])", line)
    return f"{line[: m.start()]}{int(m[0]) + 1}{line[m.end() :]}" if m else None


LINES = (sign, unit, decimal_comma, digit, comment, axis, index)


def row_lost(lines: list[str], r: random.Random) -> list[str]:
    at = r.randrange(len(lines))
    return lines[:at] + lines[at + 1 :]


def order(lines: list[str], r: random.Random) -> list[str]:
    at = r.randrange(len(lines) - 1)
    return [*lines[:at], lines[at + 1], lines[at], *lines[at + 2 :]]


def cut(lines: list[str], r: random.Random) -> list[str]:
    return lines[: r.randrange(1, len(lines))]


def spoilt(text: str, r: random.Random) -> tuple[str, str]:
    """Text → what was done to it, the text with one slip."""
    ends = "\r\n" if "\r\n" in text else "\n"
    lines = text.split(ends)
    for _ in range(200):
        how = r.choice((*LINES, row_lost, order, cut))
        if how in LINES:
            at = r.randrange(len(lines))
            new = how(lines[at], r)  # type: ignore[arg-type]
            if new is not None:
                return how.__name__, ends.join([*lines[:at], new, *lines[at + 1 :]])
        elif len(lines) > 2 and (whole := how(lines, r)) != lines:  # type: ignore[arg-type]
            return how.__name__, ends.join(whole)  # type: ignore[arg-type]
    raise AssertionError("nothing to spoil")


def tried(count: int, folder: Path) -> tuple[int, int]:
    """Number of files → how many were refused by the check, how many a simulated control would have swallowed.

    Every file of a folder takes its turn: those for the control, the way back, the steps, the record, the remark.
    """
    cell, _ = example("trunnion")
    every = []
    for i, target in enumerate(targets.names()):
        kept = loop.store(folder, proposed("trunnion", target), "2026-01-01T00:00:00Z", simulated=i % 2 == 1)
        assert loop.check(kept.folder)["target"] == target
        every.append(kept)
    refused = swallowed = 0
    for i in range(count):
        r = random.Random(i)
        kept = every[i % len(every)]
        place = folder / "spoilt"
        shutil.copytree(kept.folder, place)
        file = r.choice(sorted(f for f in place.rglob("*") if f.is_file() and f.read_text(encoding="utf-8").strip()))
        name = file.name
        what, text = spoilt(file.read_bytes().decode(), r)
        while name == loop.RECORD and what == "order":  # of names in a JSON object: it says nothing
            what, text = spoilt(file.read_bytes().decode(), r)
        file.write_text(text, encoding="utf-8", newline="")
        try:
            loop.check(place)
        except TangoError as error:
            refused += 1
            assert name in str(error) and "found" in str(error), (what, name, error)
        try:
            read(place, cell.machine)
            swallowed += 1
        except InputError:
            pass
        shutil.rmtree(place)
    return refused, swallowed


@pytest.mark.long
def test_a_spoilt_table_is_refused(tmp_path: Path) -> None:
    assert tried(24, tmp_path)[0] == 24


@pytest.mark.long
def test_a_thousand_spoilt_tables_are_refused(tmp_path: Path) -> None:
    refused, swallowed = tried(1000, tmp_path)
    print(f"{refused} of 1000 refused by the check; {swallowed} of them a simulated control would have taken in silence")
    assert refused == 1000
    assert swallowed > 200, "the slips are to be such that nobody but the check notices"


@pytest.mark.long
def test_ends_of_lines_may_differ(tmp_path: Path) -> None:
    kept = loop.store(tmp_path, proposed("trunnion", "linuxcnc"), "2026-01-01T00:00:00Z")
    file = kept.folder / "joint_0.comp"
    file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n"))
    assert loop.check(kept.folder)


def test_a_changed_record_is_refused(tmp_path: Path) -> None:
    kept = loop.store(tmp_path, proposed("trunnion", "haas"), "2026-01-01T00:00:00Z")
    record = kept.folder / "compensation.json"
    record.write_text(record.read_text().replace("0.0", "0.1", 1))
    with pytest.raises(InputError, match="changed or cut off"):
        loop.check(kept.folder)


def test_a_record_of_another_shape_is_refused_although_its_digest_is_right(tmp_path: Path) -> None:
    kept = loop.store(tmp_path, proposed("trunnion", "haas"), "2026-01-01T00:00:00Z")
    for part, value in [("values", {"p": 0.5}), ("files", {"../a.txt": "x"}), ("promise", []), ("volume", {"X": [1.0]})]:
        record = kept.record | {part: value}
        (kept.folder / "compensation.json").write_text(json.dumps(record | {"digest": loop.digest(record)}))
        with pytest.raises(InputError, match="changed or cut off"):
            loop.check(kept.folder)


def test_a_step_that_was_lost_is_missed(tmp_path: Path) -> None:
    kept = loop.store(tmp_path, proposed("trunnion", "haas"), "2026-01-01T00:00:00Z", simulated=True)
    assert loop.check(kept.folder)
    steps = kept.folder / "steps.txt"
    steps.write_text("".join(steps.read_text().splitlines(keepends=True)[:-1]))
    with pytest.raises(TangoError, match=r"steps.txt:\d+: found 'the end of the file'|steps.txt:\d+: found ''"):
        loop.check(kept.folder)


@pytest.mark.parametrize("text", every(["", "made from readings\n", None], 3))
def test_a_remark_that_was_lost_is_missed(tmp_path: Path, text: str | None) -> None:
    """The files for a control say nowhere that no machine was measured: the remark beside them does."""
    kept = loop.store(tmp_path, proposed("trunnion", "haas"), "2026-01-01T00:00:00Z", simulated=True)
    remark = kept.folder / loop.REMARK
    remark.unlink() if text is None else remark.write_text(text)
    with pytest.raises(TangoError, match=r"SIMULATED.txt.*found"):
        loop.check(kept.folder)


def test_a_record_with_a_line_twice_is_refused(tmp_path: Path) -> None:
    """Whoever reads the record takes one of the two lines; which one, depends on the reader."""
    kept = loop.store(tmp_path, proposed("trunnion", "haas"), "2026-01-01T00:00:00Z")
    record = kept.folder / loop.RECORD
    lines = record.read_text().splitlines(keepends=True)
    record.write_text("".join([*lines[:2], *lines[1:]]))
    with pytest.raises(TangoError, match=r"compensation.json.*found"):
        loop.check(kept.folder)


def test_the_folder_of_the_way_back_is_missed(tmp_path: Path) -> None:
    kept = loop.store(tmp_path, proposed("trunnion", "haas"), "2026-01-01T00:00:00Z")
    shutil.rmtree(kept.folder / "undo")
    with pytest.raises(TangoError, match=r"undo.settings.txt: found no such file"):
        loop.check(kept.folder)


@pytest.mark.parametrize("name", ["/dev/zero", "../other.comp", "x" * 300, "."])
def test_a_control_reads_no_file_outside_of_the_folder(tmp_path: Path, name: str) -> None:
    (tmp_path / "other.comp").write_text("0 0 0\n")
    folder = tmp_path / "tables"
    folder.mkdir()
    (folder / "compensation.json").write_text('{"target": "linuxcnc"}')
    (folder / "compensation.ini").write_text(f"[JOINT_0]\nCOMP_FILE = {name}\n")
    with pytest.raises(InputError, match="no file"):
        read(folder, example("trunnion")[0].machine)


def test_a_line_that_differs_is_shown_as_far_as_anybody_reads(tmp_path: Path) -> None:
    kept = loop.store(tmp_path, proposed("trunnion", "haas"), "2026-01-01T00:00:00Z")
    (kept.folder / "settings.txt").write_text("9" * 5000)
    with pytest.raises(TangoError, match=r"settings.txt:1: found") as refused:
        loop.check(kept.folder)
    assert len(str(refused.value)) < 800
