"""The report of a cell or of a night as it was written: shown in a sandbox, since its file may be anything.

A page of the server frames it, with the way back to the machine; alone it is for printing and keeping.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from ...report.newer import report_of
from ..app import machine_of, needs, page, state_of
from ..guard import POLICY
from ..served import Served

SANDBOX = (
    "sandbox allow-scripts; default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; "
    "form-action 'none'; frame-ancestors 'self'; base-uri 'none'"
)
NAMES = ("report.html", "morning.html")
OF_ANY_NIGHT = {"end_utc": "0000", "simulated": True}  # every complete run is newer: it is held against the report alone
PAIR = 120.0  # s within which one command writes the report in both units


def report(request: Request) -> Response:
    """request → a page around the report of the cell, or one that says how to write it."""
    needs(request, "view")
    found = machine_of(request)
    from .machine import answer_today, simulated

    made_up = simulated(request, found)
    if file_of_cell(found) is None:
        ran = found.folder is not None and (found.folder / "readings.csv").is_file()
        return page(request, "no_report.html", 404, machine=found, ran=ran, simulated=made_up, today=answer_today(request, found))
    return _framed(request, found, "", "", made_up)


def report_alone(request: Request) -> Response:
    """request → the report of the cell, as its file is. Raises HTTPException 404."""
    needs(request, "view")
    return sandboxed(file_of_cell(machine_of(request), state_of(request).units.system))


def of_night(request: Request) -> Response:
    """request → a page around one that the night wrote. Raises HTTPException 404."""
    found, record, name = _asked(request)
    unit = state_of(request).units.system
    if (file := file_of_night(found, record, name, unit)) is None:
        raise HTTPException(404)
    kept = unit == "inch" and file.name == name == "morning.html"  # no night before has written it in both units
    back = f"/machine/{found.slug}/night/{request.path_params['entry']}"
    return _framed(request, found, str(record.get("night") or ""), back, bool(record.get("simulated")), kept)


def of_night_alone(request: Request) -> Response:
    """request → a page that the night wrote, as its file is. Raises HTTPException 404."""
    found, record, name = _asked(request)
    return sandboxed(file_of_night(found, record, name, state_of(request).units.system))


def _asked(request: Request) -> tuple[Served, Mapping[str, Any], str]:
    needs(request, "view")
    from .night import record_of

    found = machine_of(request)
    return found, record_of(found, int(request.path_params["entry"])), str(request.path_params["name"])


def _framed(request: Request, machine: Served, night: str, back: str, made_up: bool, in_mm: bool = False) -> Response:
    """request, machine, date of a night or '', address of its page, whether no machine was measured, whether a file of the night is
    in mm on pages in inch → the page around a report.
    """
    from .machine import answer_today, ran_since

    values: dict[str, Any] = {
        "machine": machine,
        "night": night,
        "back": back,
        "source": f"{request.url.path}/alone",
        "simulated": made_up,
        "kept": request.path_params.get("name") == "morning.html",
        "in_mm": in_mm,
        "newer": "" if back else ran_since(state_of(request), machine, OF_ANY_NIGHT),
        "in_doubt": not back and _in_doubt(machine, state_of(request).units.system),
    }
    answer = page(request, "framed.html", **values, today=answer_today(request, machine))
    answer.headers["content-security-policy"] = f"{POLICY}; frame-src 'self'"
    return answer


def _in_doubt(machine: Served, unit: str) -> bool:
    """machine, unit of the pages → whether its report may be in mm on pages in inch: it was written before there were both."""
    file = file_of_cell(machine, unit)
    return unit == "inch" and file is not None and file.name == "report.html" and not file.with_name("report.mm.html").is_file()


def sandboxed(file: Path | None) -> FileResponse:
    """file → answer that a browser shows without any right on this server: no cookie, no request, no form.

    Raises HTTPException 404 for None.
    """
    if file is None:
        raise HTTPException(404)
    own = {"content-security-policy": SANDBOX, "x-frame-options": "SAMEORIGIN"}
    return FileResponse(file, media_type="text/html", headers=own)


def file_of_cell(machine: Served, unit: str = "") -> Path | None:
    """machine, mm or inch → its report, in that unit where the same command has written it so; None when it has none, or when the
    file links to a place outside the cell.
    """
    file = report_of(machine.folder)
    if file is None or machine.folder is None:
        return None
    other = machine.folder.resolve() / f"report.{unit}.html"
    try:
        kept = other.is_symlink() or not other.is_file() or other.stat().st_mtime < file.stat().st_mtime - PAIR
    except OSError:
        kept = True
    return file if kept else other


def file_of_night(machine: Served, record: Mapping[str, Any], name: str, unit: str = "") -> Path | None:
    """machine, record, name of a page, mm or inch → its file, in that unit where the night has written it so; None where it is not
    there or not in the folder of the cell.
    """
    folder = (record.get("artefacts") or {}).get("folder")
    if machine.folder is None or not isinstance(folder, str) or name not in NAMES:
        return None
    root = machine.folder.resolve()
    file = (root / folder / name).resolve()
    if not (file.is_relative_to(root) and file.is_file()):
        return None
    other = file.with_name(f"{file.stem}.{unit}.html")
    return other if unit and other.is_file() and not other.is_symlink() else file


ROUTES = [
    Route("/machine/{slug}/report", report, name="report"),
    Route("/machine/{slug}/report/alone", report_alone, name="report_alone"),
    Route("/machine/{slug}/night/{entry:int}/{name}", of_night, name="night_file"),
    Route("/machine/{slug}/night/{entry:int}/{name}/alone", of_night_alone, name="night_file_alone"),
]
