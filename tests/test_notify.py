"""A message reaches people over what shops have: mail, with TLS or without, a hook, a broker, apprise, a file; or says why not."""

from __future__ import annotations

import json
import shutil
import socket
import ssl
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from email import message_from_bytes, policy
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest
from support.nights_parts import RealDisk

from tango_cnc.nightly import notify
from tango_cnc.nightly.night import delivered
from tango_cnc.nightly.notify import Notifier, shown

SUBJECT, TEXT = "HU40T: HAS CHANGED (2026-11-23)", "EX0C moved by +19.8 ± 0.4 µm.\n\n* owner: Ann Meier\n"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Box:
    """What a mail server keeps of what it was sent."""

    def __init__(self) -> None:
        self.mails: list[Any] = []

    async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:
        if envelope.rcpt_tos[0].startswith("nobody"):
            return "550 no such user here"
        self.mails.append((envelope.rcpt_tos, message_from_bytes(envelope.content, policy=policy.default)))
        return "250 OK"


@contextmanager
def smtp(box: Box, **options: Any) -> Iterator[str]:
    """→ host:port of a mail server."""
    controller = pytest.importorskip("aiosmtpd.controller").Controller(
        box, **{"hostname": "localhost", "port": free_port(), **options}
    )
    controller.start()
    try:
        yield f"localhost:{controller.port}"
    finally:
        controller.stop()


@contextmanager
def web(status: int = 200) -> Iterator[tuple[str, list[Any]]]:
    """→ host:port of a web server that answers `status`, and what was posted to it."""
    got: list[Any] = []

    class Answer(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            got.append((self.path, self.headers["Content-Type"], json.loads(body)))
            self.send_response(status)
            self.end_headers()

        def log_message(self, *_: Any) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Answer)
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    try:
        yield f"127.0.0.1:{server.server_port}", got
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def sent(*urls: str) -> list[tuple[bool, str]]:
    return [(d.sent, d.why) for d in Notifier(urls).send(SUBJECT, TEXT)]


def test_a_mail_arrives_whole_and_as_mail_servers_want_it() -> None:
    box = Box()
    with smtp(box) as host:
        assert sent(f"mailto:ann@shop.example,bo@shop.example?smtp={host}&from=hu40t@shop.example") == [(True, "")]
        ((failed, why),) = sent(f"mailto:nobody@shop.example?smtp={host}")
    ((to, mail),) = box.mails
    assert to == ["ann@shop.example", "bo@shop.example"] and mail["Subject"] == SUBJECT and mail["From"] == "hu40t@shop.example"
    assert mail.get_content().replace("\r\n", "\n") == TEXT
    assert mail["Date"] and mail["Message-ID"] and mail["Auto-Submitted"] == "auto-generated"
    assert not failed and "550" in why and "no such user" in why


def test_why_a_message_did_not_go_out_is_in_words_of_the_computer_or_the_server() -> None:
    port = free_port()
    with web(503) as (host, _):
        found = sent(f"mailto:ann@shop.example?smtp=localhost:{port}", f"http://localhost:{port}/x", f"http://{host}/x")
    assert [why for _, why in found] == ["Connection refused", "Connection refused", "the server answers 503 Service Unavailable"]


