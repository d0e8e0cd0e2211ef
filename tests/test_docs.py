"""What the documentation points to exists, and what exists is in the documentation."""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path

import click
import pytest
from support.imports import modules
from support.rows import added, command, names_in, writing

from tango_cnc.cli import FOR, tango

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
WRITE = command("tests/test_docs.py -k table_of_commands")
COMMANDS = set(tango.list_commands(click.Context(tango)))


def text(file: Path) -> str:
    return file.read_text(encoding="utf-8")


def test_the_table_of_commands_is_complete() -> None:
    table = text(ROOT / "docs" / "formats.md").split("| command | does |")[1].split("\n\n")[0]
    first = " ".join(line.split("|")[1] for line in table.splitlines()[2:])
    listed = {name.split()[0] for name in re.findall(r"`([^`]+)`", first)}
    rows = [f"| `{name}` | {what_for(name)} |" for name in sorted(COMMANDS - listed)]
    if rows and writing():
        page = ROOT / "docs" / "formats.md"
        for row in rows:
            page.write_text(added(text(page), "| command | does |", row), encoding="utf-8")
        return
    asked = f"docs/formats.md, table | command | does |: {WRITE} adds this row; say its options there, too"
    assert not rows, f"{asked}:\n" + "\n".join(rows)
    assert not listed - COMMANDS, f"docs/formats.md, table | command | does |: no command has these names: {listed - COMMANDS}"


def what_for(name: str) -> str:
    """command → what the first line of its file says that it is for."""
    found = FOR.match(text(ROOT / "tango_cnc" / "commands" / f"{name.replace('-', '_')}.py"))
    return found[1] if found else "what it does"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_and_options_in_the_text_exist(page: Path) -> None:
    for name, rest in re.findall(r"\btango ([a-z][a-z0-9-]+)((?: [^\n`#]*)?)", text(page)):
        if name not in COMMANDS:
            # only words of a sentence may follow the name of the program otherwise
            assert not re.search(r" -{1,2}[a-zA-Z]", rest), f"tango {name}{rest}"
            continue
        command = tango.get_command(click.Context(tango), name)
        assert command is not None
        if isinstance(command, click.Group) and (action := rest.split()[0] if rest.split() else "") in command.commands:
            command = command.commands[action]
        known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)} | {"--help"}
        wanted = re.split(r"[,;:|)]", rest)[0]
        for option in re.findall(r"(?<= )-{1,2}[a-zA-Z][a-z-]*", wanted):
            assert option in known, f"tango {name} has no {option}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_in_the_text_exist(page: Path) -> None:
    folders = "docs|tests|benchmarks|examples|tango_cnc|postprocessors|sim_controller"
    for name in re.findall(rf"\b((?:{folders})/[\w/.<>]*[\w>])", text(page)):
        assert list(ROOT.glob(re.sub("<.*?>", "*", name))), name


def test_documentation_named_in_the_program_exists() -> None:
    for file in (f for package in ("tango_cnc", "postprocessors", "sim_controller") for f in (ROOT / package).rglob("*.py")):
        for name in re.findall(r"\bdocs/[\w-]+\.md", text(file)):
            assert (ROOT / name).exists(), f"{file.relative_to(ROOT)} points to {name}"


def test_readme_points_to_every_page() -> None:
    readme = text(ROOT / "README.md")
    lacking = [f"docs/{page.name}" for page in PAGES[1:] if f"docs/{page.name}" not in readme]
    assert not lacking, f"README.md: add a link to {', '.join(lacking)}"


def test_make_targets_in_the_text_exist() -> None:
    makefile = text(ROOT / "Makefile")
    for page in PAGES:
        for target in re.findall(r"(?:^ {4}|`)make ([a-z-]+)", text(page), re.MULTILINE):
            assert f"\n{target}:" in makefile, f"{page.name}: make {target}"


def _found(name: str) -> bool:
    """dotted name → whether it is a module, or something in one."""
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        module, _, member = name.rpartition(".")
        return bool(module) and member in vars(importlib.import_module(module))
    return True


