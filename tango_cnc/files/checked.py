"""YAML that remembers where it stands, so that every complaint names file, line, key, what was found and what is allowed."""

from __future__ import annotations

import csv
import itertools
import json
import math
import os
import re
import unicodedata
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import yaml

from ..nearest import nearest as nearest
from ..nearest import printable as printable
from ..nearest import suggestion as suggestion
from ..records import Id, InputError, Vector
from .composed import DEEPEST, Composer, Pairs, Raw, Scalar, Series

NUMERAL = re.compile(r"-?\d+")
WHOLE = re.compile(r"[-+]?(0|[1-9][0-9]*)")  # which YAML and Python read alike
LARGEST = 1 << 28  # bytes of a file that is read whole
SMALL = 1 << 16  # bytes asked for of a file that does not state its size, as in /proc; what is asked for is reserved in memory
LONGEST = 400_000  # characters of YAML: what can be read in about a second
MOST_VALUES = 1_000_000  # that a YAML file stands for
TURNING = frozenset(("LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"))  # Unicode: which way text is written
SHOWN = 200  # characters of a wrong value
DIGITS = 40  # of a whole number
FURTHEST = 100_000.0  # mm or degrees: no machine tool reaches further, and beyond it places lose their micrometres
TWICE = ("the same key twice", "each key once; remove one")
VERSIONS = {key: f"'{key}: 1', the version of its format," for key in ("tango", "nightly")}
COMMA = " Within { } a comma begins a new key: write decimals with a point, and lists in [ ]"
MISSING = {  # file name → what to do when it is not there
    "tango.yaml": "give the folder of the cell with -C, or make one with 'tango init DIR'",
    "strategy.yaml": "'tango design -C CELL -o CELL/strategy.yaml' makes one from machine.yaml and artefact.yaml",
    "acceptance.yaml": "it states who accepts what within which limits; docs/verify.md has one to copy",
    "readings.csv": "'tango run' makes the readings of a cell, 'tango simulate' those of its world.yaml",
}
RESUME = re.compile(rb' .*"kind":"segment".*"how":("[^"\\]*")')  # of the first program that went out; older journals have none


def complaint(file: Path | str, line: int | None, key: str, found: str, allowed: str) -> InputError:
    """where, what was found, what is allowed → the error to raise; one form for every file."""
    name = printable(str(file))
    place = f"{name}:{line}" if line else name
    found, key = printable(found), printable(key)
    return InputError(f"{place}: {key}: found {found}; allowed: {allowed}" if key else f"{place}: {found}; {allowed}")


def there(file: Path) -> bool:
    """file that a text names → whether there is one; no for a name that no file can have."""
    try:
        return file.exists()
    except (OSError, ValueError):
        return False


def _unseen(character: str) -> bool:
    """character → whether it controls a screen, or turns the way in which the text behind it is written."""
    return (unicodedata.category(character) == "Cc" and character not in "\n\t") or unicodedata.bidirectional(character) in TURNING


