"""Files of code that a cell names: none runs before the user has trusted it, this text of it, on this computer.

A post of one's own is Python. A cell that came by mail, from a share or a stick may name one, and `tango check` is the first
thing that anybody does with it. What is trusted is kept outside every cell, by hash: a file that was changed is asked about again.
"""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path

import click

from ..files.checked import read_text
from ..records import InputError


def kept() -> Path:
    """→ the file with the hashes of what this user trusts."""
    return Path(click.get_app_dir("tango")) / "trusted-posts.txt"


def digest(file: Path) -> str:
    """file of code → the hash of its text. Raises InputError when it cannot be read."""
    return hashlib.sha256(read_text(file).encode()).hexdigest()


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
    if not file.is_file() or known(file):
        return
    short = digest(file)[:12]
    if sys.stdin is not None and sys.stdin.isatty():
        click.echo(f"{file} (SHA-256 {short}…) is a program. It runs with all your rights. Read it first.", err=True)
        if click.confirm("Do you trust it?", default=False, err=True):
            trust(file)
            return
    raise InputError(
        f"{file}: this post is a program (SHA-256 {short}…), and you have not trusted it; nothing of it was run. "
        f"Read it, then 'tango trust {file}'"
    )
