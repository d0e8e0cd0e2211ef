"""What every request passes: name of the server, size, rate, sign-in, forged forms; and what every answer carries.

OWASP's secure headers; cookies HttpOnly and SameSite=Strict; a form needs the token of its sign-in and comes from our own page.
"""

from __future__ import annotations

import hmac
import re
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..report.texts import texts_of
from .settings import Settings

LARGEST = 16 * 1024  # bytes of a body, and of all headers
LONGEST = 2048  # of an address
COOKIE = "tango_sign_in"
HOST = re.compile(r"(?:\[([0-9A-Fa-f:.]+)\]|([A-Za-z0-9._-]+))(?::\d{1,5})?")
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; form-action 'self'; "
    "frame-ancestors 'none'; base-uri 'none'"
)
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "same-origin",  # with no-referrer browsers send "Origin: null" with our own forms
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-embedder-policy": "require-corp",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=(), usb=(), serial=()",
    "cache-control": "no-store",
}


@dataclass
class Buckets:
    """Tokens by key: `rate` come a second, `most` are kept; one is taken at a time. Old keys are forgotten."""

    rate: float
    most: float
    keys: int = 4096
    clock: Callable[[], float] = time.monotonic
    _left: OrderedDict[str, tuple[float, float]] = field(default_factory=OrderedDict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def take(self, key: str) -> float:
        """key → 0 when there was a token, else s until there is one."""
        now = self.clock()
        with self._lock:
            left, at = self._left.pop(key, (self.most, now))
            left = min(self.most, left + (now - at) * self.rate)
            enough = left >= 1.0
            self._left[key] = (left - 1.0 if enough else left, now)
            while len(self._left) > self.keys:
                self._left.popitem(last=False)
        return 0.0 if enough else (1.0 - left) / self.rate

    def give_back(self, key: str) -> None:
        """key → its last token is there again: a sign-in that succeeded does not count."""
        with self._lock:
            if key in self._left:
                left, at = self._left[key]
                self._left[key] = (min(self.most, left + 1.0), at)


class Guard:
    """ASGI middleware: refuses before anything is read or computed."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app, self._settings = app, settings
        self._buckets = Buckets(settings.rate, 2 * settings.rate)
        self._texts = texts_of(settings.templates)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request → an answer of the application, or a refusal."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)

        async def dressed(message: Message) -> None:
            if message["type"] == "http.response.start":
                answer = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    if name not in answer:
                        answer[name] = value
                if self._settings.https:
                    answer["strict-transport-security"] = "max-age=31536000"
                if "server" in answer:
                    del answer["server"]
            await send(message)

        refused = self._refused(scope, headers)
        if refused is not None:
            await refused(scope, receive, dressed)
            return
        taken = 0

        async def measured() -> Message:
            nonlocal taken
            message = await receive()
            taken += len(message.get("body", b""))
            if taken > LARGEST:
                raise TooLarge
            return message

        try:
            await self._app(scope, measured, dressed)
        except TooLarge:
            await self._told(413, "body", most=LARGEST)(scope, receive, dressed)

    def _refused(self, scope: Scope, headers: Headers) -> PlainTextResponse | None:
        host = headers.get("host", "")
        name = host_of(host)
        if name is None or name not in self._settings.names:
            return self._told(421, "name")
        if sum(len(name) + len(value) for name, value in scope["headers"]) > LARGEST:
            return self._told(431, "head", most=LARGEST)
        if len(scope.get("raw_path", b"")) + len(scope.get("query_string", b"")) > LONGEST:
            return self._told(414, "address", most=LONGEST)
        client = scope["client"][0] if scope.get("client") else ""
        if (wait := self._buckets.take(client)) > 0:
            answer = self._told(429, "often")
            answer.headers["retry-after"] = str(max(1, round(wait)))
            return answer
        length = headers.get("content-length", "0")
        if not length.isascii() or not length.isdigit() or len(length) > 12:
            return self._told(400, "length")
        if int(length) > LARGEST:
            return self._told(413, "body", most=LARGEST)
        if scope["method"] not in ("GET", "HEAD", "POST"):
            return self._told(405, "method")
        if scope["method"] == "POST":
            wrong = foreign(headers, host)
            return None if wrong is None else self._told(*wrong)
        return None

    def _told(self, status: int, key: str, **values: int) -> PlainTextResponse:
        return PlainTextResponse(f"{self._texts(f'refused.{key}', **values)}\n", status)


class TooLarge(Exception):
    """A body that goes on beyond what is allowed."""


def foreign(headers: Headers, host: str) -> tuple[int, str] | None:
    """headers, name of the server → status and text of what is wrong with a form, else None.

    A form that another site sends in the name of a user is refused before it is read (Fetch Metadata, Origin).
    """
    site, origin = headers.get("sec-fetch-site"), headers.get("origin")
    if site not in (None, "same-origin", "none") or (origin is not None and origin.partition("://")[2] != host):
        return 403, "foreign"
    kind = headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/x-www-form-urlencoded":
        return 415, "kind"
    return None


def host_of(host: str) -> str | None:
    """header Host → the name in it, without a port; None for what is no such header."""
    match = HOST.fullmatch(host)
    return None if match is None else (match[1] or match[2]).lower()


def same(one: str, other: str) -> bool:
    """two tokens → whether they are the same, in a time that does not tell where they differ."""
    return hmac.compare_digest(one.encode(), other.encode())
