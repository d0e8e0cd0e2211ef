"""Files of code that a cell names: none runs before the user has trusted it, this text of it, on this computer.

A post of one's own is Python. A cell that came by mail, from a share or a stick may name one, and `tango check` is the first
thing that anybody does with it. What is trusted is kept outside every cell, by hash: a file that was changed is asked about again.
Modules that it imports from its own folder count with it. What it loads in other ways (importlib, exec, another folder) does not.
"""

from __future__ import annotations

import ast
import hashlib
import os
import sys
from pathlib import Path

import click

from ..files.checked import read_text
from ..records import InputError
from ._handed import pasted

MOST = 200  # modules of one post
RUN = (".py", ".pyc", ".so", ".pyd", ".pth")  # what Python may run for a name


def kept() -> Path:
    """→ the file with the hashes of what this user trusts."""
    return Path(click.get_app_dir("tango")) / "trusted-posts.txt"


def parts(file: Path) -> list[Path]:
    """file of code → itself, then every module that it, or one of these, imports from beside itself.

    Raises InputError when one cannot be read, or there are more than `MOST`.
    """
    found = [file]
    for one in found:
        for module in _imported(one, file.parent) if one.suffix == ".py" else ():
            if module not in found:
                found.append(module)
        if len(found) > MOST:
            raise InputError(f"{file}: found more than {MOST} modules that it imports from beside itself; allowed: at most {MOST}")
    return found


def _imported(file: Path, top: Path) -> list[Path]:
    """module, folder of the post → files beside that its import statements may mean, at its top and within functions alike."""
    try:
        tree = ast.parse(read_text(file))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return []  # it cannot be run either
    names: set[tuple[Path, str]] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {(folder, name.name) for name in node.names for folder in (top, file.parent)}
        elif isinstance(node, ast.ImportFrom):
            up = [file.parent, *file.parent.parents][node.level - 1 : node.level] if node.level else [top, file.parent]
            stem = node.module or ""
            names |= {(folder, f"{stem}.{name.name}".strip(".")) for name in node.names for folder in up} | {(u, stem) for u in up}
    found = [module for folder, name in sorted(names) for module in _files(folder, name)]
    return list(dict.fromkeys(found))


def _files(folder: Path, name: str) -> list[Path]:
    """folder, dotted name → the files that Python would run for it: packages on the way, the module, its compiled forms."""
    found: list[Path] = []
    for part in filter(None, name.split(".")):
        if not os.path.isdir(folder):  # False, too, for a name that no folder can have
            break
        found += sorted(f for f in folder.iterdir() if f.name.split(".")[0] == part and f.suffix in RUN and f.is_file())
        folder = folder / part
        if os.path.isdir(folder):
            found += sorted(f for f in folder.iterdir() if f.name.split(".")[0] == "__init__" and f.suffix in RUN and f.is_file())
    return found


def digest(file: Path) -> str:
    """file of code → the hash of its text and of the modules beside it. Raises InputError when one cannot be read."""
    own, *others = parts(file)
    found = hashlib.sha256(read_text(own).encode())
    for module in others:
        try:
            data = module.read_bytes()
        except OSError as error:
            raise InputError(f"{module}: cannot be read ({error.strerror}); {file} imports it") from None
        found.update(f"\0{module.relative_to(file.parent)}\0{len(data)}\0".encode(errors="surrogateescape") + data)
    return found.hexdigest()


def _listed(file: Path) -> str:
    others = [str(module.relative_to(file.parent)) for module in parts(file)[1:]]
    return f" with {', '.join(others)}" if others else ""


def known(file: Path) -> bool:
    """file of code → whether this text of it is trusted."""
    try:
        lines = kept().read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return False
    return digest(file) in {line.split(" ", 1)[0] for line in lines}


def trust(file: Path) -> None:
    """file of code → trusted from now on. Raises InputError when that cannot be kept."""
    where = kept()
    line = f"{digest(file)} {file.absolute()}\n"
    try:
        where.parent.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(where, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600), "a", encoding="utf-8") as out:
            out.write(line)
    except OSError as error:
        raise InputError(f"{where}: cannot be written ({error.strerror}), so {file} is not trusted") from None


def needed(file: Path) -> None:
    """file of code that is about to be run → the user trusts it. Asks at a terminal. Raises InputError elsewhere and after a no."""
    sys.pycache_prefix = str(kept().parent / "pycache")  # a compiled file in the cell would run instead of the text that was read
    if not file.is_file() or known(file):
        return
    short = digest(file)[:12]
    if sys.stdin is not None and sys.stdin.isatty():
        click.echo(f"{file}{_listed(file)} (SHA-256 {short}…) is a program. It runs with all your rights. Read it first.", err=True)
        if click.confirm("Do you trust it?", default=False, err=True):
            trust(file)
            return
    raise InputError(
        f"{file}{_listed(file)}: this post is a program (SHA-256 {short}…), and you have not trusted it; nothing of it was run. "
        f"Read it, then 'tango trust {pasted(file)}'"
    )