@dataclass(frozen=True, slots=True)
class Node:
    """One value of a YAML file with the path of keys that leads to it."""

    file: Path
    raw: Raw
    path: str

    @property
    def line(self) -> int:
        """→ line in the file, from 1."""
        return self.raw.line + 1

    def wrong(self, allowed: str, found: str | None = None) -> InputError:
        """what is allowed here → the error to raise."""
        shown = found or self._shown()
        if not self.path:  # the file as a whole has no key
            return complaint(self.file, self.line, "", f"found {shown}", f"allowed: {allowed}")
        return complaint(self.file, self.line, self.path, shown, allowed)

    def _shown(self) -> str:
        if isinstance(self.raw, Scalar):
            value = self.raw.value
            return (
                "nothing" if not value else repr(value) if len(value) <= SHOWN else f"{value[:SHOWN]!r}… of {len(value)} characters"
            )
        return "a list" if isinstance(self.raw, Series) else "a mapping"

    def items(self) -> list[tuple[str, Node]]:
        """mapping → (key, value) in file order. Raises InputError for anything else and for a key given twice."""
        result = self.pairs()
        seen: set[str] = set()
        for (key, child), (raw, _) in zip(result, cast("Pairs", self.raw).value, strict=True):
            if key in seen:
                raise complaint(self.file, raw.line + 1, child.path, *TWICE)
            seen.add(key)
        return result

    def pairs(self) -> list[tuple[str, Node]]:
        """mapping → (key, value) in file order, a key as often as it is given. Raises InputError for anything else."""
        if not isinstance(self.raw, Pairs):
            raise self.wrong("a mapping (key: value)")
        result: list[tuple[str, Node]] = []
        for key, value in self.raw.value:
            if not isinstance(key, Scalar):
                raise self.wrong("keys that are plain words or numbers")
            name = "".join(f"\\u{ord(c):04x}" if _unseen(c) else c for c in str(key.value))  # it would turn the message round
            result.append((str(key.value), Node(self.file, value, f"{self.path}.{name}" if self.path else name)))
        return result

    def fields(self, required: Collection[str], optional: Collection[str] = ()) -> dict[str, Node]:
        """mapping → {key: value}. Raises InputError for unknown and missing keys."""
        known = list(dict.fromkeys([*required, *optional]))
        found = dict(self.items())
        for key, child in found.items():
            if key not in known:
                raise unknown(child, key, known)
        for key in required:
            if key not in found:
                raise missing(self, key)
        return found

    def list(self, length: int | None = None) -> list[Node]:
        """sequence → its values. Raises InputError for anything else or another length."""
        if not isinstance(self.raw, Series) or (length is not None and len(self.raw.value) != length):
            count = len(self.raw.value) if isinstance(self.raw, Series) else 0
            what = f"{count} value{'s' if count != 1 else ''}" if isinstance(self.raw, Series) else None
            point = "; a decimal has a point, no comma" if length and count > length else ""
            raise self.wrong("a list" if length is None else f"a list of {length} values{point}", what)
        return [Node(self.file, value, f"{self.path}[{i}]") for i, value in enumerate(self.raw.value)]

    def text(self, allowed: Collection[str] | None = None) -> str:
        """scalar → text. Raises InputError when it is empty or not among `allowed`."""
        value = self._characters("a text" if allowed is None else ", ".join(allowed))
        if allowed is not None and value not in allowed:
            raise self.wrong(", ".join(allowed) + "." + suggestion(value, allowed))
        if unseen := next((c for c in value if _unseen(c)), None):
            raise self.wrong("characters that are seen", f"the character U+{ord(unseen):04X} in {value[:SHOWN]!r}")
        return value

    def _characters(self, allowed: str) -> str:
        if not isinstance(self.raw, Scalar) or not self.raw.value or self.raw.tag == "tag:yaml.org,2002:null":
            raise self.wrong(allowed)
        return str(self.raw.value)

    def named(self, folder: Path) -> Path:
        """scalar, folder → the file of that name, there or not. Raises InputError for a name that no file can have."""
        file = folder / self._characters("a text")
        try:
            file.lstat()
        except (FileNotFoundError, NotADirectoryError, PermissionError):
            return file
        except (OSError, ValueError) as error:
            raise self.wrong(f"a name that a file can have ({error.strerror if isinstance(error, OSError) else error})") from None
        return file

    def identifier(self) -> Id:
        """integer or string → id as text. Raises InputError for one that no file of readings could hold."""
        return self.called(self.text())

    def called(self, key: str) -> Id:
        """the key of this value → an id. Raises InputError for blanks at an end, which readings lose, and for what nobody sees."""
        if key != key.strip() or not key or any(_unseen(c) or c in "\n\t" for c in key):
            raise self.wrong("a name of characters that are seen, without a blank at either end", repr(key[:SHOWN]))
        return key

    def number(self, low: float = -math.inf, high: float = math.inf, *, above: float = -math.inf) -> float:
        """scalar → finite float in [low, high] and > above. Raises InputError for anything else."""
        bounds = []
        if above > -math.inf:
            bounds.append(f"greater than {above:g}")
        if low > -math.inf:
            bounds.append(f"at least {low:.10g}")
        if high < math.inf:
            bounds.append(f"at most {high:.10g}")
        allowed = "a finite number" + (" " + " and ".join(bounds) if bounds else "")
        if not isinstance(self.raw, Scalar):
            raise self.wrong(allowed)
        if self.raw.style in ("'", '"'):
            raise self.wrong(allowed, f"the text {self.raw.value!r} in quotes")
        try:
            value = float(self.raw.value)
        except ValueError:
            raise self.wrong(allowed) from None
        if not math.isfinite(value) or not (low <= value <= high) or not value > above:
            raise self.wrong(allowed)
        return value

    def integer(self, low: int = -(2**62)) -> int:
        """scalar → integer of at least `low`. Raises InputError for anything else."""
        value = self.number(low)
        if value != int(value):
            raise self.wrong("a whole number")
        return int(value)

    def boolean(self) -> bool:
        """true or false → bool. Raises InputError for anything else."""
        if not isinstance(self.raw, Scalar) or self.raw.tag != "tag:yaml.org,2002:bool":
            raise self.wrong("true or false")
        return bool(yaml.safe_load(self.raw.value))

    def position(self) -> float:
        """scalar → mm or degrees that a machine tool can have. Raises InputError for anything else."""
        return self.number(-FURTHEST, FURTHEST)

    def size(self) -> float:
        """scalar → length > 0 in mm that a machine tool can have. Raises InputError for anything else."""
        return self.number(above=0, high=FURTHEST)

    def vector(self) -> Vector:
        """list of three positions → tuple. Raises InputError for anything else."""
        x, y, z = (item.position() for item in self.list(3))
        return x, y, z

    def unit_vector(self) -> Vector:
        """list of three numbers within 1e-3 of unit length → unit vector. Raises InputError for anything else."""
        x, y, z = (item.number() for item in self.list(3))
        length = math.sqrt(x * x + y * y + z * z)
        if abs(length - 1) > 1e-3:
            raise self.wrong("a vector of length 1 (within 0.001)", f"[{x:g}, {y:g}, {z:g}], of length {length:.6g}")
        return x / length, y / length, z / length

    def plain(self) -> Any:
        """anything → plain Python values (numbers finite), for settings whose meaning is decided elsewhere."""
        if isinstance(self.raw, Pairs):
            return {key: child.plain() for key, child in self.items()}
        if isinstance(self.raw, Series):
            return [child.plain() for child in self.list()]
        if self.raw.tag == "tag:yaml.org,2002:null":
            return None
        if self.raw.tag == "tag:yaml.org,2002:bool":
            return self.boolean()
        if self.raw.tag == "tag:yaml.org,2002:int":
            if len(self.raw.value) > DIGITS:
                raise self.wrong(f"a whole number of at most {DIGITS} digits")
            return int(self.raw.value) if WHOLE.fullmatch(self.raw.value) else yaml.safe_load(str(self.raw.value))
        if not isinstance(self.raw, Scalar) or self.raw.style not in ("'", '"'):
            try:
                float(self.raw.value)
            except ValueError:
                return str(self.raw.value)
            return self.number()
        return str(self.raw.value)


