"""Signing in and out."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route

from ..app import page, proven, state_of
from ..guard import COOKIE
from ..users import verified


def ask(request: Request) -> Response:
    """request → the form."""
    if state_of(request).settings.users is None:
        return RedirectResponse("/", 303)
    return page(request, "sign_in.html", said="")


def sign_in(request: Request) -> Response:
    """request with name and password → a sign-in, or the form again; five failures of one address or name, then one a minute."""
    state, form = state_of(request), request.state.form
    if state.settings.users is None:
        return RedirectResponse("/", 303)
    name = form.get("user", "")[:64]
    keys = (f"address {request.client.host if request.client else ''}", f"name {name}")
    wait = max(state.attempts.take(key) for key in keys)
    if wait > 0:
        answer: Response = page(request, "sign_in.html", 429, said=state.texts("web.wait", seconds=round(wait) + 1))
        answer.headers["retry-after"] = str(round(wait) + 1)
        return answer
    user = verified(state.settings.users, name, form.get("password", ""))
    if user is None:
        return page(request, "sign_in.html", 403, said=state.texts("web.wrong_sign_in"))
    for key in keys:
        state.attempts.give_back(key)
    state.sign_ins.end(request.cookies.get(COOKIE))
    answer = RedirectResponse("/", 303)
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
