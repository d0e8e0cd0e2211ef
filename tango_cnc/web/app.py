"""Settings → the web application: pages by their files, the guard around them, and one way to make a page."""

from __future__ import annotations

import contextlib
import importlib
import inspect
import logging
import pkgutil
import re
import threading
import time
from collections import Counter, defaultdict
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from importlib import resources
from typing import Any
from urllib.parse import parse_qsl, quote

import jinja2
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Route

from ..history import UnreadableError
from ..records import TangoError
from ..report.alarm import sentence, since_told
from ..report.answer import dates_cut_off, is_cut_off, is_unsent
from ..report.days import at, clock, day, local_day, spoken_days
from ..report.decimals import decimals_of_page
from ..report.template import environment
from ..report.texts import Texts, texts_of
from ..report.units import Units
from ..texts.handed import page_of_cell
from . import pages
from .guard import COOKIE, Buckets, Guard, same
from .keeper import Keeper
from .live import Journals, Looks
from .places import STRIP, Places
from .served import Served
from .settings import Role, Settings, may
from .users import SignIn, SignIns, UsersFile

PAGE = re.compile(r"/(alarms|machine/[A-Za-z0-9_-]{1,80}(/[A-Za-z0-9_-]{1,20}){0,2})")  # to which a sign-in leads back
LARGE = 50_000  # bytes from which a page is compressed: the list of 200 machines has 15 times that
MOST_OFF = 20  # histories that may go away while one page is made
LOG = logging.getLogger("tango.serve")


@dataclass
class PagesState:
    """What the pages share."""

    settings: Settings
    places: Places
    sign_ins: SignIns
    journals: Journals
    texts: Texts
    templates: jinja2.Environment
    attempts: Buckets  # sign-ins that failed, by address and by name
    requests: Counter[tuple[str, int]] = field(default_factory=Counter)
    seconds: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    started: float = field(default_factory=time.time)
    lock: threading.Lock = field(default_factory=threading.Lock)
    deciding: threading.Lock = field(default_factory=threading.Lock)
    units: Units = field(default_factory=Units)
    looks: Looks = field(default_factory=Looks)
    known: UsersFile | None = None  # the users file
    rows: dict[tuple[str, str], tuple[Any, Any, Any]] = field(default_factory=dict)  # of machines in lists
    keeper: Keeper | None = None


def create(settings: Settings) -> Starlette:
    """settings → application. Raises InputError for a users file or templates that cannot be used."""
    if settings.users is not None:
        from .users import read_users

        read_users(settings.users)
    env = environment(settings.templates)
    assert isinstance(env.loader, jinja2.ChoiceLoader)
    env.loader = jinja2.ChoiceLoader([*env.loader.loaders, jinja2.PackageLoader("tango_cnc.web", "templates")])
    env.auto_reload = False
    for name in env.list_templates(["html"]):  # an update beside a server that runs changes no page before its restart
        with contextlib.suppress(jinja2.TemplateError):  # a mistake of a shop is said by its page
            env.get_template(name)
    state = PagesState(
        settings,
        Places(settings),
        SignIns(),
        Journals(),
        texts_of(settings.templates),
        env,
        Buckets(rate=1 / 60, most=5),
        known=None if settings.users is None else UsersFile(settings.users),
    )

    @contextlib.asynccontextmanager
    async def life(app: Starlette) -> AsyncIterator[None]:
        from .pages.decisions import both

        state.keeper = Keeper(state.places, lambda: both(state))
        state.keeper.begin()
        yield
        state.keeper.end()
        state.places.close()

    app = Starlette(routes=[*_routes(), *_static()], exception_handlers={HTTPException: _refused}, lifespan=life)
    app.state.tango = state
    app.add_middleware(GZipMiddleware, minimum_size=LARGE, compresslevel=1)
    app.add_middleware(Guard, settings=settings)
    return app


def _routes() -> list[BaseRoute]:
    found: list[BaseRoute] = []
    for module in pkgutil.iter_modules(pages.__path__):
        for route in importlib.import_module(f"{pages.__name__}.{module.name}").ROUTES:
            found.append(counted(route))
    return found


