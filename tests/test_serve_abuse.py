"""What people try against a server: forged cookies and forms, paths out of the folder, broken requests, names that are code."""

from __future__ import annotations

import re
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.nights import knock, night
from support.server import PASSWORD, cell

pytest.importorskip("starlette")
import uvicorn
from starlette.testclient import TestClient

from tango_cnc.records import InputError
from tango_cnc.web import patience
from tango_cnc.web.app import create
from tango_cnc.web.guard import Buckets
from tango_cnc.web.served import slug_of
from tango_cnc.web.settings import Settings
from tango_cnc.web.users import add_user, read_users

pytestmark = pytest.mark.long
EVIL = """<script>alert(1)</script>'"><img src=x onerror=alert(2)>{{7*7}}${7*7}../../etc/passwd"""
HOST = "http://127.0.0.1"
OWN = {"tango_sign_in": "x" * 43}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    place = tmp_path_factory.mktemp("abuse")
    alarm = {**knock("2026-10-25"), "text": EVIL, "on_part": EVIL, "do": EVIL, "cause": EVIL, "instead": [EVIL], "owner": EVIL}
    limit = {"what": EVIL, "value": 75.9, "low": 74.0, "high": 77.8, "limit": 60.0, "unit": EVIL, "passed": False}
    more = {"standing": [{**alarm, "id": EVIL, "now": EVIL, "parameter": EVIL}], "behind": [{**alarm, "id": EVIL, "what": EVIL}]}
    more |= {"artefacts": {"folder": "../../../etc"}}
    more |= {"limits": [limit], "owner": EVIL, "why": EVIL, "next": {"kind": EVIL, "why": EVIL}}
    records = [
        night(EVIL, 0),
        night(EVIL, 1, "changed", headline=EVIL, alarms=[alarm], **more),
    ]
    folder = cell(place / "one", EVIL, records)
    add_user(place / "users.json", "ann", PASSWORD, "operate")
    with TestClient(create(Settings((folder,), users=place / "users.json")), base_url=HOST, client=("127.0.0.1", 1)) as client:
        client.post("/sign-in", data={"user": "ann", "password": PASSWORD})
        yield client


def anybody(site: TestClient, **more: object) -> TestClient:
    return TestClient(site.app, base_url=HOST, client=("127.0.0.1", 2), **more)  # type: ignore[arg-type]


def test_names_that_are_code_are_text_on_every_page(site: TestClient) -> None:
    slug = slug_of(EVIL)
    assert re.fullmatch(r"[A-Za-z0-9_-]+", slug)
    paths = ["/", "/alarms", *(f"/machine/{slug}{p}" for p in ("", "/run", "/trend", "/nights", "/files", "/night/2", "/report"))]
    for path in paths:
        answer = site.get(path)
        assert answer.status_code in (200, 404), (path, answer.status_code)
        assert "alert(" in answer.text, path
        assert "<script>alert" not in answer.text and "<img" not in answer.text and ">49<" not in answer.text, path
    metrics = site.get("/metrics").text
    assert len([line for line in metrics.splitlines() if line.startswith("tango_machine_nights")]) == 1


def test_without_a_sign_in_only_the_door_is_there(site: TestClient) -> None:
    slug = slug_of(EVIL)
    stranger = anybody(site)
    for path in ("/", "/alarms", f"/machine/{slug}", f"/machine/{slug}/files/readings.csv", f"/machine/{slug}/run/step"):
        answer = stranger.get(path, follow_redirects=False)
        wanted = "/sign-in" if path == "/" or path.endswith(".csv") else f"/sign-in?next={path}"  # where to go on, and nothing else
        assert (answer.status_code, answer.headers.get("location")) == (303, wanted), path
    assert stranger.get("/healthz").text == "ok\n"
    away = TestClient(site.app, base_url=HOST, client=("10.0.0.9", 2))
    assert away.get("/metrics").status_code == 403


@pytest.mark.parametrize("key", ["", "x", "x" * 43, "x" * 5000, "../../x", "%00", "a; b=c", '"', "{}"])
def test_forged_cookies_are_nobody(key: str, site: TestClient) -> None:
    answer = anybody(site).get("/", headers={"cookie": f"tango_sign_in={key}"}, follow_redirects=False)
    assert answer.status_code == 303 and answer.headers["location"] == "/sign-in"


