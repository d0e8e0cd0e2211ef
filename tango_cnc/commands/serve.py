"""`tango serve`: pages for a browser: fleet, machine, night, run, trend, decisions."""

from __future__ import annotations

import ipaddress
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from ..records import InputError
from ._beside import alone, beside
from ._common import cells_in, folders_option

FILES = 65_536
PLACE = "Keep 60"  # in the list of commands


@click.command()
@folders_option
@click.option(
    "--history", metavar="FILE|URL", help="One history for all machines [default: that of each cell: history of nightly.yaml]."
)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--port", type=click.IntRange(0, 65535), default=8026, show_default=True, help="Port to listen on.")
@click.option("--name", "names", multiple=True, help="Name that browsers call this server by, e.g. calibration.shop.local.")
@click.option(
    "--users", type=click.Path(path_type=Path), metavar="FILE", help="Users who may sign in. Without it, the pages are read-only."
)
@alone("-C", "--users", "--role")("--add-user", metavar="NAME", help="Add a user to --users (or give a new password), and end.")
@alone("-C", "--users")("--remove-user", metavar="NAME", help="Take a user out of --users, whose sign-ins end, and end.")
@beside("--add-user")(
    "--role", type=click.Choice(["view", "operate", "write-back"]), default="view", show_default=True, help="With --add-user."
)
@click.option("--certificate", type=click.Path(path_type=Path), metavar="FILE", help="TLS certificate (PEM).")
@click.option("--key", type=click.Path(path_type=Path), metavar="FILE", help="Its private key (PEM).")
@click.option("--behind-proxy", is_flag=True, help="A proxy on this computer speaks TLS to the browsers.")
@click.option(
    "--late-hours", type=click.FloatRange(1), default=36.0, show_default=True, help="A machine without a night for longer is late."
)
@click.option("--unit", type=click.Choice(["mm", "inch"]), default="mm", show_default=True, help="mm and µm, or inch and µin.")
@click.option(
    "--templates", type=click.Path(path_type=Path), metavar="DIR", help="Templates and texts.toml of your own (docs/report.md)."
)
def command(
    folders: tuple[Path, ...],
    history: str | None,
    host: str,
    port: int,
    names: tuple[str, ...],
    users: Path | None,
    add_user: str | None,
    remove_user: str | None,
    role: str,
    certificate: Path | None,
    key: Path | None,
    behind_proxy: bool,
    late_hours: float,
    unit: str,
    templates: Path | None,
) -> None:
    """Shows machines in a browser: what every night found, a run as it goes on, trends, reports, and what was decided.

    Only this computer can reach it, and nothing can be changed, unless users and an address are given. Ctrl-C ends it.
    """
    try:
        import uvicorn

        from ..web import users as accounts
        from ..web.app import create
        from ..web.listening import listening
        from ..web.patience import Patient
        from ..web.settings import LOOPBACK, Settings
        from ..web.tls import checked
    except ImportError as error:
        raise InputError(f"tango serve: {error.name} is not installed; pip install 'tango-cnc[web]'") from None
    if add_user is not None:
        if users is None:
            raise InputError("--add-user: found no --users; allowed: together with --users FILE")
        _add(accounts, users, add_user, role)
        return
    if remove_user is not None:
        if users is None:
            raise InputError("--remove-user: found no --users; allowed: together with --users FILE")
        accounts.remove_user(users, remove_user)
        click.echo(f"{remove_user}: not in {users} any more")
        return
    local = _is_loopback(host)
    tls = certificate is not None or behind_proxy
    if (certificate is None) != (key is None):
        raise InputError("--certificate and --key: found one without the other; allowed: both, or none")
    if not local and users is None:
        raise InputError(
            f"--host: found {host}, which others can reach, and no --users; allowed: with users, or 127.0.0.1 (docs/serve.md)"
        )
    if not local and certificate is None:
        raise InputError(
            f"--host: found {host} without TLS: passwords would go over the network in clear. State --certificate and --key, or "
            "leave --host at 127.0.0.1 and use --behind-proxy (docs/serve.md)"
        )
    for file in (certificate, key):
        if file is not None and not file.is_file():
            raise InputError(f"{file}: no such file; allowed: a PEM file")
    if certificate is not None and key is not None:
        checked(certificate, key)

    def find() -> tuple[Path, ...]:
        return tuple(cell for folder in folders or (Path("."),) for cell in cells_in(folder))

    cells = find()
    if not cells and history is None:
        raise InputError(
            f"{', '.join(map(str, folders)) or '.'}: found no cell; allowed: a folder with tango.yaml, or one of such folders"
        )
    called = tuple(dict.fromkeys((*LOOPBACK, *(() if host in ("0.0.0.0", "::") else (host,)), *names)))
    settings = Settings(cells, history, users, called, tls, late_hours, templates, find, behind_proxy=behind_proxy)
    app = create(settings)
    if unit == "inch":
        from ..report.units import Units

        app.state.tango.units = Units("inch")
    _more_files()
    taken = listening(host, port)
    port = taken.getsockname()[1]
    count = f"{len(cells)} cell{'s' if len(cells) != 1 else ''}" + (f", history {_hidden(history)}" if history else "")
    mode = "read-only" if users is None else f"users of {users}"
    click.echo(f"http{'s' if certificate else ''}://{host}:{port}/ shows {count}; {mode}. Ctrl-C ends it.{_once(templates)}")
    extra: dict[str, Any] = {}
    if certificate is not None and key is not None:
        extra = {"ssl_certfile": str(certificate), "ssl_keyfile": str(key)}
    config = uvicorn.Config(
        app,
        http=Patient,
        log_level="warning",
        server_header=False,
        proxy_headers=behind_proxy,
        forwarded_allow_ips="127.0.0.1",
        limit_concurrency=500,
        timeout_keep_alive=15,
        h11_max_incomplete_event_size=16384,
        **extra,
    )
    with taken, suppress(KeyboardInterrupt):  # Ctrl-C is the way to end it
        uvicorn.Server(config).run(sockets=[taken])


def _once(templates: Path | None) -> str:
    """folder of a shop with templates and texts or None → that they are read once."""
    if templates is None:
        return ""
    return f"\ntemplates and texts of {templates} were read just now: restart the server after you change one"


def _add(accounts: Any, users: Path, name: str, role: str) -> None:
    accounts.check_name(name)  # before anybody types a password twice
    password = click.prompt("Password", hide_input=True, confirmation_prompt=True)
    accounts.add_user(users, name, password, role)
    click.echo(f"{name}, {role} → {users}")


def _more_files() -> None:
    """As many open files as the system allows: a cell with a history of its own needs three, a connection one."""
    with suppress(ImportError, ValueError, OSError):  # Windows has no such limit
        import resource

        most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
        resource.setrlimit(resource.RLIMIT_NOFILE, (most if 0 < most < FILES else FILES, most))


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _hidden(history: str) -> str:
    """URL → the same without its password."""
    head, at, tail = history.rpartition("@")
    return f"{head.partition('://')[0]}://…@{tail}" if at else history
