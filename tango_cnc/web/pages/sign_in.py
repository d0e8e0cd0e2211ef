"""Signing in and out."""

from __future__ import annotations

import re

from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route

from ..app import page, proven, state_of
from ..guard import COOKIE
from ..users import verified

LOCAL = re.compile(r"/(?:[A-Za-z0-9_.~%-]+/?)*")  # no other server, no query


def ask(request: Request) -> Response:
    """request → the form."""
    if state_of(request).settings.users is None:
        return RedirectResponse("/", 303)
    said = state_of(request).texts("web.lost") if request.query_params.get("lost") else ""
    return page(request, "sign_in.html", said=said, then=_local(request.query_params.get("next", "")), name="")


def sign_in(request: Request) -> Response:
    """request with name and password → a sign-in, or the form again; five failures of one address or name, then one a minute."""
    state, form = state_of(request), request.state.form
    if state.settings.users is None:
        return RedirectResponse("/", 303)
    name = form.get("user", "")[:64]
    then = _local(form.get("next", ""))
    keys = (f"address {request.client.host if request.client else ''}", f"name {name}")
    wait = max(state.attempts.take(key) for key in keys)
    if wait > 0:
        said = state.texts("web.wait", seconds=round(wait) + 1)
        answer: Response = page(request, "sign_in.html", 429, said=said, then=then, name=name)
        answer.headers["retry-after"] = str(round(wait) + 1)
        return answer
    user = verified(state.settings.users, name, form.get("password", ""))
    if user is None:
        return page(request, "sign_in.html", 403, said=state.texts("web.wrong_sign_in"), then=then, name=name)
    for key in keys:
        state.attempts.give_back(key)
    state.sign_ins.end(request.cookies.get(COOKIE))
    answer = RedirectResponse(then, 303)
    answer.set_cookie(
        COOKIE,
        state.sign_ins.begin(user),
        httponly=True,
        samesite="strict",
        secure=state.settings.https,
        path="/",
        max_age=12 * 3600,
    )
    return answer


def _local(path: str) -> str:
    """where somebody wanted to go → the same where it is a page of this server, else its first page."""
    return path if LOCAL.fullmatch(path) and not path.startswith("/sign-") else "/"


def sign_out(request: Request) -> Response:
    """request with the token of its sign-in → that has ended."""
    proven(request, request.state.form)
    state_of(request).sign_ins.end(request.cookies.get(COOKIE))
    answer = RedirectResponse("/sign-in", 303)
    answer.delete_cookie(COOKIE, path="/")
    return answer


ROUTES = [
    Route("/sign-in", ask, name="ask"),
    Route("/sign-in", sign_in, methods=["POST"], name="sign_in"),
    Route("/sign-out", sign_out, methods=["POST"], name="sign_out"),
]