def test_a_form_needs_the_token_of_its_sign_in_and_its_own_site(site: TestClient) -> None:
    path = f"/machine/{slug_of(EVIL)}/decide"
    good = re.findall(r'name="csrf" value="([^"]+)"', site.get("/").text)[0]
    form = {"alarm": "2026-10-25-1", "action": "accept"}
    for token in ("", "x", good[:-1], good + "x", "é"):
        assert site.post(path, data={**form, "csrf": token}).status_code in (400, 403), token
    assert site.post(path, data=form).status_code == 403
    for headers in (
        {"origin": "http://evil.example"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
        {"origin": "null"},
    ):
        assert site.post(path, data={**form, "csrf": good}, headers=headers).status_code == 403, headers
    for kind in ("application/json", "text/plain", "multipart/form-data; boundary=x"):
        assert site.post(path, content=b"{}", headers={"content-type": kind}).status_code == 415, kind
    for spoilt in ({"alarm": "nothing"}, {"action": "delete"}, {"action": "ignore"}, {"action": "ignore", "until": "../x"}):
        answer = site.post(path, data={**form, "csrf": good, **spoilt})
        assert answer.status_code == 400 and "was not recorded" in answer.text, spoilt


def test_guessing_passwords_is_slowed_down_by_address_and_by_name(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one", records=[])
    users = tmp_path / "users.json"
    add_user(users, "ann", PASSWORD, "view")
    app = create(Settings((folder,), users=users))
    guesser = TestClient(app, base_url=HOST, client=("10.0.0.1", 1))
    codes = [guesser.post("/sign-in", data={"user": "ann", "password": f"guess {i}"}).status_code for i in range(8)]
    assert codes == [403] * 5 + [429] * 3
    other = TestClient(app, base_url=HOST, client=("10.0.0.2", 1))
    assert other.post("/sign-in", data={"user": "ann", "password": PASSWORD}).status_code == 429  # the name waits as well
    answer = other.post("/sign-in", data={"user": "nobody", "password": "x"})
    assert answer.status_code == 403 and "Name or password is wrong." in answer.text


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example", "", "localhost@evil.example", "evil.example/127.0.0.1", "[::1"]
)
def test_another_name_of_the_server_is_refused(host: str, site: TestClient) -> None:
    assert site.get("/", headers={"host": host}).status_code == 421


@pytest.mark.parametrize(
    "tail",
    [
        *("..%2f..%2f..%2fetc%2fpasswd", "../../../../etc/passwd", "%2e%2e/%2e%2e/etc/passwd", "..\\..\\windows\\win.ini"),
        *(
            "program/..%2f..%2fmachine.yaml",
            "/etc/passwd",
            "//etc/passwd",
            "%00",
            "readings.csv%00.html",
            "program/.hidden",
            "~root",
        ),
    ],
)
def test_no_path_leads_out_of_the_list_of_files(tail: str, site: TestClient) -> None:
    slug = slug_of(EVIL)
    for path in (f"/machine/{slug}/files/{tail}", f"/static/{tail}", f"/machine/{tail}", f"/machine/{slug}/night/2/{tail}"):
        answer = site.get(path)
        assert answer.status_code == 404, (path, answer.status_code)
        assert "root:" not in answer.text


def test_links_out_of_the_cell_are_not_offered(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one", records=[])
    (tmp_path / "secret").write_text("secret", encoding="utf-8")
    (folder / "program").mkdir()
    (folder / "program" / "O1.nc").symlink_to(tmp_path / "secret")
    (folder / "readings.csv").symlink_to(tmp_path / "secret")
    with TestClient(create(Settings((folder,))), base_url=HOST) as site:
        assert "O1.nc" not in site.get("/machine/HU40T-like/files").text
        for name in ("program/O1.nc", "readings.csv"):
            assert site.get(f"/machine/HU40T-like/files/{name}").status_code == 404


def test_what_is_too_large_or_broken_is_refused(site: TestClient) -> None:
    form = {"content-type": "application/x-www-form-urlencoded"}
    assert site.post("/sign-in", content=b"a" * 20_000, headers=form).status_code == 413
    assert site.post("/sign-in", content=iter([b"a=b&" * 1000] * 8), headers=form).status_code == 413
    assert site.post("/sign-in", content=b"&".join(b"a=1" for _ in range(500)), headers=form).status_code == 400
    assert site.post("/sign-in", content=b"user=\xff\xfe", headers=form).status_code == 400
    assert site.get("/?" + "a" * 3000).status_code == 414
    for method in ("PUT", "DELETE", "PATCH", "TRACE", "OPTIONS", "CONNECT"):
        assert site.request(method, "/").status_code == 405, method
    for path in ("/run?run=-1", "/run?run=99999999999", "/run?run=x", "/night/0", "/night/99999999999999999999", "/night/x"):
        assert (
            site.get(f"/machine/{slug_of(EVIL)}{path}").status_code == 404
            or "There is no run" in site.get(f"/machine/{slug_of(EVIL)}{path}").text
        ), path


def test_every_answer_carries_its_headers(site: TestClient) -> None:
    slug = slug_of(EVIL)
    for answer in (
        site.get("/"),
        site.get("/nothing"),
        site.get("/static/app.css"),
        site.get(f"/machine/{slug}/run"),
        site.put("/"),
    ):
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy and "unsafe" not in policy and "frame-ancestors 'none'" in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "same-origin"
        assert "server" not in answer.headers
    text = site.get("/").text
    assert " style=" not in text and " onclick=" not in text and "<style" not in text  # the policy allows none


def test_the_cookie_is_out_of_reach_of_scripts_and_other_sites(tmp_path: Path) -> None:
    users = tmp_path / "users.json"
    add_user(users, "ann", PASSWORD, "view")
    folder = cell(tmp_path / "one", records=[])
    for https in (False, True):
        site = TestClient(create(Settings((folder,), users=users, https=https)), base_url=HOST)
        answer = site.post("/sign-in", data={"user": "ann", "password": PASSWORD}, follow_redirects=False)
        cookie = answer.headers["set-cookie"].lower()
        assert "httponly" in cookie and "samesite=strict" in cookie and ("secure" in cookie) == https
        assert ("strict-transport-security" in answer.headers) == https


def test_a_flood_of_requests_is_refused() -> None:
    now = [0.0]
    buckets = Buckets(10.0, 20.0, keys=100, clock=lambda: now[0])
    assert sum(buckets.take("a") == 0 for _ in range(50)) == 20
    assert 0 < buckets.take("a") <= 0.1 and buckets.take("b") == 0
    now[0] = 1.0
    assert sum(buckets.take("a") == 0 for _ in range(50)) == 10
    for i in range(1000):
        buckets.take(str(i))
    assert len(buckets._left) == 100


def test_the_file_of_users_is_kept_from_others(tmp_path: Path) -> None:
    users = tmp_path / "users.json"
    add_user(users, "ann", PASSWORD, "view")
    assert users.stat().st_mode & 0o777 == 0o600
    assert PASSWORD not in users.read_text(encoding="utf-8") and "$argon2id$" in users.read_text(encoding="utf-8")
    users.chmod(0o644)
    with pytest.raises(InputError, match="others may read it"):
        read_users(users)
    for name, password in (("../x", PASSWORD), ("", PASSWORD), ("a" * 65, PASSWORD), ("ann", "short"), ("ann", "x" * 300)):
        with pytest.raises(InputError):
            add_user(tmp_path / "other.json", name, password, "view")


def test_one_address_leaves_connections_for_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """1500 half-open connections of one computer kept everybody out for 15 s."""
    monkeypatch.setattr(patience, "OF_ONE", 3)
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    app = create(Settings((cell(tmp_path / "one", records=[]),)))
    server = uvicorn.Server(uvicorn.Config(app, port=port, http=patience.Patient, log_level="warning", proxy_headers=False))
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.05)
    ask = b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n"

    def asked() -> bytes:
        with socket.create_connection(("127.0.0.1", port), timeout=60) as one:
            try:
                one.sendall(ask)
                return one.recv(4096)
            except OSError:
                return b""

    try:
        held = [socket.create_connection(("127.0.0.1", port), timeout=60) for _ in range(3)]
        assert b"200" not in asked()
        for one in held:
            one.close()
        until = time.monotonic() + 60
        while b"200" not in asked():
            assert time.monotonic() < until
            time.sleep(0.05)
    finally:
        server.should_exit = True
        thread.join(20)


def test_headers_have_a_limit_and_large_pages_are_compressed(tmp_path: Path) -> None:
    folders = tuple(cell(tmp_path / f"{i}", f"machine {i}") for i in range(2))
    with TestClient(create(Settings(folders)), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        assert site.get("/", headers={"x-much": "a" * 17_000}).status_code == 431
        (folders[0] / "report.html").write_text("<p>long</p>" * 9000)
        slug = next(iter(site.app.state.tango.places.machines()))  # type: ignore[attr-defined]
        answer = site.get(f"/machine/{slug}/report/alone")
        assert answer.headers["content-encoding"] == "gzip" and answer.text.count("long") == 9000
        assert "content-encoding" not in site.get("/healthz").headers


def test_a_connection_that_says_too_little_too_slowly_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Half a head, half a body, half a head after an answer; hundreds of them would take every place of the server, and each half
    body filled its log with a traceback.
    """
    monkeypatch.setattr(patience, "WAIT", 1.0)
    folder = cell(tmp_path / "one", records=[])
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    server = uvicorn.Server(uvicorn.Config(create(Settings((folder,))), port=port, http=patience.Patient, log_config=None))
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.05)
    head = b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n"
    form = b"POST /sign-in HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/x-www-form-urlencoded\r\nContent-Length: 9\r\n"
    try:
        for said in (b"", head + b"X-", head + b"\r\n" + head + b"X-", form + b"\r\na="):
            with socket.create_connection(("127.0.0.1", port), timeout=120) as slow:
                slow.sendall(said)
                began, answered = time.monotonic(), b""
                while got := slow.recv(4096):
                    answered += got
                assert 0.5 < time.monotonic() - began < 90, said
                assert (b"200 OK" in answered) == (said.count(b"GET") == 2)
    finally:
        server.should_exit = True
        thread.join(20)
    assert not [one.message for one in caplog.records if one.exc_info or one.levelname == "ERROR"]
