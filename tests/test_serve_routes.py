"""Every route of the pages with whatever a stranger may send: an answer or a clear refusal, and what a passive scanner asks for."""

from __future__ import annotations

import re
from collections.abc import Iterator
from urllib.parse import quote

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from support.server import PASSWORD, cell

pytest.importorskip("starlette")
from starlette.routing import Route
from starlette.testclient import TestClient

from tango_cnc.web.app import create
from tango_cnc.web.served import slug_of
from tango_cnc.web.settings import Settings
from tango_cnc.web.users import add_user

pytestmark = pytest.mark.long
HOST = "http://127.0.0.1"
NAME = "HU40T-like"
REFUSALS = {400, 401, 403, 404, 405, 413, 414, 415, 421, 429}
NASTY = (
    *("../../../../etc/passwd", "..%2f..%2fetc%2fpasswd", "%2e%2e/", "....//....//", "..\\..\\win.ini", "\x00", "a" * 1500),
    *("'; DROP TABLE night;--", "<svg/onload=alert(1)>", "{{7*7}}", "${jndi:ldap://x}", "%n%s", "é\u202e\U0001f600"),
    *("-1", "99999999999999999999", "NaN"),
)
anything = st.one_of(st.sampled_from(NASTY), st.text(st.characters(codec="utf-8"), max_size=30))


@pytest.fixture(scope="module", params=["view only", "users"])
def site(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    place = tmp_path_factory.mktemp("routes")
    folder, users = cell(place / "one"), None
    if request.param == "users":
        users = place / "users.json"
        add_user(users, "ann", PASSWORD, "write-back")
    options = Settings((folder,), users=users, rate=1e9)
    with TestClient(create(options), base_url=HOST, client=("127.0.0.1", 1), raise_server_exceptions=False) as client:
        if users is not None:
            client.post("/sign-in", data={"user": "ann", "password": PASSWORD})
        yield client


def paths(site: TestClient) -> list[str]:
    """→ the pattern of every route that the application has."""
    return sorted({r.path for r in site.app.routes if isinstance(r, Route)})  # type: ignore[attr-defined]


def filled(pattern: str, slug: str, value: str) -> str:
    """Pattern, slug, anything → an address."""
    known = pattern.replace("{slug}", slug)
    return re.sub(r"\{[^}]*\}", lambda _: quote(value, safe="/%"), known)


@settings(max_examples=600, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.data(),
    where=anything,
    key=anything,
    value=anything,
    cookie=st.text("abcXYZ019_-%=./", max_size=60),
    posted=st.booleans(),
)
@example(data=None, where="1", key="run", value="1", cookie="", posted=False)
def test_nothing_ends_in_an_error_of_the_server(
    site: TestClient, data: st.DataObject | None, where: str, key: str, value: str, cookie: str, posted: bool
) -> None:
    every = paths(site) if data is None else [data.draw(st.sampled_from(paths(site)))]
    for pattern in every:
        slug = slug_of(NAME) if len(where) % 3 else quote(where, safe="")
        query = f"?{quote(key)}={quote(value)}"
        address = filled(pattern, slug, where) + query
        headers = {"cookie": f"tango_sign_in={cookie}"} if cookie and len(cookie) % 2 else {}
        if posted:
            body = f"{quote(key)}={quote(value)}&csrf={quote(where)}&alarm={quote(value)}&action={quote(key)}&user={quote(key)}"
            form = {"content-type": "application/x-www-form-urlencoded"}
            answer = site.post(address, content=body, headers={**headers, **form}, follow_redirects=False)
        else:
            answer = site.get(address, headers=headers, follow_redirects=False)
        assert answer.status_code in {200, 303, 304, 307} | REFUSALS, (address[:200], answer.status_code, answer.text[:200])
        assert "Traceback" not in answer.text and "root:x:" not in answer.text
        assert "<svg/onload" not in answer.text and ">49<" not in answer.text
        if "location" in answer.headers:
            assert re.match(rf"(/(?!/)|{HOST}/)", answer.headers["location"]), answer.headers["location"]


SCANNED = {  # rule of a passive scanner (ZAP's number) → what an answer must have for it to be silent
    "10020 anti-clickjacking": ("x-frame-options", "DENY|SAMEORIGIN"),
    "10021 content type options": ("x-content-type-options", "nosniff"),
    "10038 content policy": ("content-security-policy", r"default-src 'none'"),
    "10055 content policy without form and frame rules": ("content-security-policy", r"form-action 'self'; frame-ancestors 'none'"),
    "10063 permissions policy": ("permissions-policy", r"camera=\(\)"),
    "10019 content type": ("content-type", r"\w+/[\w.+-]+"),
    "90004 site isolation, opener": ("cross-origin-opener-policy", "same-origin"),
    "90004 site isolation, resource": ("cross-origin-resource-policy", "same-origin"),
    "90004 site isolation, embedder": ("cross-origin-embedder-policy", "require-corp"),
    "10015 cache": ("cache-control", "no-store|max-age=3600"),
}
TELLTALE = (
    "server",
    "x-powered-by",
    "x-aspnet-version",
    "x-debug-token",
    "access-control-allow-origin",
    "x-backend-server",
)  # 10036 …


@pytest.mark.parametrize("rule", SCANNED)
def test_a_passive_scanner_finds_nothing(rule: str, site: TestClient) -> None:
    header, wanted = SCANNED[rule]
    for pattern in paths(site):
        answer = site.get(filled(pattern, slug_of(NAME), "1"), follow_redirects=False)
        if answer.status_code != 303 or header != "content-type":
            assert re.search(wanted, answer.headers.get(header, "")), (pattern, answer.headers.get(header))


def test_no_answer_tells_more_than_its_page(site: TestClient) -> None:
    assert len(paths(site)) >= 17
    for pattern in paths(site):
        answer = site.get(filled(pattern, slug_of(NAME), "1"), follow_redirects=False)
        assert not set(TELLTALE) & set(answer.headers), pattern
        assert "unsafe" not in answer.headers["content-security-policy"] and "*" not in answer.headers["content-security-policy"]
        if not answer.headers.get("content-type", "").startswith("text/html"):
            continue
        assert "charset=utf-8" in answer.headers["content-type"]  # 90011
        addresses = re.findall(r"(?:src|href|action)=[\"']([^\"']*)", answer.text)
        assert not [a for a in addresses if re.match(r"(https?:)?//", a)], pattern  # 10017, 10040, 90003: nothing foreign
        assert not re.search(r"<!--.*(todo|fixme|bug|password|secret|debug)", answer.text, re.IGNORECASE), pattern  # 10027
        for form in re.findall(r"<form[^>]*method=\"?post.*?</form>", answer.text, re.IGNORECASE | re.DOTALL):
            assert 'name="csrf"' in form or "/sign-in" in form, pattern  # 10202
