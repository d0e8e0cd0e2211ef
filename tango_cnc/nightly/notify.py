"""Whoever is to be told, each a URL in nightly.yaml. What cannot be sent says why, and stays on disk until it can.

    mailto:ann@shop.example?smtp=mail.shop.example:587&user=machine&from=hu40t@shop.example&tls=yes
    https://hooks.shop.example/machines        a POST of {"subject", "text"}
    mqtt://broker:1883/machines/hu40t          {"subject", "text"}, kept by the broker
    apprise:tgram://token/chat                 whatever apprise knows (pip install 'tango-cnc[notify]')
    file:///srv/board/hu40t.txt                the last message, for a screen on the wall

A password is never in nightly.yaml: ${NAME} in a URL is taken from the environment; that of a timer is a file (docs/nightly.md).
"""

from __future__ import annotations

import json
import os
import re
import smtplib
import ssl
import urllib.request
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from email.message import EmailMessage
from email.utils import formatdate, make_msgid
from pathlib import Path
from smtplib import SMTPResponseException
from threading import Thread
from time import monotonic
from urllib.error import HTTPError, URLError
from urllib.parse import parse_qs, quote, unquote, urlsplit

from ..files.environment import filled
from ..texts import say
from .install import ENVIRONMENT
from .ports import Delivery

WAIT = 20.0  # s, for one answer
LONGEST = 60.0  # s, for all receivers together, to whom it is sent at the same time


@dataclass(frozen=True)
class Notifier:
    """The receivers of a cell."""

    urls: tuple[str, ...]

    def send(self, subject: str, text: str, but: Sequence[str] = ()) -> Sequence[Delivery]:
        """subject, text, names of those who have it → what was delivered within `LONGEST`, one a receiver."""
        names = [shown(url) for url in self.urls]
        names = [n if names.count(n) == 1 else f"{n} ({i})" for i, n in enumerate(names, 1)]
        wanted = [(to, url) for to, url in zip(names, self.urls, strict=True) if to not in but]
        done: dict[str, Delivery] = {}

        def one(to: str, url: str) -> None:
            done[to] = _one(to, url, subject, text)

        # A server that goes on saying nothing, or a letter now and then, keeps its library waiting for good, but not the night.
        at_work = [Thread(target=one, args=pair, daemon=True) for pair in wanted]
        for thread in at_work:
            thread.start()
        end = monotonic() + LONGEST
        for thread in at_work:
            thread.join(max(end - monotonic(), 0.0))
        late = say("mail.late", seconds=f"{LONGEST:g}")
        missing = {to: Delivery(to, False, late) for to, _ in wanted}
        return tuple(Delivery(to, True) if to in but else done.get(to) or missing[to] for to in names)


def _one(to: str, url: str, subject: str, text: str) -> Delivery:
    try:
        whole = _filled(url)
        _SENDERS[url.split(":")[0]](whole, subject, text)
    except Exception as error:  # whatever a library raises: one receiver that fails must not keep the others from hearing
        return Delivery(to, False, _why(error))
    return Delivery(to, True)


def _why(error: BaseException) -> str:
    """what a library raised → the words of the computer or of the server, without those of Python where there are any."""
    if isinstance(error, HTTPError):
        return say("mail.http", code=error.code, reason=error.reason)
    if isinstance(error, URLError) and isinstance(error.reason, BaseException):
        return _why(error.reason)
    if isinstance(error, SMTPResponseException):
        told = error.smtp_error
        return f"{error.smtp_code} {told.decode('utf-8', 'replace') if isinstance(told, bytes) else told}"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return str(error) if isinstance(error, Unset) else f"{type(error).__name__}: {error}"


class Unset(ValueError):
    """A name in a URL that the environment does not have."""


def shown(url: str) -> str:
    """URL → the same without what may be secret."""
    scheme, _, rest = url.partition(":")
    if scheme == "mailto":
        return f"mailto:{rest.split('?')[0]}"
    if scheme == "apprise":
        return f"apprise:{rest.split('://')[0]}://…"
    return re.sub(r"//[^/@]*@", "//…@", url.split("?")[0])


def _filled(url: str) -> str:
    """URL → the same with ${NAME} from the environment, so written that no sign of a password parts the URL."""
    scheme = url.split(":")[0]
    safe = "/" if scheme in ("http", "https", "apprise") else ""  # a token of a hook has a path of its own

    def unset(name: str) -> Unset:
        return Unset(say("mail.unset", name=name, file=ENVIRONMENT.as_posix()))

    return filled(url, (lambda word: word) if scheme == "file" else (lambda word: quote(word, safe)), unset)


def _mail(url: str, subject: str, text: str) -> None:
    address, _, query = url.removeprefix("mailto:").partition("?")
    options = {key: values[-1] for key, values in parse_qs(query).items()}
    host, _, port = options.get("smtp", "localhost:25").partition(":")
    mail = EmailMessage()
    mail["Subject"], mail["To"], mail["From"] = subject, unquote(address), options.get("from", f"tango@{host}")
    mail["Date"], mail["Message-ID"] = formatdate(localtime=True), make_msgid(domain=host)
    mail["Auto-Submitted"] = "auto-generated"  # RFC 3834: no answer of somebody who is on holiday comes back
    mail.set_content(text)
    with smtplib.SMTP(host, int(port or 25), timeout=WAIT) as server:
        if options.get("tls", "no") == "yes":
            server.starttls(context=ssl.create_default_context())
        if "user" in options:
            server.login(options["user"], options.get("password", ""))
        server.send_message(mail)


def _hook(url: str, subject: str, text: str) -> None:
    data = json.dumps({"subject": subject, "text": text}, ensure_ascii=False).encode()
    asked = urllib.request.Request(url, data, {"Content-Type": "application/json; charset=utf-8"}, method="POST")
    with urllib.request.urlopen(asked, timeout=WAIT) as answer:
        answer.read()


def _mqtt(url: str, subject: str, text: str) -> None:
    try:
        from paho.mqtt import publish
    except ModuleNotFoundError:
        raise ModuleNotFoundError("pip install 'tango-cnc[notify]'") from None
    parts = urlsplit(url)
    secure = parts.scheme == "mqtts"
    publish.single(
        parts.path.lstrip("/") or "tango",
        json.dumps({"subject": subject, "text": text}, ensure_ascii=False),
        qos=1,
        retain=True,
        hostname=parts.hostname or "localhost",
        port=parts.port or (8883 if secure else 1883),
        auth={"username": unquote(parts.username), "password": unquote(parts.password or "")} if parts.username else None,
        tls={"ca_certs": ssl.get_default_verify_paths().cafile or ""} if secure else None,
    )


def _apprise(url: str, subject: str, text: str) -> None:
    try:
        import apprise
    except ModuleNotFoundError:
        raise ModuleNotFoundError("pip install 'tango-cnc[notify]'") from None
    sender = apprise.Apprise()
    if not sender.add(url.removeprefix("apprise:")):
        raise ValueError("apprise does not know this URL")
    if not sender.notify(body=text, title=subject):
        raise ConnectionError("apprise could not deliver it")


def _file(url: str, subject: str, text: str) -> None:
    from ..files import write_text

    path = unquote(urlsplit(url).path)
    write_text(Path(path[1:] if os.name == "nt" else path), f"{subject}\n\n{text}")


_SENDERS: dict[str, Callable[[str, str, str], None]] = {
    **{"mailto": _mail, "http": _hook, "https": _hook, "mqtt": _mqtt, "mqtts": _mqtt},
    **{"apprise": _apprise, "file": _file},
}
