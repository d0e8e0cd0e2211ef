"""Pages for who sees no colors, has no mouse, or prints in grey; and every page as each role has it, by axe-core."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("selenium")
pytest.importorskip("PIL")
from PIL import Image
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from support.browser import DESK, PHONE, Site, axe, chromium, complaints, shown_in, signed_in, sized, wait
from support.server import PASSWORD

from tango_cnc.report.template import environment
from tango_cnc.web.users import add_user

pytestmark = [pytest.mark.long, pytest.mark.system("chromium", "chromedriver"), pytest.mark.xdist_group("browser")]
M = "/machine/HU40T-like"
SEEN = {  # linear RGB as others see it (Machado, Oliveira, Fernandes 2009, severity 1), and as a grey printer prints it
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    "grey": [[0.2126, 0.7152, 0.0722]] * 3,
}
LEVELS = ("good", "look", "stop", "unknown", "none")


@pytest.fixture(scope="module")
def browser() -> Iterator[webdriver.Chrome]:
    with chromium() as driver:
        yield driver


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    place = tmp_path_factory.mktemp("eyes")
    users = place / "users.json"
    for name, role in (("vic", "view"), ("wes", "write-back")):
        add_user(users, name, PASSWORD, role)
    found = Site(place / "hu40t", users)
    (found.folder / "compensations").mkdir()
    (found.folder / "compensations" / "one.txt").write_text("1\n", encoding="utf-8")
    (found.folder / "report.html").write_text(
        "<!DOCTYPE html><html lang='en'><title>R</title><main><h1>R</h1></main>", encoding="utf-8"
    )
    yield found
    found.server.should_exit = True


@pytest.mark.parametrize(
    ("user", "paths"),
    [
        ("", ("/sign-in", "/sign-in?next=/alarms&lost=1")),
        ("vic", ("/", "/alarms", M, f"{M}/files", f"{M}/report", "/nothing")),
        ("wes", ("/alarms", f"{M}/files", f"{M}/run", f"{M}/trend?parameter=EX0C", f"{M}/nights?page=1")),
    ],
    ids=["nobody", "view", "write-back"],
)
def test_every_role_has_pages_that_can_be_read_by_ear(
    user: str, paths: tuple[str, ...], site: Site, browser: webdriver.Chrome
) -> None:
    """With all that is folded open, in light and in dark."""
    sized(browser, DESK)
    browser.delete_all_cookies()
    if user:
        signed_in(browser, site.base, user)
    try:
        for colors in ("light", "dark"):
            shown_in(browser, colors)
            for path in paths:
                browser.get(site.base + path)
                browser.execute_script("document.querySelectorAll('details').forEach(d => d.open = true)")
                assert not axe(browser), (user, colors, path)
                assert all("404" in one for one in complaints(browser)), (user, path)
    finally:
        shown_in(browser)


def _to(browser: webdriver.Chrome, selector: str, most: int = 60) -> None:
    """browser, selector → Tab until what it names has the focus; every stop on the way can be seen."""
    for _ in range(most):
        browser.switch_to.active_element.send_keys(Keys.TAB)
        at = browser.switch_to.active_element
        style = browser.execute_script("const s = getComputedStyle(arguments[0]); return [s.outlineStyle, s.outlineWidth]", at)
        assert at.tag_name in ("body", "iframe") or (style[0] != "none" and style[1] != "0px"), at.get_attribute("outerHTML")[:200]
        if browser.execute_script("return arguments[0].matches(arguments[1])", at, selector):
            return
    raise AssertionError(f"{selector} is not reached by Tab")


def _press(browser: webdriver.Chrome, *keys: str) -> None:
    browser.switch_to.active_element.send_keys(*keys)


def test_an_alarm_is_answered_by_the_keyboard_alone(site: Site, browser: webdriver.Chrome) -> None:
    """From the sign-in over the list to the recorded decision, with Tab, Enter, space, arrows and letters."""
    sized(browser, DESK)
    signed_in(browser, site.base, "ann")
    _to(browser, ".fleet .thing summary")
    _press(browser, Keys.ENTER)
    assert browser.find_element(By.CSS_SELECTOR, ".fleet .thing").get_attribute("open")
    browser.get(f"{site.base}/")
    _to(browser, ".fleet .name")
    _press(browser, Keys.ENTER)
    wait(lambda: browser.current_url.endswith(M))
    for folded in browser.find_elements(By.CSS_SELECTOR, "main summary"):
        assert folded.get_property("tabIndex") >= 0
    _to(browser, ".engineer > summary")
    _press(browser, Keys.ENTER)
    assert browser.find_element(By.CSS_SELECTOR, ".engineer").get_attribute("open")
    browser.get(f"{site.base}/")
    _to(browser, 'a[href="/alarms"]')
    _press(browser, Keys.ENTER)
    wait(lambda: browser.current_url.endswith("/alarms"))
    _to(browser, ".answer > summary")
    _press(browser, Keys.ENTER)
    _to(browser, ".decide input[type=radio]")
    _press(browser, Keys.SPACE)
    while browser.switch_to.active_element.get_attribute("value") != "acknowledge":
        _press(browser, Keys.ARROW_DOWN)
    assert browser.switch_to.active_element.is_selected()
    _to(browser, "input[name=note]")
    _press(browser, "before the first shift")
    _to(browser, ".decide button.main")
    _press(browser, Keys.ENTER)
    wait(lambda: "acknowledged, not closed" in browser.page_source)
    _to(browser, ".top form button")
    _press(browser, Keys.ENTER)
    wait(lambda: "Sign out" not in browser.page_source)


def _picture(browser: webdriver.Chrome, selector: str) -> np.ndarray:
    """browser, selector → (h, w, 3) linear RGB of what it names, as it is shown."""
    box = browser.execute_script(
        "const b = document.querySelector(arguments[0]).getBoundingClientRect();"
        "return [b.x + scrollX, b.y + scrollY, b.width, b.height]",
        selector,
    )
    clip = {"x": box[0], "y": box[1], "width": box[2], "height": box[3], "scale": 2}
    shot = browser.execute_cdp_cmd("Page.captureScreenshot", {"format": "png", "clip": clip, "captureBeyondViewport": True})
    found = np.asarray(Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB"), dtype=float) / 255
    return np.where(found <= 0.04045, found / 12.92, ((found + 0.055) / 1.055) ** 2.4)


def _brightness(seen: np.ndarray) -> np.ndarray:
    return np.clip(seen, 0, 1) @ [0.2126, 0.7152, 0.0722]


@pytest.mark.parametrize("eyes", list(SEEN))
def test_signs_differ_for_who_sees_no_colors(eyes: str, site: Site, browser: webdriver.Chrome, tmp_path: Path) -> None:
    """Every two signs differ by their shape, and each stands out from the page, through these eyes and on grey paper."""
    sign = environment(None).from_string('{% from "_parts.html" import sign %}{{ sign(level, 60) }}')
    style = "".join(f"<p id={level} class={level} style='margin:9px;width:60px'>{sign.render(level=level)}</p>" for level in LEVELS)
    sheet = environment(None).from_string('{% include "style.css" %}').render()
    page = tmp_path / "signs.html"
    page.write_text(f"<!DOCTYPE html><meta charset=utf-8><style>{sheet}</style><main>{style}</main>", encoding="utf-8")
    sized(browser, DESK)
    browser.get(page.as_uri())
    shapes = {}
    for level in LEVELS:
        light = _brightness(_picture(browser, f"#{level} svg") @ np.array(SEEN[eyes]).T)
        assert (1.05 / (light.min() + 0.05)) >= 3, (level, "it does not stand out from the page")
        shapes[level] = light < 0.5
    for i, one in enumerate(LEVELS):
        for other in LEVELS[i + 1 :]:
            differ = np.mean(shapes[one] != shapes[other])
            assert differ > 0.03, (one, other, differ)


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_a_state_is_said_by_a_word_beside_its_color(size: tuple[int, int], site: Site, browser: webdriver.Chrome) -> None:
    """What has the color of a level has a word or a sign with a name in it: nothing is said by color alone."""
    sized(browser, size)
    signed_in(browser, site.base, "vic")
    for path in ("/", "/alarms", M, f"{M}/run", f"{M}/nights", f"{M}/night/13"):
        browser.get(site.base + path)
        mute = browser.execute_script(
            "return [...document.querySelectorAll('main .good, main .look, main .stop, main .unknown')]"
            ".filter(e => e.offsetWidth && !e.textContent.trim() && !e.querySelector('title'))"
            ".filter(e => !e.closest('[role=img],[aria-label]'))"
            ".map(e => e.outerHTML.slice(0, 200))"
        )
        assert not mute, (path, mute)


def test_paper_has_what_to_do_and_when_it_was_printed(site: Site, browser: webdriver.Chrome) -> None:
    """On a list that was printed each machine had its answer and nothing to do, and nobody saw of which morning it was."""
    sized(browser, DESK)
    signed_in(browser, site.base, "vic")
    shown_in(browser, "light", "print")
    try:
        browser.get(f"{site.base}/")
        for selector in (".fleet .thing summary", ".made", ".fleet .tone"):
            assert browser.find_element(By.CSS_SELECTOR, selector).is_displayed(), selector
        assert not browser.find_element(By.CSS_SELECTOR, ".top form button").is_displayed() and not axe(browser)
    finally:
        shown_in(browser)