def certificate(folder: Path) -> tuple[Path, Path]:
    """→ certificate and key of a mail server called localhost."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "localhost")])
    now = datetime.now(UTC)
    made = x509.CertificateBuilder(name, name, key.public_key(), 1, now - timedelta(days=1), now + timedelta(days=1))
    made = made.add_extension(x509.SubjectAlternativeName([x509.DNSName("localhost")]), False)
    made = made.add_extension(x509.BasicConstraints(True, None), True)
    cert, private = folder / "cert.pem", folder / "key.pem"
    cert.write_bytes(made.sign(key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM))
    private.write_bytes(
        key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    )
    return cert, private


def test_a_password_goes_over_tls_only_and_comes_from_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from aiosmtpd.smtp import AuthResult, LoginPassword

    cert, private = certificate(tmp_path)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(cert, private)

    def known(server: Any, session: Any, envelope: Any, mechanism: str, data: Any) -> Any:
        return AuthResult(success=isinstance(data, LoginPassword) and (data.login, data.password) == (b"machine", b"s3cret&%"))

    box, port = Box(), free_port()
    url = f"mailto:ann@shop.example?smtp=localhost:{port}&tls=yes&user=machine&password=${{MAIL_PASSWORD}}"
    secure = {"tls_context": context, "require_starttls": True, "authenticator": known, "auth_required": True, "port": port}
    ((done, why),) = sent(url)
    assert not done and "MAIL_PASSWORD" in why
    monkeypatch.setenv("MAIL_PASSWORD", "s3cret&%")
    with smtp(box, **secure):
        ((done, why),) = sent(url)
        assert not done and "certificate" in why.lower()  # a server that nobody vouches for
    monkeypatch.setenv("SSL_CERT_FILE", str(cert))
    with smtp(box, **secure):
        assert sent(url) == [(True, "")] and len(box.mails) == 1
        monkeypatch.setenv("MAIL_PASSWORD", "hunter2")
        monkeypatch.setattr(notify, "WAIT", 1.0)  # aiosmtpd says nothing after a wrong password
        ((done, why),) = sent(url)
        assert not done and "hunter2" not in why and len(box.mails) == 1
    assert shown(url) == "mailto:ann@shop.example"


@pytest.mark.long
def test_hooks_apprise_and_a_file(tmp_path: Path) -> None:
    pytest.importorskip("apprise")
    with web() as (host, got):
        board = tmp_path / "board.txt"
        assert sent(f"http://{host}/hook?key=1", f"apprise:json://{host}/app", f"file://{board}") == [(True, "")] * 3
    assert got[0] == ("/hook?key=1", "application/json; charset=utf-8", {"subject": SUBJECT, "text": TEXT})
    assert got[1][0] == "/app" and got[1][2]["title"] == SUBJECT and "± 0.4 µm" in got[1][2]["message"]
    assert board.read_text(encoding="utf-8") == f"{SUBJECT}\n\n{TEXT}"


@pytest.mark.long
def test_what_is_not_delivered_says_why() -> None:
    with web(500) as (host, _):
        found = sent(f"http://{host}/", f"apprise:json://{host}/", f"http://127.0.0.1:{free_port()}/", "apprise:nonsense://x")
    assert [done for done, _ in found] == [False] * 4
    assert (
        "500" in found[0][1] and "apprise could not" in found[1][1] and "refused" in found[2][1] and "does not know" in found[3][1]
    )


@pytest.mark.system("mosquitto")
def test_a_broker_keeps_the_last_message(tmp_path: Path) -> None:
    from paho.mqtt import subscribe

    port = free_port()
    (tmp_path / "conf").write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\npersistence false\n")
    command = [str(shutil.which("mosquitto")), "-c", str(tmp_path / "conf")]
    url = f"mqtt://127.0.0.1:{port}/machines/hu40t"
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as broker:
        try:
            for _ in range(100):
                with socket.socket() as probe:
                    if probe.connect_ex(("127.0.0.1", port)) == 0:
                        break
                threading.Event().wait(0.05)
            assert sent(url) == [(True, "")]
            kept = subscribe.simple("machines/hu40t", hostname="127.0.0.1", port=port)  # whoever comes later hears it, too
            assert kept.retain and json.loads(kept.payload) == {"subject": SUBJECT, "text": TEXT}
        finally:
            broker.terminate()
    ((done, why),) = sent(url)
    assert not done and "refused" in why


@contextmanager
def slow(letter: bytes) -> Iterator[int]:
    """→ port of a server that takes every caller and says a letter now and then, or nothing, and never comes to an end."""
    over = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.05)

        def serve() -> None:
            callers = []
            while not over.wait(0.05):
                with suppress(TimeoutError):
                    callers.append(server.accept()[0])
                for caller in callers:
                    with suppress(OSError):
                        caller.sendall(letter)
            for caller in callers:
                caller.close()

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield server.getsockname()[1]
        finally:
            over.set()
            thread.join()


@pytest.mark.long
def test_a_server_that_never_comes_to_an_end_keeps_neither_the_night_nor_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("paho.mqtt")
    monkeypatch.setattr(notify, "LONGEST", 3.0)
    with slow(b"") as silent, slow(b"2") as dripping:
        urls = [
            f"mqtt://127.0.0.1:{silent}/x",
            f"mailto:ann@shop.example?smtp=127.0.0.1:{dripping}",
            f"http://127.0.0.1:{dripping}/",
        ]
        begun = time.monotonic()
        found = sent(*urls, f"file://{tmp_path / 'board.txt'}")
        assert time.monotonic() - begun < 60  # each of them for itself would have no end
    assert [done for done, _ in found] == [False, False, False, True]
    assert all("within 3 s" in why for _, why in found[:3]), found


def test_a_dead_receiver_does_not_send_the_message_to_the_others_again(tmp_path: Path) -> None:
    disk, dead, box = RealDisk(tmp_path), free_port(), Box()
    with smtp(box) as host:
        mail = Notifier(
            (f"mailto:ann@shop.example?smtp={host}", f"http://127.0.0.1:{dead}/", f"mailto:bo@shop.example?smtp={host}")
        )
        disk.post("2026-11-23T020000Z", f"{SUBJECT}\n{TEXT}")
        for _ in range(3):
            ((stamp, words),) = disk.unsent()
            assert [d.sent for d in delivered(disk, mail, stamp, words)] == [True, False, True]
        assert sorted(to for to, _ in box.mails) == [["ann@shop.example"], ["bo@shop.example"]]  # once each, at the same time
        with web() as (up, got):
            again = Notifier((mail.urls[0], f"http://{up}/", mail.urls[2]))
            ((stamp, words),) = disk.unsent()
            assert all(d.sent for d in delivered(disk, again, stamp, words))
        assert disk.unsent() == [] and len(box.mails) == 2 and got[0][2] == {"subject": SUBJECT, "text": TEXT}
