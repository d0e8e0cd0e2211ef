"""Macros in Basic → steps. Every line has to be in one of the few forms below, so that nothing gets through that nobody thought of.

Values are spelt as in parametric programs, for `_expressions`: GetVar(5) is #5, a name of Basic #<name>, one of the control's
displays #10083, one of its lamps #20825, a text of one letter that letter's number, no text 0.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ....records import InputError

DISPLAY, LAMP = 10_000, 20_000  # added to the number of a DRO, of an LED
DEGREES = 57.29577951308232  # in a radian
TOKEN = re.compile(r'\s*("[A-Z]?"|\d+\.?\d*|<>|<=|>=|[A-Za-z]\w*|[-+*/=<>()])')
LEVELS: tuple[Mapping[str, str], ...] = (
    {"or": "OR"},
    {"and": "AND"},
    {"=": "EQ", "<>": "NE", "<": "LT", ">": "GT", "<=": "LE", ">=": "GE"},
    {"+": "+", "-": "-"},
    {"*": "*", "/": "/"},
)
COMPARED = 2  # level of the comparisons
NUMBER, TEXT, LIT, TRUTH = "number", "text", "lamp", "comparison"
NAME, VALUE, PRECISE = r"[A-Z][A-Za-z]{0,9}", r"[^\"&]+", r"Format\([^\"&]+, \"0\.0000\"\)"
WORDS = rf"(?: & \" [A-Z]\" & {PRECISE})+"
WORD = re.compile(r'" ([A-Z])" & Format\(([^"&]+), "0\.0000"\)')
IF = re.compile(r"If (.+) Then")
COMMA = 'InStr(Format(0.5, "0.0"), ",") > 0'  # whether this Windows writes one; here it does not
SETS = re.compile(rf"Call SetVar\((\d+), ({VALUE})\)")
ASSIGN = re.compile(rf"({NAME}) = (.+)", re.IGNORECASE)
TAKEN = re.compile(  # names that mean something else: no value is given to them
    "mark|text|at|rem|let|call|setvar|getvar|getoemdro|getoemled|ismoving|filename|param|abs|sqr|sin|format|mid|len|instr|eof|"
    "code|message|sleep|open|print|close|line|if|then|end|while|wend|exit|sub|stop|or|and|not|true|false"
)
REMARK = re.compile(r"'[A-Za-z0-9 .,:()]*")  # nothing that goes on in the next line
SWITCH = re.compile(r'Code "([A-Z0-9 .]+)"')
MESSAGE = re.compile(r'Message "TANGO STOPPED\. [A-Z0-9 .]+"')
BUTTON, LEAVES = "Call DoOEMButton(1003)", "Exit Sub"
WAIT = ["While IsMoving()", "Sleep 20", "Wend"]
GOAL = "".join(rf' & " {name}" & {PRECISE}' for name in "XYZ")
MOVE = re.compile(rf'Code "G90 G21 (G31|G1)"({GOAL}) & " F" & ({VALUE})')
STEP = re.compile(rf'Code "G91 G21 G31"({GOAL}) & " F" & ({VALUE})')
TURN = re.compile(rf'Code "G90 G21 G53 G0 " & ({NAME}) & Format\(({VALUE}), "0\.0000"\)')
OPEN = re.compile(r'Open "([^"&]+)" For Append As #1')
RECORD = re.compile(rf'Print #1, "P" & Format\(({VALUE}), "0"\) & " H" & Format\(({VALUE}), "0"\)({WORDS})')
LOOK = [
    'Mark = ""',
    "Open FileName() For Input As #1",
    "While Not EOF(1)",
    "Line Input #1, Text",
    'At = InStr(Text, "TANGO {} ")',
    "If At > 0 Then",
    "Mark = Mid(Text, At, Len(Text) - At)",
    "End If",
    "Wend",
    "Close #1",
]


@dataclass(frozen=True)
class Leave:
    """The macro does nothing more where the condition holds."""

    condition: str


@dataclass(frozen=True)
class Stop:
    """Where the condition holds: `variable` says so from then on, `word` is carried out, the program stops with a text."""

    condition: str
    variable: int
    word: str = ""


@dataclass(frozen=True)
class Given:
    """A variable of the control (number) or of the macro (name) has a value, where the condition holds."""

    name: int | str
    value: str
    condition: str = ""


@dataclass(frozen=True)
class Wait:
    """Until the axes stand."""


@dataclass(frozen=True)
class Move:
    """{axis letter: work coordinate}; `word` G31 is guarded, G1 is not."""

    word: str
    target: Mapping[str, str]
    feed: str


@dataclass(frozen=True)
class Step:
    """{axis letter: mm} by which the axes go, guarded; what is said of places is a distance until `Absolute`."""

    by: Mapping[str, str]
    feed: str


@dataclass(frozen=True)
class Absolute:
    """What is said of places is a place again."""


@dataclass(frozen=True)
class Turn:
    """A rotary axis to an angle; `letter` is the number of its letter."""

    letter: str
    angle: str


@dataclass(frozen=True)
class Look:
    """The mark START or END is taken out of the program that is loaded, into `Mark`."""

    word: str


@dataclass(frozen=True)
class Say:
    """`Mark` is added to a file."""

    file: str


@dataclass(frozen=True)
class Record:
    """The line of a touch is added to a file."""

    file: str
    number: str
    flag: str
    places: Mapping[str, str]


Action = Leave | Stop | Given | Wait | Move | Step | Absolute | Turn | Look | Say | Record


def steps(lines: Sequence[str]) -> list[tuple[int, Action]]:
    """lines of a macro → (line number, step). Raises InputError naming the line that is in none of the forms."""
    rows = [(n, line.strip()) for n, line in enumerate(lines, 1) if line.strip() and not REMARK.fullmatch(line)]
    for number, line in rows:
        if not (line.isascii() and line.isprintable()):
            raise InputError(f"line {number} {line[:80]!r}: found a character that cannot be printed or is not of ASCII")
    found, at = [], 0
    while at < len(rows):
        number, line = rows[at]
        try:
            step, count = _step([text for _, text in rows[at:]])
        except InputError as error:
            raise InputError(f"line {number} {line[:80]!r}: {error}") from None
        found.append((number, step))
        at += count
    return found


def _step(rows: list[str]) -> tuple[Action, int]:
    """lines from here on → the step that they begin with, how many lines it has."""
    line = rows[0]
    if rows[:3] == WAIT:
        return Wait(), 3
    if match := IF.fullmatch(line):
        inner = rows[1 : rows.index("End If")] if "End If" in rows else []
        return _conditional("[0 EQ 1]" if match[1] == COMMA else spelt(match[1], (TRUTH,)), inner), len(inner) + 2
    for word in ("START", "END"):
        if rows[: len(LOOK)] == [text.format(word) for text in LOOK]:
            return Look(word), len(LOOK)
    if match := OPEN.fullmatch(line):
        return _written(match[1], rows[1:3]), 3
    if match := MOVE.fullmatch(line):
        return Move(match[1], _words(match[2]), spelt(match[3])), 1
    if match := STEP.fullmatch(line):
        return Step(_words(match[1]), spelt(match[2])), 1
    if line == 'Code "G90"':
        return Absolute(), 1
    if match := TURN.fullmatch(line):
        return Turn(spelt(match[1]), spelt(match[2])), 1
    return _given(line), 1


def _conditional(condition: str, inner: list[str]) -> Action:
    if inner == [LEAVES]:
        return Leave(condition)
    if len(inner) == 1:
        return _given(inner[0], condition)
    sets = SETS.fullmatch(inner[0]) if inner else None
    switch = SWITCH.fullmatch(inner[1]) if len(inner) == 8 and inner[2:5] == WAIT else None
    rest = inner[5:] if switch else inner[1:]
    if sets and sets[2] == "1" and len(rest) == 3 and MESSAGE.fullmatch(rest[0]) and rest[1:] == [BUTTON, LEAVES]:
        return Stop(condition, int(sets[1]), switch[1] if switch else "")

    raise InputError(
        "allowed in an If: Exit Sub, one value, or a stop (SetVar of 1, Code with the word that switches the probe off, While "
        "IsMoving, Message, DoOEMButton, Exit Sub), then End If"
    )


def _given(line: str, condition: str = "") -> Given:
    if match := SETS.fullmatch(line):
        return Given(int(match[1]), spelt(match[2]), condition)
    if (match := ASSIGN.fullmatch(line)) and not TAKEN.fullmatch(match[1].lower()):
        return Given(match[1].lower(), spelt(match[2], (NUMBER, TEXT)), condition)
    raise InputError("no line that a macro of this kind may have here")


def _written(file: str, rows: list[str]) -> Action:
    if rows == ["Print #1, Mark", "Close #1"]:
        return Say(file)
    match = RECORD.fullmatch(rows[0]) if rows[1:] == ["Close #1"] else None
    if match is None:
        raise InputError("allowed after Open: Print of the mark or of a record, Close")
    return Record(file, spelt(match[1]), spelt(match[2]), _words(match[3]))


def _words(text: str) -> dict[str, str]:
    """' & " X" & Format(…)…' → {letter: value}. Raises InputError for a letter that appears twice."""
    pairs = [(letter, spelt(value)) for letter, value in WORD.findall(text)]
    if len(dict(pairs)) != len(pairs):
        raise InputError("a letter appears twice")
    return dict(pairs)


def spelt(text: str, kinds: tuple[str, ...] = (NUMBER,)) -> str:
    """expression of Basic, what it may be → the same as in parametric programs. Raises InputError for what is none.

    True is -1 in Basic and And works bit by bit: what is true is no number here. A lamp that is lit is 1 or -1: not 0.
    """
    tokens, at = [], 0
    text = text.strip()
    while at < len(text):
        match = TOKEN.match(text, at)
        if match is None:
            raise InputError(f"no expression at {text[at:]!r}")
        tokens.append(match[1])
        at = match.end()
    tokens.reverse()
    found, kind = _level(tokens, 0)
    if tokens:
        raise InputError(f"no expression at {tokens[-1]!r}")
    if kind not in kinds:
        raise InputError(f"{text!r} is a {kind}; allowed: a {' or a '.join(kinds)}")
    return found


def _level(tokens: list[str], depth: int) -> tuple[str, str]:
    if depth == len(LEVELS):
        return _primary(tokens)
    left, kind = _level(tokens, depth + 1)
    while tokens and (word := tokens[-1].lower()) in LEVELS[depth]:
        tokens.pop()
        right, other = _level(tokens, depth + 1)
        if depth < COMPARED:
            fits = kind == other == TRUTH
        elif depth == COMPARED and word in ("=", "<>"):
            fits = right == "0" if kind == LIT else {kind, other} <= {NUMBER, TEXT}
        else:
            fits = kind == other == NUMBER
        if not fits:
            raise InputError(f"a {kind} {word} a {other}; allowed: numbers, Or and And of comparisons, a lamp = 0 or <> 0")
        left, kind = f"[{left} {LEVELS[depth][word]} {right}]", TRUTH if depth <= COMPARED else NUMBER
    return left, kind


def _primary(tokens: list[str]) -> tuple[str, str]:
    word = tokens.pop() if tokens else ""
    if word == "-":
        return f"[-{_number(*_primary(tokens))}]", NUMBER
    if word == "(":
        return _closed(tokens)
    if word[:1] == '"':
        return (str(ord(word[1])) if len(word) == 3 else "0"), TEXT
    if word[:1].isdigit():
        return word, NUMBER
    if not word[:1].isalpha():
        raise InputError(f"no expression at {word!r}" if word else "the expression ends too soon")
    if not tokens or tokens[-1] != "(":
        return f"#<{word.lower()}>", NUMBER
    tokens.pop()
    if word == "Param1":
        if not tokens or tokens.pop() != ")":
            raise InputError("found a value for Param1; allowed: Param1()")
        return "#<param1>", NUMBER
    inner = _number(*_closed(tokens))
    if word in ("GetVar", "GetOEMDRO", "GetOEMLED"):
        added = {"GetOEMDRO": DISPLAY, "GetOEMLED": LAMP}.get(word, 0)
        place = f"#{int(inner) + added}" if inner.isdigit() else f"#[{added} + {inner}]"
        return place, LIT if word == "GetOEMLED" else NUMBER
    if word not in ("Abs", "Sqr", "Sin"):
        raise InputError(f"found {word}; allowed: GetVar, GetOEMDRO, GetOEMLED, Param1, Abs, Sqr, Sin")
    return {"Abs": "ABS[{}]", "Sqr": "SQRT[{}]", "Sin": f"SIN[{DEGREES} * {{}}]"}[word].format(inner), NUMBER


def _number(text: str, kind: str) -> str:
    if kind != NUMBER:
        raise InputError(f"found a {kind}; allowed: a number")
    return text


def _closed(tokens: list[str]) -> tuple[str, str]:
    inner = _level(tokens, 0)
    if not tokens or tokens.pop() != ")":
        raise InputError(") is missing")
    return inner
