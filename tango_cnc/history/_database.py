"""A file name or URL → an engine whose schema is that of this version."""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path
from typing import Any
from urllib.parse import quote

from sqlalchemy import Connection, Engine, create_engine, event, inspect, text
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, NoSuchModuleError, OperationalError, StatementError

from ..files.checked import printable
from ..files.environment import filled
from ..records import InputError, LinkError
from ._patience import patient

HEAD = "0003"
SILENT = 10  # s in which a server has to take a connection
PATIENT = 120.0  # s for which it may be silent then
WAIT = 30  # s that a writer waits for another one
ALLOWED = "the name of an SQLite file, or postgresql://user:${NAME}@host/database, NAME of a variable of the environment"
REFUSED = ("authentication", "password", "role ")  # in what PostgreSQL says when it is the user who is wrong


def connect(where: str | Path, create: bool = True, patience: float | None = None) -> Engine:
    """file name, or URL of sqlite or postgresql, whether a file is made, s for which somebody waits for a server who asks again and
    again (None: a command, which waits for longer) → engine, schema of this version.

    Raises InputError for what is no such place, LinkError where the database does not answer.
    """
    url = _url(where)
    file = None
    if url.get_backend_name() == "sqlite" and url.database not in (None, "", ":memory:"):
        file = Path(str(url.database))
        if not file.exists():
            if not create:
                raise InputError(f"{file}: no such history; 'tango nightly' makes one, or name another with --history")
            if not file.parent.is_dir():
                raise InputError(f"{file}: no such folder {file.parent}; make it first, or name another history")
    fixed = file is not None and file.exists() and not writable(file)
    if fixed and file is not None:
        url = _read_only(url, file)
    try:
        engine = create_engine(url, **_how(url, patience))
    except (NoSuchModuleError, ModuleNotFoundError) as error:
        raise InputError(f"history: no driver for {url.drivername} ({error}); pip install 'tango-cnc[postgres]'") from None
    if url.get_backend_name() == "sqlite":
        event.listen(engine, "connect", _kept if fixed else _durable)
        event.listen(engine, "begin", _begin)
    else:
        patient(engine, patience or PATIENT, patience is not None)
    try:
        _migrate(engine)
    except BaseException as error:
        engine.dispose()  # else a file that was refused stays open and locked
        where = f"history {url.render_as_string()}"
        if isinstance(error, OperationalError):
            raise LinkError(f"{where}: {first_line(error)}; {_look_at(error)}") from None
        if isinstance(error, OSError):  # the folder of a new file
            raise LinkError(f"{where}: {error.strerror or error}; is there room on its disk, and may this user write?") from None
        if isinstance(error, DBAPIError | UnicodeDecodeError):  # names in a damaged schema are no text
            raise InputError(f"{where}: {first_line(error)}; found no history of tango_cnc there") from None
        raise
    return engine


def _how(url: URL, patience: float | None) -> dict[str, Any]:
    """URL of a database, s for which a page waits (None: none does) → how it is connected to: nobody waits for minutes for a server
    that does not answer, and a connection that a restart of it has ended is made anew.
    """
    if url.get_backend_name() == "sqlite":
        return {"connect_args": {"timeout": WAIT}}
    stated = "connect_timeout" in url.query or "PGCONNECT_TIMEOUT" in os.environ
    return {"pool_pre_ping": True} | ({} if stated else {"connect_args": {"connect_timeout": round(patience or SILENT)}})


def refused(error: Exception) -> bool:
    """what a database has said → whether it does not take this user."""
    return any(word in str(error) for word in REFUSED)


def _look_at(error: OperationalError) -> str:
    """what the database refused → what a person looks at."""
    if error.orig is not None and refused(Exception(error.orig)):
        return "are user and password right? In the URL ${NAME} is a variable of the environment; PGPASSWORD and ~/.pgpass do too"
    return "is the database there, is there room on its disk, and may this user write?"


def _unset(name: str) -> InputError:
    return InputError(
        f"history: found ${{{name}}}, and the environment has no variable of this name; allowed: set it, for a timer in "
        "nights/timer/environment of the cell"
    )


def writable(file: Path) -> bool:
    """file of a history → whether SQLite may write it and, beside it, what it needs while it is open."""
    return os.access(file, os.W_OK) and os.access(file.parent, os.W_OK)


