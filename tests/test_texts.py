"""Every sentence that a report or a page says stands in texts/en.toml, where it can be translated."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.imports import tree

from tango_cnc.report.texts import texts

ROOT = Path(__file__).parents[1] / "tango_cnc"
UNITS = ROOT / "nightly" / "install.py"  # files for systemd and cron, no sentences
CODE = sorted({f for part in ("report", "web", "nightly") for f in (ROOT / part).rglob("*.py")} - {UNITS})
FOLDERS = (ROOT / "report" / "templates", ROOT / "web" / "templates")
TEMPLATES = sorted(p for folder in FOLDERS for p in folder.iterdir() if p.suffix in (".html", ".typ"))
WORDS = re.compile(r"(?<![\w.'/<-])[A-Za-z]{2,}[,;:]? [a-z]{2,}[,;:]? [a-z]{2,}\b")  # three words in a row: a sentence
NO_SENTENCE = (
    "since last night",
    "outside upper center",
    "tango history decide ",
)  # what is looked for in old records; a place of a legend
ERRORS = ("InputError", "HTTPException")  # of files and options: English everywhere


def sentences(found: ast.Module) -> Iterator[tuple[int, str]]:
    """Strings of a module that read as a sentence, but for docstrings and errors."""
    skipped: set[int] = set()
    for node in ast.walk(found):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            skipped.add(id(node.value))
        error = isinstance(node, ast.Call) and ast.unparse(node.func).endswith(ERRORS)
        if error or isinstance(node, ast.Raise | ast.Assert):
            skipped |= {id(n) for n in ast.walk(node)}
    for node in ast.walk(found):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in skipped and WORDS.search(node.value):
            yield node.lineno, node.value


def test_no_sentence_for_a_person_is_typed_in_the_code() -> None:
    assert len(CODE) > 50
    found = [(file, line, text) for file in CODE for line, text in sentences(tree(file)) if text not in NO_SENTENCE]
    assert not [f"{file.relative_to(ROOT)}:{line}: {text[:80]}" for file, line, text in found]


@pytest.mark.parametrize("file", TEMPLATES, ids=lambda p: p.name)
def test_no_word_for_a_person_is_typed_in_a_template(file: Path) -> None:
    text = re.sub(r"\{\{.*?\}\}|\{%.*?%\}|\{#.*?#\}", " ", file.read_text(encoding="utf-8"), flags=re.DOTALL)
    if file.suffix == ".html":
        text = re.sub(r"<(style|script|code)\b.*?</\1>|<[^>]*>", " ", text, flags=re.DOTALL)
        assert not [word for word in re.findall(r"[A-Za-z]{2,}", text) if word != "tango"]
    else:
        assert not re.findall(r"[A-Z][a-z]+ [a-z]+ [a-z]+", re.sub(r"//.*", "", text))


def test_the_search_finds_a_sentence() -> None:
    typed = 'x = "Nothing was measured last night"\n"""Three words here."""\nraise InputError("not so good")'
    assert [text for _, text in sentences(ast.parse(typed))] == ["Nothing was measured last night"]


def test_every_text_is_used() -> None:
    """A key that nothing asks for is a sentence that a translator writes for nobody."""
    places = [p for p in ROOT.rglob("*") if p.suffix in (".py", ".html", ".typ") and "__pycache__" not in p.parts]
    every = "".join(p.read_text(encoding="utf-8") for p in places)
    made = tuple({m[1] for m in re.finditer(r"([a-z_]+\.[a-z_.]*)(?:\{|[\"'] ~)", every)})  # "check.fit_{level}", "level." ~ level
    words = set(re.findall(r"[\w.]+", every))  # quicker than to look for each in all of it
    assert [k for k in texts().keys if k not in words and not k.startswith(made) and k not in every] == []


def test_what_to_do_begins_with_what_to_do() -> None:
    """Not with what was found: who reads it asks for an order."""
    first = (
        *("always", "approach", "ask", "calibrate", "call", "check", "clean", "compare", "compensate", "correct", "decide", "do"),
        *(
            "enter",
            "exchange",
            "find",
            "give",
            "go",
            "have",
            "keep",
            "let",
            "look",
            "machine",
            "make",
            "measure",
            "name",
            "nothing",
        ),
        *("orient", "put", "read", "run", "see", "show", "state", "tell", "touch", "wait", "warm", "watch"),
    )
    no_order = ("todo.line", "todo.diagnosis", "mail.do", "diagnosis_said.touches_were_not_fitted_do")  # parts of a sentence
    found = {k: texts()._flat[k] for k in texts().keys if _orders(k)}
    assert len(found) > 60
    begun = {k: re.split(r"[ ,:.]", v)[0].lower() for k, v in found.items() if k not in no_order}
    wrong = {k: found[k] for k, word in begun.items() if (no_verb(word) if OF_CAUSE.fullmatch(k) else word not in first)}
    files = [f"tango_cnc/terms/{of[1]}.py: advice" for k in wrong if (of := OF_CAUSE.fullmatch(k))]
    assert not wrong, f"what to do begins with an order, a verb: reword {files or list(wrong)}: {wrong}" + (
        "" if files else "; or add its verb to `first` above"
    )


OF_CAUSE = re.compile(r"diagnosed\.(\w+)\.advice")  # whoever adds a cause has other verbs, and no list to enter them in


def no_verb(word: str) -> bool:
    """first word of what to do → whether it begins a statement, not an order."""
    begins = ("a", "an", "the", "it", "its", "this", "that", "these", "there", "where", "when", "if", "some", "no", "one", "as")
    return word in begins or word.endswith(("ing", "ed", "ly"))


def test_a_cause_may_begin_its_advice_with_any_verb_and_with_nothing_else() -> None:
    """“clamp parts …” was refused, eleven minutes later, by a list of verbs that somebody had to enter it in."""
    assert [word for word in ("clamp", "shim", "the", "it", "clamping", "when") if no_verb(word)] == [
        "the",
        "it",
        "clamping",
        "when",
    ]


def _orders(key: str) -> bool:
    last = key.split(".")[-1]
    named = last in ("do", "advice") or last.endswith(("_do", "_todo")) or last.startswith("todo_")
    return (named and not key.startswith("unseen_said.")) or key.startswith(("todo.", "confirmed.", "look."))


def test_what_people_at_the_machine_read_has_no_command_in_it() -> None:
    """Commands of the program stand behind the mark of the office, which pages put into its own part."""
    from tango_cnc.report.plain import office, shop

    t = texts()
    sections = ("may", "morning", "cause", "confirmed", "part", "night", "todo", "web", "decision", "preflight", "look")
    command = re.compile(r"(?<![\w.])(?:tango (?!cnc|serve)[a-z]|--[a-z]|systemctl|crontab)")
    shown = {k: t._flat[k] for k in t.keys if k.split(".")[0] in sections and k != "morning.office_mark"}
    assert len(shown) > 200
    assert not {k: v for k, v in shown.items() if command.search(shop(v, t))}
    behind = [k for k, v in shown.items() if office(v, t)]
    assert len(behind) >= 10 and all(shop(shown[k], t) for k in behind)