def counted(route: Route) -> Route:
    """route → the same; what fails becomes a page, and its answers and seconds are counted for /metrics."""
    call = route.endpoint

    def noted(request: Request, status: int, began: float) -> None:
        state = state_of(request)
        with state.lock:
            state.requests[route.path, status] += 1
            state.seconds[route.path] += time.perf_counter() - began

    def timed(request: Request) -> Response:
        began, status = time.perf_counter(), 500
        try:
            answer = _answered(call, request)
            status = answer.status_code
            return answer
        except HTTPException as error:
            status = error.status_code
            raise
        finally:
            noted(request, status, began)

    async def awaited(request: Request) -> Response:
        began, status = time.perf_counter(), 500
        try:
            answer = await call(request)
            status = answer.status_code
            return answer
        except HTTPException as error:
            status = error.status_code
            raise
        except Exception as error:
            return _failed(request, error)
        finally:
            noted(request, status, began)

    async def posted(request: Request) -> Response:
        fields = await form_of(request)
        request.state.form = fields
        return await run_in_threadpool(timed, request)

    methods = list(route.methods or ["GET"])
    own = awaited if inspect.iscoroutinefunction(call) else posted if "POST" in methods else timed
    return Route(route.path, own, methods=methods, name=route.name)


def _answered(call: Callable[[Request], Response], request: Request) -> Response:
    for _ in range(MOST_OFF):
        try:
            return call(request)
        except HTTPException:
            raise
        except UnreadableError as error:  # its machines are named; it hides no other one
            if request.method == "POST" or not state_of(request).places.is_off(error):
                return _failed(request, error)
            LOG.warning("%s: %s", request.url.path, error)
        except Exception as error:
            return _failed(request, error)
    return page(request, "told.html", 503, said=state_of(request).texts("web.failed"))


def _failed(request: Request, error: Exception) -> Response:
    """request, what a page has raised → a page that says so."""
    if isinstance(error, TangoError):
        LOG.warning("%s: %s", request.url.path, error)
        known = state_of(request).texts("web.unread_all", why=str(error)) if isinstance(error, UnreadableError) else str(error)
        return page(request, "told.html", 503, said=known)
    LOG.error("%s", request.url.path, exc_info=error)
    return page(request, "told.html", 500, said=state_of(request).texts("web.failed"))


async def form_of(request: Request) -> dict[str, str]:
    """request with a form → its fields, the last of equal names. Raises HTTPException for what is no form, or not whole."""
    try:
        body = await request.body()
    except ClientDisconnect:  # who sends too slowly, too
        raise HTTPException(400, state_of(request).texts("web.csrf")) from None
    try:
        pairs = parse_qsl(
            body.decode("ascii"), keep_blank_values=True, strict_parsing=bool(body), max_num_fields=20, errors="strict"
        )
    except ValueError:
        raise HTTPException(400, state_of(request).texts("web.csrf")) from None
    return dict(pairs)


def _static() -> list[Route]:
    """Two files without a folder behind them: no path can lead out of it."""
    style = "".join(
        resources.files(package).joinpath(name).read_text(encoding="utf-8")
        for package, name in (("tango_cnc.report", "templates/style.css"), ("tango_cnc.web", "static/app.css"))
    )
    script = resources.files("tango_cnc.web").joinpath("static/live.js").read_text(encoding="utf-8")

    def css(request: Request) -> Response:
        return Response(style, media_type="text/css", headers={"cache-control": "max-age=3600"})

    def js(request: Request) -> Response:
        return Response(script, media_type="text/javascript", headers={"cache-control": "max-age=3600"})

    return [Route("/static/app.css", css), Route("/static/live.js", js)]


def state_of(request: Request) -> PagesState:
    """request → what the pages share."""
    found = request.app.state.tango
    assert isinstance(found, PagesState)
    return found


def sign_in_of(request: Request) -> SignIn | None:
    """request → who is signed in, with the role that the users file has now; None for nobody.

    Who was removed from the file, or has got another password, is signed in no more.
    """
    state, key = state_of(request), request.cookies.get(COOKIE)
    signed = state.sign_ins.of(key)
    if signed is None or state.known is None:
        return None
    try:
        user = state.known.user(signed.user)
    except (TangoError, OSError) as error:  # nobody is let in by a file that cannot be read
        LOG.warning("%s", error)
        return None
    if user is None:
        state.sign_ins.end(key)
        return None
    return replace(signed, user=user)