def unknown(value: Node, key: str, known: Collection[str]) -> InputError:
    """value, its key that nobody knows, the keys that are known → the error to raise."""
    hint = suggestion(key, known) or (COMMA if NUMERAL.fullmatch(key) else "")
    return complaint(value.file, value.line, value.path, f"the unknown key {key!r}", f"{', '.join(known)}.{hint}")


def missing(mapping: Node, key: str) -> InputError:
    """mapping, key that it needs → the error to raise."""
    return complaint(
        mapping.file, mapping.line, mapping.path or "file", f"no key {key!r}", f"{VERSIONS.get(key, repr(key))} is required here"
    )


def parse(file: Path, text: str) -> Node:
    """YAML text → its root. Raises InputError when it is empty or not YAML."""
    try:
        if len(text) > LONGEST:
            raise complaint(file, None, "", f"{len(text)} characters of YAML", f"at most {LONGEST}; is it another kind of file?")
        raw = Composer(text).document()
        _limited(file, raw)
    except RecursionError:
        raise complaint(file, None, "", f"nested deeper than {DEEPEST} levels", "see docs/formats.md for its keys") from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        blamed = text.splitlines()[mark.line : mark.line + 1] if mark else []
        advice = "YAML allows no tabs: write blanks in their place" if "\t" in "".join(blamed) else "check indentation and brackets"
        raise complaint(file, mark.line + 1 if mark else None, "", f"not valid YAML: {error.problem}", advice) from None
    except yaml.YAMLError as error:
        raise complaint(file, None, "", f"not valid YAML: {error}", "save the file as UTF-8 text") from None
    if raw is None:
        raise complaint(file, None, "", "the file is empty", "see docs/formats.md for its keys")
    return Node(file, raw, "")


def _limited(file: Path, raw: Raw | None) -> None:
    """Raises InputError where nesting, or aliases of aliases, make more of the text than anybody has written."""
    sizes: dict[int, int] = {}
    open_: set[int] = set()

    def size(node: Raw, depth: int) -> int:
        if isinstance(node, Scalar):
            return 1
        if id(node) in open_:
            raise complaint(file, node.line + 1, "", "an alias inside its own value", "write the values out")
        if depth > DEEPEST:
            raise complaint(file, node.line + 1, "", f"nested deeper than {DEEPEST} levels", "see docs/formats.md for its keys")
        if id(node) not in sizes:
            open_.add(id(node))
            inner = node.value if isinstance(node, Series) else [item for pair in node.value for item in pair]
            sizes[id(node)] = 1 + sum(size(item, depth + 1) for item in inner)
            open_.discard(id(node))
        if sizes[id(node)] > MOST_VALUES:
            raise complaint(file, node.line + 1, "", f"more than {MOST_VALUES} values by aliases", "write the values out")
        return sizes[id(node)]

    if raw is not None:
        size(raw, 0)


