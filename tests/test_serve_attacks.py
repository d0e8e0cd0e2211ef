"""Attacks on the wire and by what a cell holds: requests that two readers read in two ways, names of facets that are code."""

from __future__ import annotations

import re
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.nights import knock, night
from support.server import PASSWORD, Recorded, cell

pytest.importorskip("starlette")
import uvicorn
from starlette.testclient import TestClient

from tango_cnc.files import read_cell
from tango_cnc.web import patience
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings
from tango_cnc.web.users import add_user

pytestmark = pytest.mark.long
EVIL = """<script>alert(1)</script>'"><img src=x onerror=alert(2)>{{7*7}}"""
BASE = "http://127.0.0.1"
FORM = b"Content-Type: application/x-www-form-urlencoded\r\n"
CHUNKED = b"Transfer-Encoding: chunked\r\n"
GET, POST = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n", b"POST /sign-in HTTP/1.1\r\nHost: 127.0.0.1\r\n"
END = b"Connection: close\r\n\r\n"


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """A server as `tango serve` starts it, with a user ann."""
    place = tmp_path_factory.mktemp("attacks")
    folder = cell(place / "one", records=[night("HU40T-like", 0)])
    add_user(place / "users.json", "ann", PASSWORD, "operate")
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        number = found.getsockname()[1]
    app = create(Settings((folder,), users=place / "users.json", rate=1e9))
    config = uvicorn.Config(app, port=number, http=patience.Patient, proxy_headers=False, server_header=False, log_level="critical")
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.05)
    yield number
    server.should_exit = True
    thread.join(20)


def said(port: int, data: bytes) -> bytes:
    """port, bytes → all that comes back until the connection is closed."""
    with socket.create_connection(("127.0.0.1", port), timeout=20) as wire:
        got = b""
        try:
            wire.sendall(data)
            while more := wire.recv(65536):
                got += more
        except (ConnectionResetError, BrokenPipeError):
            pass
        return got


