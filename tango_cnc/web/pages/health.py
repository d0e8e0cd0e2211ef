"""For other programs: /healthz says that the server answers, /metrics is for Prometheus (text format 0.0.4)."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from ...report.age import measured_on
from ...report.answer import Answer
from ...report.faults import still_open
from ..app import needs, state_of
from ..served import Row
from ..settings import LOOPBACK
from .fleet import answer_of, faults_of, newer_of

VERDICTS = ("good", "changed", "out_of_limits", "doubtful", "not_measured")


def healthz(request: Request) -> Response:
    """request → ok; it says nothing of machines."""
    return PlainTextResponse("ok\n")


def metrics(request: Request) -> Response:
    """request from this computer, or of who may view → counters and the state of every machine."""
    state = state_of(request)
    here = request.client is not None and request.client.host in LOOPBACK
    if not here or (state.settings.behind_proxy and "x-forwarded-for" not in request.headers):  # then it may be anybody
        try:
            needs(request, "view")
        except HTTPException:
            raise HTTPException(403, state_of(request).texts("refused.metrics")) from None
    return PlainTextResponse("\n".join(_lines(request)) + "\n", media_type="text/plain; version=0.0.4")


def _lines(request: Request) -> Iterator[str]:
    state = state_of(request)
    yield "# TYPE tango_http_requests_total counter"
    with state.lock:
        counts, seconds = dict(state.requests), dict(state.seconds)
    yield from (f'tango_http_requests_total{{path="{path}",status="{status}"}} {n}' for (path, status), n in sorted(counts.items()))
    yield "# TYPE tango_http_seconds_total counter"
    yield from (f'tango_http_seconds_total{{path="{path}"}} {s:.6f}' for path, s in sorted(seconds.items()))
    yield "# TYPE tango_sign_ins gauge"
    yield f"tango_sign_ins {len(state.sign_ins)}"
    yield "# TYPE tango_uptime_seconds gauge"
    yield f"tango_uptime_seconds {time.time() - state.started:.0f}"
    rows = state.places.fleet()

    def stale(row: Row) -> float | None:
        return None if row.record is None else state.places.old(row.machine, measured_on(row.record, row.before))

    names = Counter(row.machine.name for row in rows)

    def labels(row: Row) -> str:  # folders with one machine name: two series with the same labels would spoil the whole scrape
        twice = names[row.machine.name] > 1
        told = f'machine="{_escaped(row.machine.name)}"'
        return f'{told},cell="{_escaped(str(row.machine.folder or row.machine.slug))}"' if twice else told

    def waiting(row: Row, unanswered: bool) -> int | None:
        if row.standing is None:
            return None
        return sum(not unanswered or a["decision"] is None for a in still_open(faults_of(row, state)))

    def valid(row: Row) -> float | None:  # whether the number beside it is an answer of today
        if _volume(row) is None:
            return None
        return float(not stale(row) and newer(row) is None)

    def newer(row: Row) -> Answer | None:  # where newer readings give the answer of the pages
        said = None if newer_of(row) is None else answer_of(row, faults_of(row, state), state)
        return said if said is not None and said.newer else None

    def newer_um(row: Row) -> float | None:
        found, said = newer_of(row), answer_of(row, faults_of(row, state), state)
        return None if found is None or said is None or not (said.newer or said.beside) else found.tip_um

    own = (
        ("readable", lambda row: float(not row.machine.unread)),
        ("alarms_open", lambda row: waiting(row, False)),
        ("alarms_unanswered", lambda row: waiting(row, True)),
        ("late", _late),
        ("stale_nights", stale),
        ("volume_um", _volume),
        ("volume_valid", valid),
        ("nights", _nights),
        ("newer_no", lambda row: _newer(row, newer(row), "no")),
        ("newer_but", lambda row: _newer(row, newer(row), "but")),
        ("newer_volume_um", newer_um),
    )
    for name, values in own:
        yield f"# TYPE tango_machine_{name} gauge"
        for row in rows:
            value = values(row)
            if value is not None:
                yield f"tango_machine_{name}{{{labels(row)}}} {value:g}"
    yield "# TYPE tango_machine_verdict gauge"
    for row in rows:
        if row.standing is not None and row.standing.last is not None:
            for verdict in VERDICTS:
                told = int(row.standing.last.verdict == verdict)
                yield f'tango_machine_verdict{{{labels(row)},verdict="{verdict}"}} {told}'


def _late(row: Row) -> float | None:
    return None if row.standing is None else float(row.standing.late)


def _volume(row: Row) -> float | None:
    return None if row.standing is None or row.standing.last is None else row.standing.last.volume_um


def _nights(row: Row) -> float | None:
    return None if row.standing is None else row.standing.nights


def _newer(row: Row, found: Answer | None, may: str) -> float | None:
    return None if row.record is None else float(found is not None and found.may == may)


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


ROUTES = [Route("/healthz", healthz, name="healthz"), Route("/metrics", metrics, name="metrics")]