def broken_off(journal: Path) -> str:
    """journal of a run that was broken off → the command that goes on with it, and what else can be done."""
    return f"'tango run {resumed(journal)}' goes on with it, 'tango journal salvage' makes readings of what there is"


def resumed(journal: Path) -> str:
    """journal → what 'tango run' has to state to go on with its run."""
    with suppress(OSError, ValueError, InputError):
        plain(journal)
        with journal.open("rb") as lines:
            found = RESUME.search(b"".join(itertools.islice(lines, 2)))  # which format it is, and the program
        return str(json.loads(found[1])) if found else "--resume"
    return "--resume"


def _instead(file: Path) -> str:
    """file that is not there → what to do; where a run has left a journal and no readings, it was broken off."""
    journal = file.with_suffix(".journal")
    if file.suffix == ".csv" and there(journal):
        return f"{journal.name} has the touches of a run that was broken off: {broken_off(journal)}"
    return MISSING.get(file.name, "check the path; it starts from here")


def read_bytes(file: Path) -> bytes:
    """file → its bytes. Raises InputError when it is missing, is a device or a pipe, or is too large."""
    try:
        plain(file)
        with file.open("rb") as opened:
            size = os.fstat(opened.fileno()).st_size
            if size > LARGEST:
                raise complaint(file, None, "", f"{size} bytes", f"at most {LARGEST} are read; is it another kind of file?")
            return opened.read(max(size, SMALL))
    except FileNotFoundError:
        raise complaint(file, None, "", "no such file", _instead(file)) from None
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else str(error)
        raise complaint(file, None, "", f"cannot be read ({why})", "check the path and its permissions") from None


def plain(file: Path) -> None:
    """file → nothing. Raises InputError for a device or a pipe: opening it may wait for ever, and reading it may never end."""
    if file.exists() and not file.is_file() and not file.is_dir():
        raise complaint(file, None, "", "a device or a pipe", "a file is read from the disk")


def read_text(file: Path) -> str:
    """file → text. Raises InputError when there is no such file, it is not UTF-8, or no text that anybody has written."""
    try:
        text = read_bytes(file).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise complaint(file, None, "", "not UTF-8 text", "save the file as UTF-8") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


_parsed = lru_cache(maxsize=32)(parse)  # of small files: one command asks several times, and what was parsed is never changed


def rows_of(file: Path | str, lines: Sequence[str], delimiter: str = ",", first: int = 1) -> list[list[str]]:
    """lines of a table, what parts its values, number of the first line → values of each row.

    Raises InputError for a value that no program would write: its quote was never closed, or a line has lost its end.
    """
    reader, rows = csv.reader(lines, delimiter=delimiter), []
    try:
        for row in reader:
            rows.append(row)
    except csv.Error as error:
        allowed = f"values of at most {csv.field_size_limit()} characters, and every quote closed"
        raise complaint(file, first - 1 + max(reader.line_num, 1), "", str(error), allowed) from None
    return rows


def load(file: Path) -> Node:
    """file → its root. Raises InputError when it cannot be read or is not YAML."""
    text = read_text(file)
    return _parsed(file, text) if len(text) <= SMALL else parse(file, text)


@contextmanager
def blamed_on(file: Path) -> Iterator[None]:
    """file whose values a later stage judges → within it, an InputError about one of its keys names the file and the line."""
    try:
        yield
    except InputError as error:
        match = re.match(r"(\w+)(?:\[(\d+)\])?(?:\.(\w+))?: found (?:the unknown key )?(?:'([^']*)')?", str(error))
        top = dict(load(file).items()).get(match[1]) if match else None
        if match is None or top is None:
            raise
        at = _where(top, match)
        raise InputError(f"{file}:{at}: {error}") from None


def _where(node: Node, match: re.Match[str]) -> int:
    if match[2] is not None and isinstance(node.raw, Series):
        node = node.list()[int(match[2])]
    if isinstance(node.raw, Pairs):
        inside = dict(node.items())
        node = inside.get(match[3] or match[4], node)
    if isinstance(node.raw, Series):  # an entry of it, or of the list under the key
        node = next((item for item in node.list() if item.plain() == match[4]), node)
    return node.line
