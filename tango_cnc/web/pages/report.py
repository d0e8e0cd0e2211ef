"""The report of a cell or of a night as it was written: shown in a sandbox, since its file may be anything."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from ..app import machine_of, needs, page
from ..places import Machine

SANDBOX = "sandbox allow-scripts; default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
NAMES = ("report.html", "morning.html")


def report(request: Request) -> Response:
    """request → the report of the cell, or a page that says how to write one."""
    needs(request, "view")
    found = machine_of(request)
    file = None if found.folder is None else found.folder / "report.html"
    if file is None or not file.is_file():
        return page(request, "no_report.html", 404, machine=found)
    return sandboxed(file)


def of_night(request: Request) -> Response:
    """request → a page that the night wrote."""
    needs(request, "view")
    from .night import record_of

    found = machine_of(request)
    record = record_of(found, int(request.path_params["entry"]))
    file = file_of_night(found, record, str(request.path_params["name"]))
    if file is None:
        raise HTTPException(404)
    return sandboxed(file)


def sandboxed(file: Path) -> FileResponse:
    """file → answer that a browser shows without any right on this server: no cookie, no request, no form."""
    return FileResponse(file, media_type="text/html", headers={"content-security-policy": SANDBOX})


def file_of_night(machine: Machine, record: Mapping[str, Any], name: str) -> Path | None:
    """machine, record, name of a page → its file, None where it is not there or not in the folder of the cell."""
    folder = (record.get("artefacts") or {}).get("folder")
    if machine.folder is None or not isinstance(folder, str) or name not in NAMES:
        return None
    root = machine.folder.resolve()
    file = (root / folder / name).resolve()
    return file if file.is_relative_to(root) and file.is_file() else None


ROUTES = [
    Route("/machine/{slug}/report", report, name="report"),
    Route("/machine/{slug}/night/{entry:int}/{name}", of_night, name="night_file"),
]