WIRE = {  # request → statuses of the answers, at most; none: the connection is closed without a word
    "no host": (b"GET / HTTP/1.1\r\n" + END, {400, 421}),
    "two hosts": (GET + b"Host: evil.example\r\n" + END, {400, 421}),
    "two hosts, the wrong one first": (b"GET / HTTP/1.1\r\nHost: evil.example\r\nHost: 127.0.0.1\r\n" + END, {400, 421}),
    "host of wide digits": ("GET / HTTP/1.1\r\nHost: １２７.0.0.1\r\n".encode() + END, {400, 421}),
    "absolute address": (b"GET http://evil.example/ HTTP/1.1\r\nHost: 127.0.0.1\r\n" + END, {303, 400, 404, 421}),
    "length and chunks": (POST + FORM + CHUNKED + b"Content-Length: 6\r\n" + END + b"0\r\n\r\nG", {400, 403, 429}),
    "unknown coding": (POST + FORM + b"Transfer-Encoding: xchunked\r\n" + END + b"0\r\n\r\n", {400, 501}),
    "two lengths": (POST + FORM + b"Content-Length: 3\r\nContent-Length: 5\r\n" + END + b"a=bcd", {400}),
    "negative length": (POST + FORM + b"Content-Length: -1\r\n" + END, {400}),
    "length with a sign": (POST + FORM + b"Content-Length: +5\r\n" + END + b"a=bcd", {400}),
    "huge length": (POST + FORM + b"Content-Length: 99999999999\r\n" + END, {413}),
    "endless chunks": (POST + FORM + CHUNKED + END + (b"1000\r\n" + b"a" * 0x1000 + b"\r\n") * 9 + b"0\r\n\r\n", {413}),
    "chunk without a size": (POST + FORM + CHUNKED + END + b"zz\r\n", {400}),
    "space before a colon": (b"GET / HTTP/1.1\r\nHost : 127.0.0.1\r\n" + END, {400}),
    "zero byte in a header": (GET + b"X-A: a\x00b\r\n" + END, {400}),
    "line break in an address": (b"GET /machine/x%0d%0aSet-Cookie:%20a=b HTTP/1.1\r\nHost: 127.0.0.1\r\n" + END, {303, 404}),
    "huge header": (GET + b"X-A: " + b"a" * 200_000 + b"\r\n" + END, {400, 431}),
    "five thousand headers": (GET + b"".join(b"X-%d: y\r\n" % i for i in range(5000)) + END, {303, 400, 431}),
    "huge cookie": (GET + b"Cookie: tango_sign_in=" + b"a" * 9000 + b"\r\n" + END, {303, 400, 431}),
    "unknown method": (b"FOO / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + END, {405}),
    "trace": (b"TRACE / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + END, {405}),
    "connect": (b"CONNECT evil.example:80 HTTP/1.1\r\nHost: 127.0.0.1\r\n" + END, {400, 404, 405}),
    "HTTP/0.9": (b"GET /\r\n\r\n", {400}),
    "HTTP/2 at once": (b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", {400, 421}),
    "TLS to a port without it": (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + b"\x00" * 200 + b"\r\n\r\n", {400}),
    "two slashes": (b"GET //evil.example/%2f.. HTTP/1.1\r\nHost: 127.0.0.1\r\n" + END, {303, 404}),
    "way out of the files": (
        b"GET /machine/HU40T-like/files/../../../../etc/passwd HTTP/1.1\r\nHost: 127.0.0.1\r\n" + END,
        {303, 404},
    ),
    "form of another site": (POST + FORM + b"Origin: http://evil.example\r\nContent-Length: 3\r\n" + END + b"a=b", {403}),
    "form of another port": (POST + FORM + b"Origin: http://127.0.0.1:1\r\nContent-Length: 3\r\n" + END + b"a=b", {403}),
    "form of no site": (POST + FORM + b"Origin: null\r\nContent-Length: 3\r\n" + END + b"a=b", {403}),
    "no form": (POST + b"Content-Type: application/json\r\nContent-Length: 2\r\n" + END + b"{}", {415}),
}


@pytest.mark.parametrize("name", WIRE)
def test_on_the_wire_nothing_but_refusals(name: str, port: int) -> None:
    """One answer at most, no second request behind the first, nothing of what was sent in a header; and the server goes on."""
    data, allowed = WIRE[name]
    got = said(port, data)
    found = [int(x) for x in re.findall(rb"HTTP/1\.1 (\d+)", got)]
    assert (len(found) <= 1 or min(found) >= 400) and set(found) <= allowed, (found, got[:300])
    head = got.partition(b"\r\n\r\n")[0]
    assert b"evil.example" not in head and b"server:" not in head.lower() and b"set-cookie" not in head.lower()
    assert b"Traceback" not in got and b"root:x" not in got
    assert b"200 OK" in said(port, b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n" + END)


@pytest.fixture
def client(tmp_path: Path) -> TestClient:
    """Somebody who may operate, on a cell whose facet and parameter have names that are code; a run goes on."""
    alarm = knock("2026-10-25")
    last = night("HU40T-like", 1, "changed", alarms=[alarm])
    last["parameters"][EVIL] = last["parameters"]["EX0C"]
    first = night("HU40T-like", 0)
    first["parameters"][EVIL] = first["parameters"]["EX0C"]
    folder = cell(tmp_path / "one", records=[first, last])
    quoted = "'" + EVIL.replace("'", "''") + "'"
    for name, at in (("artefact.yaml", r"(?m)^  3:"), ("strategy.yaml", r"(?<=[\[ ])3(?=[,\]])")):
        file = folder / name
        named = f"  {quoted}:" if name == "artefact.yaml" else quoted
        text, count = re.subn(at, lambda _, said=named: said, file.read_text(encoding="utf-8"))
        assert count
        file.write_text(text, encoding="utf-8")
    read_cell(folder)  # such a name is allowed: the pages have to bear it
    run = Recorded(folder)
    run.begin()
    for facet in ("5", EVIL, EVIL):
        run.touch(facet, drift=1.0)
    add_user(tmp_path / "users.json", "ann", PASSWORD, "operate")
    app = create(Settings((folder,), users=tmp_path / "users.json", rate=1e9))
    found = TestClient(app, base_url=BASE, client=("127.0.0.1", 1))
    assert found.post("/sign-in", data={"user": "ann", "password": PASSWORD}).status_code == 200
    return found


def harmless(text: str, where: str) -> None:
    """Text of an answer, where it is from → nothing in it acts."""
    assert "alert(" in text, where
    assert "<script>alert" not in text and "<img" not in text and ">49<" not in text, where


def test_names_of_facets_and_parameters_that_are_code_are_text(client: TestClient) -> None:
    for path in ("/run", "/run/step", "/trend"):
        harmless(client.get(f"/machine/HU40T-like{path}").text, path)


def test_what_somebody_writes_into_a_decision_is_text(client: TestClient) -> None:
    token = re.findall(r'name="csrf" value="([^"]+)"', client.get("/").text)[0]
    form = {"csrf": token, "alarm": "2026-10-25-1", "action": "acknowledge", "owner": EVIL, "note": EVIL}
    assert client.post("/machine/HU40T-like/decide", data=form).status_code == 200
    for path in ("/", "/alarms", "/machine/HU40T-like"):
        harmless(client.get(path).text, path)


def test_a_sign_in_begins_anew_and_takes_no_cookie_that_somebody_chose(client: TestClient) -> None:
    chosen = "a" * 43
    other = TestClient(client.app, base_url=BASE, client=("127.0.0.1", 2), cookies={"tango_sign_in": chosen})
    answer = other.post("/sign-in", data={"user": "ann", "password": PASSWORD}, follow_redirects=False)
    assert chosen not in answer.headers["set-cookie"]
    stranger = TestClient(client.app, base_url=BASE, client=("127.0.0.1", 3))
    for value in (chosen, f"{chosen}; tango_sign_in=b"):
        asked = stranger.get("/", headers={"cookie": f"tango_sign_in={value}"}, follow_redirects=False)
        assert asked.status_code == 303, value


def test_who_guesses_is_counted_by_his_own_address_whatever_he_writes_into_a_header(client: TestClient) -> None:
    """Neither X-Forwarded-For nor Forwarded makes a new guesser of him; names change with each guess."""
    guesser = TestClient(client.app, base_url=BASE, client=("10.0.0.7", 1))
    codes = []
    for i in range(8):
        headers = {"x-forwarded-for": f"1.2.3.{i}", "forwarded": f"for=1.2.3.{i}", "x-real-ip": f"1.2.3.{i}"}
        form = {"user": f"name{i}", "password": "guess"}
        codes.append(guesser.post("/sign-in", data=form, headers=headers).status_code)
    assert codes == [403] * 5 + [429] * 3


def test_a_flood_is_refused_by_the_server_as_a_whole_and_others_are_served(tmp_path: Path) -> None:
    app = create(Settings((cell(tmp_path / "one", records=[]),), rate=5.0))
    flood = TestClient(app, base_url=BASE, client=("10.0.0.1", 1))
    answers = [flood.get("/healthz") for _ in range(30)]
    refused = [a for a in answers if a.status_code == 429]
    assert 10 <= len(refused) <= 20 and all(int(a.headers["retry-after"]) >= 1 for a in refused)
    assert TestClient(app, base_url=BASE, client=("10.0.0.2", 1)).get("/healthz").status_code == 200


def test_a_report_that_is_a_link_out_of_the_cell_or_named_so_by_a_record_is_not_shown(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.html").write_text("secret", encoding="utf-8")
    away = [night("HU40T-like", i, artefacts={"folder": f}) for i, f in enumerate(("../out", str(tmp_path / "out"), "in"))]
    folder = cell(tmp_path / "one", records=away)
    (folder / "in").symlink_to(tmp_path / "out")
    (folder / "report.html").symlink_to(tmp_path / "out" / "report.html")
    with TestClient(create(Settings((folder,))), base_url=BASE, client=("127.0.0.1", 1)) as site:
        for path in ("/report", "/report/alone", *(f"/night/{i}/report.html{p}" for i in (1, 2, 3) for p in ("", "/alone"))):
            answer = site.get(f"/machine/HU40T-like{path}")
            assert answer.status_code == 404 and "secret" not in answer.text, path