def role_of(request: Request) -> Role | None:
    """request → its role: that of its sign-in; without users everybody may view."""
    if state_of(request).settings.users is None:
        return "view"
    signed = sign_in_of(request)
    return None if signed is None else signed.user.role


def needs(request: Request, wanted: Role) -> None:
    """request, role → nothing. Raises HTTPException: 401 (the sign-in page) without a sign-in, 403 where the role is not enough,
    503 while a server that has just started still reads its machines.
    """
    role = role_of(request)
    if role is None:
        raise HTTPException(401)
    if not may(role, wanted):
        raise HTTPException(403, state_of(request).texts("web.forbidden", role=wanted))
    keeper = state_of(request).keeper
    if keeper is not None and keeper.reading():
        said = state_of(request).texts("web.reading", count=keeper.count)
        raise HTTPException(503, said, {"retry-after": "2", "refresh": "2"})


def proven(request: Request, form: Mapping[str, Any]) -> SignIn:
    """request, its form → its sign-in. Raises HTTPException for a form without the token of that sign-in."""
    signed = sign_in_of(request)
    if signed is None:
        raise HTTPException(401)
    if not same(str(form.get("csrf", "")), signed.csrf):
        raise HTTPException(403, state_of(request).texts("web.csrf"))
    return signed


def machine_of(request: Request) -> Served:
    """request → the machine of its address. Raises HTTPException 404."""
    found = state_of(request).places.machines().get(str(request.path_params["slug"]))
    if found is None:
        raise HTTPException(404)
    return found


def page(request: Request, template: str, status: int = 200, **values: Any) -> HTMLResponse:
    """request, template, values → the page."""
    state, signed = state_of(request), sign_in_of(request)
    context = {
        "t": state.texts,
        "units": state.units,
        "sentence": lambda text: sentence(state.texts.of(text), state.units),
        "day": lambda text, year=True: day(text, state.texts, year),
        "spoken": lambda text: spoken_days(state.texts.of(text), state.texts),
        "moment": lambda text: at(text, state.texts),
        "since_of": lambda a: since_told(a, state.texts),
        "is_unsent": is_unsent,
        "is_cut_off": is_cut_off,
        "made": made(state.texts),
        "newest_of": lambda machine: _newest(state, machine),
        "here": request.url.path,
        "signed_in": signed,
        "csrf": signed.csrf if signed else "",
        "role": role_of(request),
        "with_users": state.settings.users is not None,
        "may_operate": may(role_of(request), "operate"),
        **values,
    }
    told = page_of_cell(state.templates.get_template(template).render(**context), cell_of(values.get("machine")))
    return HTMLResponse(decimals_of_page(told, state.texts), status)


def cell_of(machine: Any) -> str:
    """machine of a page, None for a page of all → name of the folder of its cell; '' where it has none here."""
    return machine.folder.resolve().name if isinstance(machine, Served) and machine.folder is not None else ""


def made(t: Texts) -> str:
    """texts → when the page is made, as all pages say it: 06:02 CET, Sun 29 Nov."""
    now = datetime.now(UTC)
    return f"{clock(now)}, {day(local_day(now.isoformat()), t, False)}"


def _newest(state: PagesState, machine: Served) -> str:
    """what pages share, machine → date of its newest night, also where that one was cut off; '' where it has none."""
    nights = state.places.nights(machine, STRIP)
    return max((*dates_cut_off(machine.former), *(n.night for n in nights[:1])), default="")


def _refused(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    if error.status_code == 401:
        # A form that comes after its sign-in was not carried out: its page is where to go on.
        where = request.url.path if request.method == "GET" else "/alarms" if request.url.path.endswith("/decide") else "/"
        where = where if PAGE.fullmatch(where) else "/"  # no header says again what a stranger has sent
        lost = "" if request.method == "GET" or request.url.path == "/sign-out" else "&lost=1"
        then = f"?next={quote(where, safe='/')}{lost}" if where != "/" or lost else ""
        return RedirectResponse(f"/sign-in{then}", 303)
    t = state_of(request).texts
    own = {404: "web.not_found", 405: "web.no_form"}
    said = t(own[error.status_code]) if error.status_code in own else str(error.detail)
    found = page(request, "told.html", error.status_code, said=said)
    found.headers.update(error.headers or {})
    return found