def _read_only(url: URL, file: Path) -> URL:
    """→ URL of a file that nobody writes here. Raises LinkError where its newest entries are still in the file beside it."""
    beside = file.with_name(file.name + "-wal")
    if beside.exists() and beside.stat().st_size:
        raise LinkError(
            f"history {file}: it cannot be written here, and its newest nights are in {beside.name}, which cannot be read without; "
            "open it once where it can be written ('tango history list'), or copy both files to such a place"
        )
    return url.set(database=file.resolve().as_uri(), query={"mode": "ro", "immutable": "1", "uri": "true"})


def _url(where: str | Path) -> Any:
    if isinstance(where, Path) or "://" not in where:
        return make_url("sqlite://").set(database=str(where))
    try:
        url = make_url(filled(where, lambda word: quote(word, ""), _unset))
    except ArgumentError:
        raise InputError(f"history: found {shown(where)!r}; allowed: {ALLOWED}") from None
    if url.drivername in ("postgresql", "postgres"):
        url = url.set(drivername="postgresql+psycopg")
    if url.get_backend_name() not in ("sqlite", "postgresql"):
        raise InputError(f"history: found {shown(where)!r}; allowed: {ALLOWED}")
    return url


def shown(where: str | Path) -> str:
    """file name or URL of a history → the same for people: no password in it."""
    return re.sub(r"(://[^/?#:@]*):.*@", r"\1:***@", str(where))


def first_line(error: Exception) -> str:
    """error → the first line of what the database itself said, where it said something."""
    own = error.orig if isinstance(error, StatementError) else None
    return str(own or error).strip().splitlines()[0]


def _durable(connection: Any, _: Any) -> None:
    """A commit is on the disk before it returns; readers do not wait for a writer (sqlite.org/wal.html, pragma synchronous)."""
    connection.isolation_level = None  # BEGIN is said below: the driver would begin only before the first change
    cursor = connection.cursor()
    cursor.execute("PRAGMA journal_mode=WAL")
    cursor.execute("PRAGMA synchronous=FULL")
    cursor.execute("PRAGMA foreign_keys=ON")
    cursor.close()


def _kept(connection: Any, _: Any) -> None:
    """A file that only is read needs no rule about writing."""
    connection.isolation_level = None


def _begin(connection: Connection) -> None:
    if connection.get_execution_options().get("writes"):
        connection.exec_driver_sql("BEGIN IMMEDIATE")
        return
    # Straight to the driver: every read begins so and waits for nobody, and a statement of its own would cost as much as the read.
    cursor = connection.connection.cursor()
    cursor.execute("BEGIN")
    cursor.close()


def _migrate(engine: Engine) -> None:
    with engine.connect() as connection:
        if _version(connection) == HEAD:
            return
    # Alembic takes a tenth of a second to import: only where there is something to do.
    from alembic import command
    from alembic.config import Config
    from alembic.script import ScriptDirectory

    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations"))
    config.set_main_option("path_separator", "os")
    with engine.connect().execution_options(writes=True) as connection, connection.begin():
        if engine.dialect.name == "postgresql":  # two programs at once: one migrates, the other finds it done
            connection.execute(text("SELECT pg_advisory_xact_lock(7235001)"))
        found = _version(connection)
        known = {step.revision for step in ScriptDirectory.from_config(config).walk_revisions()}
        if found is not None and found not in known:
            named = printable(repr(found), 40)
            raise InputError(
                f"history: its schema is {named}, of a newer version of tango_cnc; allowed: up to {HEAD!r}. Install that version"
            )
        config.attributes["connection"] = connection
        command.upgrade(config, "head")
    if engine.dialect.name == "sqlite" and engine.url.database not in (None, "", ":memory:"):
        _keep_name(Path(str(engine.url.database)))


def _version(connection: Connection) -> str | None:
    if not inspect(connection).has_table("alembic_version"):
        return None
    found = connection.execute(text("SELECT version_num FROM alembic_version")).scalar()
    return None if found is None else str(found)


def _keep_name(file: Path) -> None:
    """Makes the name of a new file survive a power cut."""
    if os.name == "posix" and stat.S_ISDIR(os.stat(file.parent).st_mode):
        handle = os.open(file.parent, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
