"""Programs and results to download: the files that a cell is known to have, by their names in a list."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from ...report.days import at
from ..app import machine_of, needs, page, role_of, state_of
from ..settings import may
from .machine import answer_today, run_of, simulated

OWN = (
    "report.html",
    "report.inch.html",
    "report.mm.html",
    "report.pdf",
    "readings.csv",
    "readings.json",
    "estimate.json",
    "commissioning.yaml",
)
FOLDERS = ("program", "compensations")
MOST = 500


def offered(folder: Path) -> dict[str, Path]:
    """cell → {name in the address: file}; links that lead out of the cell are not there."""
    root = folder.resolve()
    files = [root / name for name in OWN]
    for name in FOLDERS:
        files += sorted(f for pattern in ("*", "*/*", "*/*/*") for f in (root / name).glob(pattern))[:MOST]
    found = {}
    for file in files:
        real = file.resolve()
        if real.is_file() and real.is_relative_to(root) and not file.name.startswith("."):
            found[file.relative_to(root).as_posix()] = real
    return found


def files(request: Request) -> Response:
    """request → the list."""
    needs(request, "view")
    found = machine_of(request)
    rows = []
    for name, file in (offered(found.folder) if found.folder is not None else {}).items():
        stat = file.stat()
        changed = at(datetime.fromtimestamp(stat.st_mtime, UTC).isoformat(), state_of(request).texts)
        rows.append((name, f"{stat.st_size / 1000:,.1f} kB", changed))
    run = run_of(state_of(request), found)
    made_up = simulated(request, found) or (run is not None and run.simulated)
    programs, locked = (any(name.startswith(f"{folder}/") for name, _, _ in rows) for folder in FOLDERS)
    return page(
        request,
        "files.html",
        machine=found,
        rows=rows,
        may_write=_may_write(request),
        simulated=made_up,
        today=answer_today(request, found),
        programs=programs,
        locked=locked and not _may_write(request),
    )


def file(request: Request) -> Response:
    """request → one file, to be saved and never to be shown."""
    needs(request, "view")
    found = machine_of(request)
    name = str(request.path_params["name"])
    path = offered(found.folder).get(name) if found.folder is not None else None
    if path is None:
        raise HTTPException(404)
    if name.startswith("compensations/") and not _may_write(request):
        needs(request, "write-back")
    return FileResponse(path, media_type="application/octet-stream", filename=path.name, content_disposition_type="attachment")


def _may_write(request: Request) -> bool:
    return may(role_of(request), "write-back")


ROUTES = [
    Route("/machine/{slug}/files", files, name="files"),
    Route("/machine/{slug}/files/{name:path}", file, name="file"),
]
