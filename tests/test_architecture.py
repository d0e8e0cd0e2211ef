"""Who may import whom. The table is the architecture; the rest reads the import statements of every file and compares."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.imports import import_statements, modules, tree

NUMERIC = "records texts judgement files.checked kinematics features touches terms model identify estimate"
# A module of tango_cnc → what else of tango_cnc it may import. The longest name that fits decides; its own package is allowed.
# A stage without a row works on numbers alone and may import NUMERIC; None: everything but the command line.
INTERNAL: dict[str, str | None] = {
    "judgement": "",
    "lean": "",
    "loaded": "",
    "nearest": "",
    "texts": "",
    "records": "judgement",
    "files": "records judgement nearest",
    "kinematics": "records",
    "features": "records texts",
    "touches": "records kinematics features",
    "terms": "records kinematics touches files.checked",
    "model": "records kinematics touches terms",
    "identify": "records texts kinematics touches terms model",
    "estimate": "records kinematics features touches terms model identify",
    "check": "records kinematics",
    "duration": "records gate",
    "gate": "records",
    "commission": "records gate plan kinematics duration locate",
    "astray": "records",
    "telling": "records check astray",
    "probe_length": "records kinematics",
    "locate": "records kinematics plan duration astray telling",
    "plan": "records kinematics check",
    "readback": "records kinematics check gate nearest",
    "program": "records files plan readback",
    "link": "records gate files plan duration program nearest",
    "design": f"{NUMERIC} plan check duration gate iso230 verify report.units plausible.planned",
    "noise": f"{NUMERIC} plausible",
    "plausible": f"{NUMERIC} asked",
    "judging": f"{NUMERIC} files asked noise plausible",
    "asked": "records kinematics files.shape",
    "uncertainty": f"{NUMERIC} files",
    "diagnose": f"{NUMERIC} files report",
    "verify": f"{NUMERIC} files iso230",
    "compensate": f"{NUMERIC} iso230 verify uncertainty files loaded state.frame plan duration design.order",
    "history": "records texts files state nearest",
    "nightly": f"{NUMERIC} files history state loaded "
    "report.age report.answer report.days report.decimals report.compensated report.units report.look report.repeated report.texts "
    "report.right report.suspects report.tonight report.words",
    "nc": f"{NUMERIC} files iso230 compensate",
    "instruments": f"{NUMERIC} files iso230 nearest",
    "acceptance": f"{NUMERIC} files iso230 judgement nc compensate plausible",
    "reproduce": f"{NUMERIC} files iso230 verify uncertainty diagnose report",
    "report": f"{NUMERIC} files iso230 verify uncertainty diagnose plan check judgement asked "
    "state.changes state.volume nearest history loaded",
    "state": f"{NUMERIC} verify iso230",
    "web": "records texts files history report loaded link.journal link.entries link.lock link.progress",
    "commands": None,
    "cli": "records commands nearest lean",
    "__main__": "cli",
}
# Packages beside tango_cnc, and who may import them.
POSTS_MAY = (
    "tango_cnc.records",
    "tango_cnc.nearest",
    "tango_cnc.gate",
    "tango_cnc.commission",
    "postprocessors",
)
SIMULATOR_MAY = ("tango_cnc.records", "tango_cnc.nearest", "tango_cnc.files", "sim_controller")
# The simulator is a program of its own; it ends with the same exit codes and sentences as `tango`.
EXCEPTIONS = {"sim_controller.__main__": ("tango_cnc.cli",)}
USED_BY = {
    "postprocessors": ("tango_cnc.commands", "tango_cnc.program", "postprocessors"),
    "sim_controller": ("tango_cnc.commands", "tango_cnc.reproduce", "sim_controller"),
}

# Third-party libraries beyond numpy and scipy, and the only modules that may import them.
LIBRARIES = {
    "yaml": ("tango_cnc.files", "tango_cnc.link.layout", "tango_cnc.commands", "tango_cnc.reproduce"),
    "click": ("tango_cnc.commands", "tango_cnc.cli", "sim_controller.__main__"),
    "serial": ("tango_cnc.link.transport", "sim_controller"),
    "trimesh": ("tango_cnc.files.hull",),
    "lupa": ("sim_controller.languages.mach4",),
    "pymodbus": ("tango_cnc.link.transport", "sim_controller"),
    "paramiko": ("tango_cnc.link.transport",),
    "asyncua": ("tango_cnc.link.transport",),
    "pyLSV2": ("tango_cnc.link.transport",),
    "matplotlib": ("tango_cnc.report", "tango_cnc.history", "tango_cnc.reproduce", "tango_cnc.commands", "tango_cnc.web"),
    "mpl_toolkits": ("tango_cnc.report", "tango_cnc.reproduce"),
    "jinja2": ("tango_cnc.report", "tango_cnc.web"),
    "markupsafe": ("tango_cnc.report", "tango_cnc.web"),
    "typst": ("tango_cnc.report.pdf", "tango_cnc.report.glyphs"),
    "starlette": ("tango_cnc.web",),
    "argon2": ("tango_cnc.web.users",),
    "uvicorn": ("tango_cnc.commands.serve", "tango_cnc.web.patience"),
    "h11": ("tango_cnc.web.patience",),
    "dask": ("tango_cnc.uncertainty",),
    "distributed": ("tango_cnc.uncertainty",),
    "sqlalchemy": ("tango_cnc.history",),
    "psycopg": ("tango_cnc.history._patience",),
    "alembic": ("tango_cnc.history",),
    "pyarrow": ("tango_cnc.history.exchange",),
    "paho": ("tango_cnc.nightly.notify", "tango_cnc.link.transport"),
    "apprise": ("tango_cnc.nightly.notify",),
}
# Clients know bytes and seconds as arguments; clock, port and file belong to the session around them.
TOUCHES_THE_WORLD = {
    *("asyncio", "fcntl", "os", "pathlib", "random", "secrets", "select", "socket", "ssl"),
    *("subprocess", "tempfile", "termios", "threading", "time"),
}
LINK_WITH_IO = {
    "aside",
    "transport",
    "session",
    "journal",
    "lock",
    "process",
    "measure",
    "follow",
    "layout",
    "nodes",
    "progress",
    "secrets",
    "sensors",
}
PURE = ("kinematics", "touches", "terms", "model", "identify", "estimate", "plan", "check", "readback", "duration")

# One function or record each, described where they stand.
SMALL = {"asked.py", "compare.py", "conformity.py", "segments.py", "judgement.py", "nearest.py", "py.typed"}


def imports(name: str, file: Path, known: dict[str, Path]) -> Iterator[str]:
    """Full names of the modules that a file imports, wherever in the file, `from . import x` spelt out."""
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    for node in import_statements(file):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                yield inner if inner in known or base == "tango_cnc" else base


def inside(name: str, packages: tuple[str, ...]) -> bool:
    return any(name == package or name.startswith(f"{package}.") for package in packages)


def complaints(name: str, imported: str) -> Iterator[str]:
    if inside(imported, EXCEPTIONS.get(name, ())):
        return
    top = imported.split(".")[0]
    if top == "tango_cnc" and inside(name, ("tango_cnc",)):
        own = name.removeprefix("tango_cnc").removeprefix(".")
        row = max((stage for stage in INTERNAL if inside(own, (stage,))), key=len, default=None)
        if own and imported not in ("tango_cnc", "tango_cnc.__version__"):
            row = row or own.split(".")[0]
            stages = INTERNAL.get(row, NUMERIC)
            allowed = stages is None or inside(imported, tuple(f"tango_cnc.{stage}" for stage in [row, *stages.split()]))
            if not allowed or (stages is None and inside(imported, ("tango_cnc.cli",))):
                yield f"{name} imports {imported}"
    elif top == "tango_cnc" and inside(name, ("postprocessors",)) and not inside(imported, POSTS_MAY):
        yield f"{name} imports {imported}"
    elif top == "tango_cnc" and inside(name, ("sim_controller",)) and not inside(imported, SIMULATOR_MAY):
        yield f"{name} imports {imported}: the simulator judges the product and shares no mathematics with it"
    elif top in USED_BY and not inside(name, USED_BY[top]):
        yield f"{name} imports {imported}"
    elif top in LIBRARIES and not inside(name, LIBRARIES[top]):
        yield f"{name} imports {imported}: {', '.join(LIBRARIES[top])} may"
    elif top not in {"tango_cnc", "postprocessors", "sim_controller", "numpy", "scipy", *LIBRARIES, *sys.stdlib_module_names}:
        yield f"{name} imports {imported}: a library that no row allows"
    if top in TOUCHES_THE_WORLD:
        stage, _, part = name.removeprefix("tango_cnc.").partition(".")
        client = stage == "link" and part and part.split(".")[0] not in LINK_WITH_IO
        if client or (name.startswith("tango_cnc.") and stage in PURE):
            yield f"{name} imports {imported}: clock, port, randomness and files are arguments there"


def test_every_import_is_in_the_table(root: Path) -> None:
    known = modules(root)
    found = [c for name, file in known.items() for i in imports(name, file, known) for c in complaints(name, i)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("name", "imported"),
    [
        ("tango_cnc.kinematics", "tango_cnc.estimate"),
        ("tango_cnc.records", "tango_cnc.files"),
        ("tango_cnc.plan.build", "tango_cnc.cli"),
        ("tango_cnc.commands.demo", "tango_cnc.cli"),
        ("tango_cnc.brandnew", "tango_cnc.link"),
        ("sim_controller.world", "tango_cnc.kinematics"),
        ("sim_controller.world", "postprocessors"),
        ("tango_cnc.estimate", "sim_controller.world"),
        ("postprocessors.fanuc", "tango_cnc.plan.build"),
        ("postprocessors.fanuc", "tango_cnc.plan.digest"),
        ("tango_cnc.link.protocols.grbl", "serial"),
        ("tango_cnc.link.protocols.dnc", "time"),
        ("tango_cnc.model", "random"),
        ("tango_cnc.model", "pandas"),
    ],
)
def test_the_table_can_refuse(name: str, imported: str) -> None:
    assert list(complaints(name, imported))


def test_what_windows_lacks_is_imported_where_it_is_used(root: Path) -> None:
    for name, file in modules(root).items():
        found = {
            alias.name
            for node in import_statements(file)
            if isinstance(node, ast.Import) and not node.col_offset
            for alias in node.names
        }
        assert not found & {"fcntl", "termios", "tty", "pty", "resource"}, name


def test_nothing_probes_for_what_a_plug_in_may_be_able_to_do(root: Path) -> None:
    """An ability has a default in the record or class that a plug-in fills. What a library or a system has may be asked for."""
    found = []
    for name, file in modules(root).items():
        for node in ast.walk(tree(file)) if "attr(" in file.read_text(encoding="utf-8") else ():
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
                continue
            asked = node.args[0].id if node.args and isinstance(node.args[0], ast.Name) else ""
            probes = node.func.id == "hasattr" or (node.func.id == "getattr" and len(node.args) == 3)
            if probes and asked not in ("os", "time", "yaml", "error"):
                found.append(f"{name}:{node.lineno}")
    assert not found, "\n".join(found)


def test_no_file_is_too_long_to_read(root: Path) -> None:
    lengths = {name: len(file.read_text(encoding="utf-8").splitlines()) for name, file in modules(root).items()}
    assert not {name: n for name, n in lengths.items() if n > 450}


def test_the_page_on_the_architecture_names_every_stage_and_fits_on_two_pages(root: Path) -> None:
    page = (root / "docs" / "architecture.md").read_text(encoding="utf-8")
    places = [place for place in (root / "tango_cnc").iterdir() if place.suffix in ("", ".py") and not place.name.startswith("_")]
    missing = [p.name for p in places if p.name not in SMALL and f"tango_cnc/{p.name}{'/' if p.is_dir() else ''}`" not in page]
    assert not missing, f"docs/architecture.md: add a row for {', '.join(missing)}"
    assert len(page.splitlines()) <= 82 and len(page.split()) <= 900  # two pages of A4, 9.5 pt


# Folders of plug-ins of which nobody but their own file may know one by name.
PLUG_INS = (
    "postprocessors",
    "tango_cnc/readback/languages",
    "tango_cnc/nc/languages",
    "tango_cnc/link/protocols",
    "tango_cnc/compensate/targets",
    "tango_cnc/terms",
    "sim_controller/languages",
    "sim_controller/protocols",
)
WORDS = {"backlash", "file", "iso230", "learned", "remote", "step"}  # these are words of the trade first: a constant says nothing
# Who names a plug-in all the same, and why. A plug-in may name others of its kind: the causes that it is taken for, its language.
KNOWN_BY_NAME = {
    "sim_controller.__main__": ("dnc", "where the mode of drip-feeding has the name of the protocol"),
    "sim_controller.session": ("macro_b", "what the simulated control is where nothing is asked"),
    "postprocessors._base": ("dnc", "what a post has that states nothing"),
    "tango_cnc.commands.link_test": ("dnc", "what is spoken where a cell has no post"),
    "tango_cnc.commands._export_isg": ("etalon", "the former name of a target, for files that call it so"),
    "tango_cnc.commands._budget": ("indexation_seating", "a source of uncertainty.yaml, not the cause"),
    "tango_cnc.capability.analysis": ("probe_lobing surface_form", "writes entries of world.yaml"),
    "tango_cnc.reproduce._setting": ("thermal_drift probe_lobing surface_form", "the disturbances that the thesis states"),
    "tango_cnc.reproduce.unexplained": ("thermal_drift probe_lobing surface_form", "the disturbances that the thesis states"),
    "tango_cnc.plausible.groups": ("chip", "a remark of that kind, which no cause is asked for"),
    "tango_cnc.nc.blocks": ("klartext macro_b rs274 siemens", "tells languages apart by their text"),
    "tango_cnc.link._grbl_control": ("grbl", "how the control greets"),
    "tango_cnc.link.transport._lsv2": ("lsv2", "the scheme of its addresses, and the extra to install"),
    "tango_cnc.link.transport._opcua": ("opcua", "the scheme of its addresses, and the extra to install"),
    "tango_cnc.state.changes": ("axis_location noise_level", "causes of alarms on record"),
    "tango_cnc.nightly.alarms": ("axis_location noise_level", "causes of alarms on record"),
    "tango_cnc.nightly.answered": ("noise_level", "causes of alarms on record"),
}


def by_name(root: Path) -> Iterator[tuple[str, str, int]]:
    """→ module, plug-in that a constant of it names, line."""
    places = [place for folder in PLUG_INS for place in (root / folder).iterdir()]
    found = {place.stem for place in places if not place.name.startswith("_") and (place.is_dir() or place.suffix == ".py")}
    quoted = re.compile(f'"({"|".join(sorted(found - WORDS))})"')
    plug_ins = [root / folder for folder in PLUG_INS]
    for name, file in modules(root).items():
        text = file.read_text(encoding="utf-8")
        own = not file.name.startswith("_") and any(folder in file.parents for folder in plug_ins)
        names = set() if own else set(quoted.findall(text)) - set(name.split("."))
        for node in ast.walk(tree(file)) if names else ():
            if isinstance(node, ast.Constant) and node.value in names:
                yield name, str(node.value), node.lineno


def test_no_plug_in_is_known_by_name_outside_its_own_file(root: Path) -> None:
    """What is special about one is a field of the record that its file fills: `filed` of a post, `both_ways` of a cause."""
    once = list(by_name(root))
    allowed = {(module, plug_in) for module, (names, _) in KNOWN_BY_NAME.items() for plug_in in names.split()}
    wrong = [f"{name}:{line}: {plug_in!r}" for name, plug_in, line in once if (name, plug_in) not in allowed]
    assert not wrong, (
        "state it in a field of the plug-in's record; where the word means something else there, give the plug-in's file another "
        "name, or list it in KNOWN_BY_NAME of this test with a reason:\n" + "\n".join(wrong)
    )
    needless = allowed - {(name, plug_in) for name, plug_in, _ in once}
    assert not needless, f"KNOWN_BY_NAME: no longer needed: {sorted(needless)}"


def test_a_word_of_the_glossary_is_one_class(root: Path) -> None:
    """The simulated control has words of its own; a client of a link is one class a protocol."""
    page = (root / "docs" / "glossary.md").read_text(encoding="utf-8")
    words = {word.title() for word in re.findall(r"^\| (\w+) \|", page, re.MULTILINE)} - {"Client"}
    held: dict[str, list[str]] = {}
    for name, file in modules(root).items():
        for found in re.findall(r"^class (\w+)", file.read_text(encoding="utf-8"), re.MULTILINE):
            if found in words and not name.startswith("sim_controller"):
                held.setdefault(found, []).append(name)
    assert {"Machine", "Run", "Verdict", "Finding"} & held.keys(), "no class has a word of the glossary"
    twice = {word: names for word, names in held.items() if len(names) > 1}
    assert not twice, f"one of them needs another name: {twice}"


PRIVATE = 114  # statements; tests of several files get what they need through `tests/support/`. This number only falls.


def test_tests_ask_for_what_is_public(root: Path) -> None:
    """Statements of tests that import a module or name with `_` in front. What is asked through a public function stays asked."""
    found = []
    for file in sorted((root / "tests").rglob("*.py")):
        for node in import_statements(file):
            if not isinstance(node, ast.ImportFrom) or not str(node.module).startswith(
                ("tango_cnc", "postprocessors", "sim_contr")
            ):
                continue
            if any(re.search(r"\._[a-z]|\._[A-Z]", f"{node.module}.{alias.name}") for alias in node.names):
                found.append(str(file.relative_to(root)))
    assert len(found) <= PRIVATE, f"{len(found)} private imports; the most in {sorted(found, key=found.count)[-1]}"
    assert len(found) > PRIVATE - 10, f"PRIVATE is {len(found)} now"


def of_tests(node: ast.AST) -> Iterator[str]:
    """A part of a file → the names of tests that it imports, by a statement or by `import_module`."""
    names: list[str] = []
    if isinstance(node, ast.Import):
        names = [alias.name for alias in node.names]
    elif isinstance(node, ast.ImportFrom):
        names = [f"{node.module or ''}.{alias.name}" for alias in node.names]
    elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("import_module", "__import__")):
        names = [str(word.value) for word in node.args if isinstance(word, ast.Constant)]
    yield from (found[0] for name in names if (found := re.search(r"(?<![^.])test_\w+", name)))


def test_no_test_imports_a_test(root: Path) -> None:
    """A test that is changed changes no other one, and who looks for a helper has one place to look."""
    found = []
    for file in sorted([*(root / "tests").rglob("*.py"), *(root / "benchmarks").glob("*.py")]):
        calls = re.search(r"import_module\(|__import__\(", file.read_text(encoding="utf-8"))
        parts = ast.walk(tree(file)) if calls else import_statements(file)
        found += [f"{file.relative_to(root)} imports {name}" for node in parts for name in of_tests(node)]
    assert not found, "move what both need into a module of tests/support/ that is named for what it holds:\n" + "\n".join(found)


@pytest.mark.parametrize(
    ("statement", "name"),
    [
        ("from test_bodies import YOKE", "test_bodies"),
        ("    import test_bodies as other", "test_bodies"),
        ("from tests.test_bodies import YOKE", "test_bodies"),
        ("from . import test_bodies", "test_bodies"),
        ("from .contracts.test_posts import golden", "test_posts"),
        ('importlib.import_module("test_bodies")', "test_bodies"),
        ("from support.runs import latest_test_of", ""),
        ("from tango_cnc.commands.link_test import told", ""),
    ],
)
def test_an_import_of_a_test_is_seen(statement: str, name: str) -> None:
    assert [one for node in ast.walk(ast.parse(statement.strip())) for one in of_tests(node)] == ([name] if name else [])


def test_what_is_committed_is_ordinary_files(root: Path) -> None:
    """A link points to a place of one machine: a `.venv` that was one stopped every installation from a fresh clone."""
    if not (root / ".git").exists():
        pytest.skip("not a clone: nothing here is committed")
    stated = subprocess.run(["git", "ls-files", "--stage"], cwd=root, check=True, capture_output=True, text=True).stdout
    kinds = {line.split("\t")[1]: line.split()[0] for line in stated.splitlines()}
    assert len(kinds) > 1000, "git lists hardly any file"
    other = {name: kind for name, kind in kinds.items() if kind not in ("100644", "100755")}
    assert not other, f"neither a file nor a program: {other}"
