"""A PostgreSQL server of its own, Debian's, as long as the tests that need it."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def programs() -> Path:
    """→ folder of the newest installed server. Raises FileNotFoundError."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda p: float(p.parent.name))
    if not found:
        raise FileNotFoundError("no PostgreSQL server; apt install postgresql")
    return found[-1]


@contextmanager
def server() -> Iterator[str]:
    """→ URL of the server, to which the name of a database is added. Root starts it as the user postgres, as it refuses root."""
    folder = Path(tempfile.mkdtemp(prefix="tango-postgres-"))
    lead = ["runuser", "-u", "postgres", "--"] if os.name == "posix" and os.geteuid() == 0 else []
    if lead:
        shutil.chown(folder, "postgres", "postgres")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    bin_, data = programs(), folder / "data"

    def run(*command: str) -> None:
        subprocess.run([*lead, *command], check=True, stdout=subprocess.DEVNULL, cwd="/")

    try:
        run(str(bin_ / "initdb"), "-D", str(data), "-U", "tango", "--auth=trust", "-E", "UTF8", "--no-sync")
        options = f"-p {port} -k {folder} -c listen_addresses=127.0.0.1"
        run(str(bin_ / "pg_ctl"), "-D", str(data), "-l", str(folder / "log"), "-w", "-o", options, "start")
        try:
            yield f"postgresql://tango@127.0.0.1:{port}"
        finally:
            run(str(bin_ / "pg_ctl"), "-D", str(data), "-m", "immediate", "-w", "stop")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def database(url: str) -> str:
    """URL of a server → URL of a new, empty database."""
    import psycopg

    name = f"t{uuid.uuid4().hex[:12]}"
    with psycopg.connect(f"{url}/postgres", autocommit=True) as connection:
        connection.execute(f'CREATE DATABASE "{name}"')
    return f"{url}/{name}"