def test_every_word_of_the_glossary_is_where_the_glossary_says() -> None:
    rows = [line.split("|") for line in text(ROOT / "docs" / "glossary.md").splitlines() if line.startswith("| ")][1:]
    words = [row[1].strip() for row in rows]
    assert len(words) == len(set(words)) > 30
    for row in rows:
        name = row[3].strip().strip("`")
        assert _found(name), f"docs/glossary.md: {row[1].strip()}: {name} does not exist; correct the third column"


# A class of a page or a target that is what the glossary's word says, as that stage has it.
AS_WELL = {"Machine": "tango_cnc.web.places", "Option": "tango_cnc.compensate.targets", "Decision": "tango_cnc.conformity"}


def test_no_other_class_has_the_name_of_a_word_of_the_glossary() -> None:
    rows = [line.split("|") for line in text(ROOT / "docs" / "glossary.md").splitlines() if line.startswith("| ")][1:]
    homes = {name.rpartition(".")[2]: name for row in rows if (name := row[3].strip().strip("`"))}
    for name, file in modules(ROOT).items():
        if name.startswith(("sim_controller", "tango_cnc.link.protocols.")):  # a program of its own; each has its Client
            continue
        for found in re.findall(r"^class (\w+)", text(file), re.MULTILINE):
            if found in homes and AS_WELL.get(found) != name:
                home = importlib.import_module(homes[found].rpartition(".")[0])
                same = vars(importlib.import_module(name))[found] is vars(home)[found]
                assert same, f"{name}.{found}: the glossary has that word for {homes[found]}; use another one"


PROSE = 100  # characters a line: what a window beside the work shows


@pytest.mark.parametrize(
    "file", [*PAGES, ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*/*.md"))], ids=lambda file: str(file.relative_to(ROOT))
)
def test_lines_of_prose_fit_a_window(file: Path) -> None:
    """Tables, code and a word, a command or an address that is longer by itself are no prose."""
    long, code = [], False
    for number, line in enumerate(text(file).splitlines(), 1):
        code ^= line.lstrip().startswith("```")
        words = re.sub(r"`[^`]*`|\[[^]]*\]\([^)]*\)", "_", line).split()
        if not code and len(line) > PROSE and not line.startswith(("|", "    ")) and len(words) > 1:
            long.append(number)
    assert long == [], f"{file.name}: longer than {PROSE} characters; wrap them"


FORMAT = re.compile(r"tango-[a-z-]+/\d+")
OTHERS = "| format | of | members |"


def written() -> dict[str, tuple[str, list[str]]]:
    """→ {format that a command writes as JSON: the command, the members that stand beside it where it is written}."""
    found: dict[str, tuple[str, list[str]]] = {}
    for file in sorted((ROOT / "tango_cnc" / "commands").glob("*.py")):
        if '"format": "tango-' not in text(file):
            continue
        for node in ast.walk(ast.parse(text(file))):
            keys = [key.value for key in node.keys if isinstance(key, ast.Constant)] if isinstance(node, ast.Dict) else []
            named = node.values[0] if isinstance(node, ast.Dict) and keys[:1] == ["format"] else None
            if isinstance(named, ast.Constant) and FORMAT.fullmatch(str(named.value)):
                found[named.value] = (file.stem.strip("_"), keys[1:])
    return found


def test_every_format_of_a_json_result_is_documented_with_its_members() -> None:
    """A command was added with `--json`, its format was a promise to scripts, and nothing asked what is in it."""
    pages, known = "".join(text(page) for page in (ROOT / "docs").glob("*.md")), written()
    formats = text(ROOT / "docs" / "formats.md")
    rows = {
        name: f"| `{name}` | `{command_}` | {', '.join(f'`{key}`' for key in keys)} |" for name, (command_, keys) in known.items()
    }
    missing = [row for name, row in rows.items() if f"`{name}`" not in pages]
    if missing and writing():
        for row in missing:
            formats = added(formats, OTHERS, row)
        (ROOT / "docs" / "formats.md").write_text(formats, encoding="utf-8")
        return
    adds = command("tests/test_docs.py -k json_result")
    assert not missing, f"docs/formats.md, {OTHERS}: {adds} adds this row; say what each member means:\n" + "\n".join(missing)
    listed = names_in(formats, OTHERS)
    lacking = {name: keys for name in listed if (keys := [k for k in known[name][1] if f"`{k}`" not in listed[name]])}
    assert not lacking, f"docs/formats.md, {OTHERS}: members that its rows lack: {lacking}"
