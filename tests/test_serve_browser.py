"""A real Chromium on every page: a run that is followed, an alarm that is acknowledged, a report without a network."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.nights import knock, night
from support.server import PASSWORD, Recorded, cell

pytest.importorskip("selenium")
import uvicorn
from click.testing import CliRunner
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from support.browser import DESK, PHONE, Site, axe, chromium, complaints, shown_in, sized, wait

from tango_cnc.cli import tango
from tango_cnc.link.lock import holding
from tango_cnc.nightly.words import changed
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

pytestmark = [pytest.mark.long, pytest.mark.system("chromium", "chromedriver"), pytest.mark.xdist_group("browser")]
PAGES = ("/", "/alarms", *(f"/machine/HU40T-like{p}" for p in ("", "/run", "/trend", "/nights", "/files", "/night/13", "/night/6")))


@pytest.fixture(scope="module")
def browser() -> Iterator[webdriver.Chrome]:
    with chromium() as driver:
        yield driver


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, browser: webdriver.Chrome) -> Iterator[Site]:
    place = tmp_path_factory.mktemp("browser")
    found = Site(place / "hu40t", place / "users.json")
    browser.get(f"{found.base}/")
    browser.switch_to.active_element.send_keys("ann", Keys.TAB, PASSWORD, Keys.ENTER)  # the keyboard alone
    wait(lambda: "Sign out" in browser.page_source)
    yield found
    found.server.should_exit = True


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_every_page_is_whole_accessible_and_fits(size: tuple[int, int], site: Site, browser: webdriver.Chrome) -> None:
    sized(browser, size)
    for path in PAGES:
        browser.get(site.base + path)
        assert not complaints(browser), path
        assert not axe(browser), path
        assert browser.execute_script("return document.documentElement.scrollWidth <= innerWidth"), (
            f"{path} is wider than the screen"
        )
        asked = browser.execute_script("return performance.getEntriesByType('resource').map(e => e.name)")
        assert all(address.startswith((site.base, "data:")) for address in asked), asked


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_two_lines_under_one_word_stay_beside_it(size: tuple[int, int], site: Site, browser: webdriver.Chrome) -> None:
    """A night in doubt has several reasons: all text keeps its column, as wide as the page has room for."""
    sized(browser, size)
    browser.get(f"{site.base}/machine/HU40T-like")
    browser.execute_script("document.querySelector('.facts dd').insertAdjacentHTML('afterend', '<dd>one more</dd>')")
    widths = browser.execute_script("return [...document.querySelectorAll('.facts dd')].map(d => d.getBoundingClientRect().width)")
    assert len(widths) > 3 and min(widths) > 0.5 * size[0]


@pytest.mark.parametrize(("colors", "media"), [("dark", ""), ("light", "print")], ids=["dark", "print"])
def test_every_page_can_be_read_at_night_and_on_paper(colors: str, media: str, site: Site, browser: webdriver.Chrome) -> None:
    sized(browser, DESK)
    shown_in(browser, colors, media)
    try:
        for path in PAGES:
            browser.get(site.base + path)
            assert not axe(browser), path
            dark = "return getComputedStyle(document.querySelector('main')).backgroundColor"
            assert (browser.execute_script(dark) != "rgb(255, 255, 255)") == (colors == "dark")
    finally:
        shown_in(browser)


CUT = """return [...document.querySelectorAll('svg')].filter(s => s.getBoundingClientRect().width).flatMap(s => {
  const box = s.getBoundingClientRect();
  return [...s.querySelectorAll('text')].map(e => [e.textContent, e.getBoundingClientRect()])
    .filter(([_, b]) => b.left < box.left - 0.5 || b.right > box.right + 0.5 || b.top < box.top - 2 || b.bottom > box.bottom + 2)
    .map(([text, b]) => `${text}: ${(b.right - box.right).toFixed(1)} px`)
})"""


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_no_word_of_a_picture_is_cut(size: tuple[int, int], tmp_path: Path) -> None:
    """The last date of the curve was cut by 2 px on a phone, and "X →" of what is still to come at any width."""
    found = Site(tmp_path / "cut", tmp_path / "users.json")
    run = Recorded(found.folder)
    run.begin()
    run.touch()
    try:
        with chromium() as own:  # a sign-in counts for every port of one address
            sized(own, size)
            own.get(f"{found.base}/")
            own.switch_to.active_element.send_keys("ann", Keys.TAB, PASSWORD, Keys.ENTER)
            wait(lambda: "Sign out" in own.page_source)
            for path, word in (("", "Nov"), ("/trend", "Nov"), ("/trend?parameter=EX0C", "Nov"), ("/run", "X →"), ("/nights", "")):
                own.get(f"{found.base}/machine/HU40T-like{path}")
                assert word in own.page_source and not own.execute_script(CUT), path
    finally:
        run.gone()
        found.server.should_exit = True


def test_on_paper_no_word_is_paler_than_paper_prints(site: Site, browser: webdriver.Chrome) -> None:
    """Browsers print without backgrounds: what is white on blue on the screen is white on white there."""
    sized(browser, DESK)
    shown_in(browser, "light", "print")
    words = """return [...document.querySelectorAll('body *')].filter(e => e.offsetWidth && e.childElementCount == 0)
      .filter(e => e.textContent.trim() && !e.closest('svg,select'))
      .map(e => [e.textContent, getComputedStyle(e).color.match(/[\\d.]+/g).slice(0, 3).map(Number)])
      .filter(([_, c]) => Math.min(...c) > 150).map(([text, _]) => text)"""
    try:
        for path in PAGES:
            browser.get(site.base + path)
            assert not browser.execute_script(words), path
    finally:
        shown_in(browser)


def test_a_table_on_a_phone_shows_every_column_or_says_so(site: Site, browser: webdriver.Chrome) -> None:
    sized(browser, PHONE)
    for path in PAGES:
        browser.get(site.base + path)
        for box in browser.find_elements(By.CSS_SELECTOR, ".wide, .chart, table.cards"):
            wider = browser.execute_script("return arguments[0].scrollWidth > arguments[0].clientWidth + 1", box)
            told = browser.execute_script("return getComputedStyle(arguments[0], '::before').content", box)
            assert not wider or "Swipe" in told, (path, box.get_attribute("outerHTML")[:200])
        hidden = browser.execute_script("return [...document.querySelectorAll('td')].filter(e => !e.offsetWidth).length")
        assert not hidden, path


def test_the_morning_fits_one_screen_of_a_phone(site: Site, browser: webdriver.Chrome) -> None:
    sized(browser, PHONE)
    browser.get(f"{site.base}/machine/HU40T-like/night/13")
    browser.execute_script("document.querySelector('.old').remove()")  # on its own morning a night is not old
    bottoms = {}
    for term in browser.find_elements(By.CSS_SELECTOR, ".facts dt"):
        answer = term.find_element(By.XPATH, "following-sibling::dd[1]")
        bottoms[term.text] = answer.rect["y"] + answer.rect["height"]
    for question in ("What changed", "Since when", "What it does to parts", "What to do", "Whom to ask"):
        assert bottoms[question] <= PHONE[1], (question, bottoms)


@pytest.mark.parametrize("width", [320, 360, 700, 1000, 1400])
def test_the_longest_answer_leaves_the_name_of_the_machine_its_room(width: int, site: Site, browser: webdriver.Chrome) -> None:
    """It left 16 px on a phone, for the machine that somebody has to act on; on a desk it ran into the name."""
    sized(browser, (width, 844))
    browser.get(f"{site.base}/")
    browser.execute_script(
        "const li = document.querySelector('.fleet .which').parentElement; li.classList.add('worst');"
        "li.querySelector('.tone').textContent = 'Nobody knows'; li.querySelector('.name').textContent = 'Mill 7 (Halle 2)';"
        "li.querySelector('.age').innerHTML = 'measured 17 days ago<br><b class=\"alarm\">1 open alarm</b>';"
        "li.querySelector('.which').insertAdjacentHTML('beforeend', ' <span class=\"mark\">SIMULATED</span>')"
    )
    box = "(e => {const b = document.querySelector(e).getBoundingClientRect(); return [b.left, b.right, b.top, b.bottom]})"
    sign, word, name, mark, age = (
        browser.execute_script(f"return {box}('.fleet .worst {part}')") for part in (".sign svg", ".tone", ".name", ".mark", ".age")
    )
    which = browser.execute_script(f"return {box}('.fleet .worst .which')")
    assert which[1] - which[0] >= 100 and name[1] - name[0] >= 70 and mark[3] - mark[2] < 30
    apart = [(word, name), (word, mark), (mark, age), (name, age)]
    assert all(a[1] + 4 <= b[0] or b[1] + 4 <= a[0] or a[3] <= b[2] or b[3] <= a[2] for a, b in apart), (word, name, mark, age)
    assert sign[0] >= 0 and age[1] <= width


def test_a_phone_shows_several_alarms_at_once(tmp_path: Path, browser: webdriver.Chrome) -> None:
    """One that fills the screen hides the others."""
    cells = []
    for name in ("Ash", "Elm", "Fir", "Oak"):
        alarm = knock("2026-10-25") | {"text": changed("EX0C", "+19.8 ± 0.4 µm"), "owner": "Ann Meier, 4711"}
        cells.append(cell(tmp_path / name, name, [night(name, 0), night(name, 1, "changed", alarms=[alarm])]))
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    server = uvicorn.Server(uvicorn.Config(create(Settings(tuple(cells))), port=port, log_level="warning"))
    threading.Thread(target=server.run, daemon=True).start()
    wait(lambda: server.started)
    sized(browser, PHONE)
    browser.get(f"http://127.0.0.1:{port}/alarms")
    bottoms = [e.rect["y"] + e.rect["height"] for e in browser.find_elements(By.CSS_SELECTOR, "section.one")]
    server.should_exit = True
    assert len(bottoms) == 4 and sum(b <= PHONE[1] for b in bottoms) >= 3, bottoms


def test_a_machine_of_two_nights_has_signs_no_larger_than_others(tmp_path: Path, browser: webdriver.Chrome) -> None:
    """A row of two signs was drawn as wide as one of thirty: each was as high as the name of the machine four times over."""
    short = Site(tmp_path / "short", tmp_path / "users.json", [night("HU40T-like", 0), night("HU40T-like", 1)])
    base = short.base.replace("127.0.0.1", "localhost")  # a cookie is of a host, whatever the port: the session of `site` stays
    try:
        browser.get(f"{base}/")
        browser.switch_to.active_element.send_keys("ann", Keys.TAB, PASSWORD, Keys.ENTER)
        wait(lambda: "Sign out" in browser.page_source)
        sized(browser, DESK)
        browser.get(f"{base}/")
        row = browser.find_element(By.CSS_SELECTOR, ".strips svg")
        assert 0 < row.rect["height"] <= 16 and 0 < row.rect["width"] <= 28, row.rect
        sized(browser, PHONE)
        made, tab = (browser.find_element(By.CSS_SELECTOR, x).rect for x in (".made", ".top a[aria-current]"))
        size = float(browser.find_element(By.CSS_SELECTOR, ".made").value_of_css_property("padding-top").removesuffix("px"))
        assert made["y"] + size >= tab["y"] + tab["height"] + 3, "the line below the name of the page runs through the date"
    finally:
        short.server.should_exit = True


def test_what_can_be_pressed_is_reached_by_keyboard_and_seen(site: Site, browser: webdriver.Chrome) -> None:
    sized(browser, DESK)
    browser.get(f"{site.base}/alarms")
    browser.find_element(By.CSS_SELECTOR, ".answer summary").click()
    wanted = {
        e.get_attribute("outerHTML")
        for e in browser.find_elements(By.CSS_SELECTOR, "main a, main button, main input:not([type=hidden])")
        if e.is_displayed()  # the first alarm is unfolded
    }
    seen = set()
    for _ in range(60):
        browser.switch_to.active_element.send_keys(Keys.TAB)
        at = browser.switch_to.active_element
        seen.add(at.get_attribute("outerHTML"))
        assert at.tag_name == "body" or browser.execute_script("return getComputedStyle(arguments[0]).outlineStyle", at) != "none"
    assert not {w for w in wanted - seen if 'type="radio"' not in w}  # radio buttons are one stop, then arrows


def test_a_run_is_followed_without_a_reload(site: Site, browser: webdriver.Chrome) -> None:
    sized(browser, DESK)
    run = Recorded(site.folder, 31)
    run.begin()
    run.touch()
    browser.get(f"{site.base}/machine/HU40T-like/run")
    browser.execute_script("window.kept = true")
    for count in range(2, 31):
        run.touch("3" if count % 2 else "4", drift=0.5 if count > 20 else None)
        if count in (10, 25):
            wait(lambda count=count: f"{count} of 31 touches" in browser.page_source)
            assert "Running" in browser.page_source
    run.end(False, "the line was lost")
    wait(lambda: "the line was lost" in browser.page_source)
    run.touch()  # as if somebody had resumed it, and was killed
    wait(lambda: "Broken off" in browser.page_source)
    with holding(site.folder, "tango run"):
        run.touch()
        wait(lambda: "Running" in browser.page_source)
    run.end()
    wait(lambda: "Complete" in browser.page_source)
    assert browser.execute_script("return window.kept") and "Facets touched again" in browser.page_source
    assert not axe(browser) and not complaints(browser)


@pytest.mark.parametrize("path", ["/machine/HU40T-like", "/machine/HU40T-like/run"])
def test_a_page_that_stands_open_says_that_it_is_old(path: str, site: Site, browser: webdriver.Chrome) -> None:
    """A telephone in a pocket shows the page of the day before. The page of a run that is followed stays of now."""
    sized(browser, PHONE)
    browser.get(f"{site.base}{path}")
    assert "This page: " in browser.page_source and "old: load it again" not in browser.find_element(By.CSS_SELECTOR, ".made").text
    browser.execute_script("var now = Date.now; Date.now = function () { return now() + 660000; }")
    wait(lambda: "load it again" in browser.find_element(By.CSS_SELECTOR, ".made").text or path.endswith("/run"))
    if path.endswith("/run"):
        time.sleep(6)
        assert "load it again" not in browser.find_element(By.CSS_SELECTOR, ".made").text
    assert browser.execute_script("return document.documentElement.scrollWidth") <= PHONE[0] and not axe(browser)


def test_the_page_of_a_run_says_that_nobody_answers_any_more(site: Site, browser: webdriver.Chrome) -> None:
    """A computer that lost its network showed a machine that measures, for ten minutes."""
    sized(browser, PHONE)
    browser.get(f"{site.base}/machine/HU40T-like/run")
    browser.execute_script("window.heard = window.fetch; window.fetch = function () { return Promise.reject(0); }")
    browser.execute_script("window.clock = Date.now; Date.now = function () { return clock() + 20000; }")
    made = (By.CSS_SELECTOR, ".made")
    wait(lambda: "has not answered since" in browser.find_element(*made).text)
    assert browser.find_element(*made).get_attribute("class") == "made old"
    browser.execute_script("window.fetch = window.heard")
    wait(lambda: "has not answered since" not in browser.find_element(*made).text, 60)


def test_a_page_without_a_report_is_accessible(tmp_path: Path, browser: webdriver.Chrome) -> None:
    bare = Site(tmp_path / "bare", tmp_path / "users.json")
    base = bare.base.replace("127.0.0.1", "localhost")  # a cookie is of a host, whatever the port: the session of `site` stays
    for file in bare.folder.glob("report*"):
        file.unlink()
    try:
        browser.get(f"{base}/")
        browser.switch_to.active_element.send_keys("ann", Keys.TAB, PASSWORD, Keys.ENTER)
        wait(lambda: "Sign out" in browser.page_source)
        browser.get(f"{base}/machine/HU40T-like/report")
        assert "No report was written yet" in browser.page_source and not axe(browser)
        assert all("404" in one for one in complaints(browser)), "there is no report"
    finally:
        bare.server.should_exit = True


def test_an_alarm_is_acknowledged(site: Site, browser: webdriver.Chrome) -> None:
    sized(browser, PHONE)
    browser.get(f"{site.base}/machine/HU40T-like/night/13")
    browser.find_element(By.LINK_TEXT, "Open alarms").click()
    assert not browser.find_element(By.CSS_SELECTOR, "input[name=note]").is_displayed()
    browser.find_element(By.CSS_SELECTOR, ".answer summary").click()
    assert not browser.find_elements(By.CSS_SELECTOR, ".decide input:checked")  # nothing is decided beforehand
    browser.find_element(By.CSS_SELECTOR, "input[value=acknowledge]").click()
    browser.find_element(By.CSS_SELECTOR, "input[name=note]").send_keys("I look at it before the first shift")
    browser.find_element(By.CSS_SELECTOR, ".decide button.main").click()
    wait(lambda: "No alarm waits for an answer." in browser.page_source)
    assert "acknowledged, not closed" in browser.page_source  # it stays in the list, with who has it
    browser.get(f"{site.base}/machine/HU40T-like/night/13")
    assert "ann (acknowledged)" in browser.page_source


def test_a_report_opens_without_a_network_and_can_be_turned(browser: webdriver.Chrome, tmp_path: Path) -> None:
    folder = cell(tmp_path / "hu40t", records=[])
    for command in ("simulate", "report"):
        more = ["--readings", str(readings(folder))] if command == "report" else []
        found = CliRunner().invoke(tango, [command, "-C", str(folder), *more], standalone_mode=False)
        assert found.exception is None, found.output
    sized(browser, DESK)
    browser.execute_cdp_cmd("Network.enable", {})
    offline = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}
    browser.execute_cdp_cmd("Network.emulateNetworkConditions", offline)
    try:
        browser.get((folder / "report.html").as_uri())
        assert not complaints(browser) and not axe(browser)
        assert browser.execute_script("return performance.getEntriesByType('resource').length") == 0
        canvas = browser.find_element(By.TAG_NAME, "canvas")
        before = browser.execute_script("return arguments[0].toDataURL()", canvas)
        for _ in range(40):  # by Tab alone, and it is seen where one is
            browser.switch_to.active_element.send_keys(Keys.TAB)
            if browser.switch_to.active_element == canvas:
                break
        assert browser.switch_to.active_element == canvas
        assert browser.execute_script("return getComputedStyle(arguments[0]).outlineStyle", canvas) != "none"
        canvas.send_keys(Keys.ARROW_LEFT, Keys.ARROW_UP)
        turned = browser.execute_script("return arguments[0].toDataURL()", canvas)
        assert turned != before
        browser.find_element(By.CSS_SELECTOR, "[data-do=set][data-value='0']").click()
        assert browser.execute_script("return arguments[0].toDataURL()", canvas) != turned
        for colors, media in (("dark", ""), ("light", "print"), ("light", "")):
            shown_in(browser, colors, media)
            assert not axe(browser), (colors, media)
        sized(browser, PHONE)
        assert browser.execute_script("return document.documentElement.scrollWidth <= innerWidth")
    finally:
        browser.execute_cdp_cmd(
            "Network.emulateNetworkConditions", offline | {"offline": False, "downloadThroughput": -1, "uploadThroughput": -1}
        )


def readings(folder: Path) -> Path:
    """What `tango simulate` has written."""
    return next(f for f in (folder / "simulated.csv", folder / "readings.csv") if f.exists())


def test_a_run_page_that_stays_open_shows_every_run_that_begins(tmp_path: Path, browser: webdriver.Chrome) -> None:
    found = Site(tmp_path / "one", tmp_path / "users.json")
    next(found.folder.glob("*.journal")).unlink()
    sized(browser, DESK)
    browser.get(f"{found.base}/machine/HU40T-like/run")
    browser.switch_to.active_element.send_keys("ann", Keys.TAB, PASSWORD, Keys.ENTER)
    wait(lambda: "There is no run" in browser.page_source)  # the sign-in has led back to this page
    run = Recorded(found.folder, 20)
    run.begin()
    for _ in range(4):
        run.touch()
    wait(lambda: "4 of 20 touches" in browser.page_source, 20)
    run.touch()
    wait(lambda: "5 of 20 touches" in browser.page_source, 20)
    run.end()
    wait(lambda: "Complete" in browser.page_source, 20)
    (found.folder / "readings.journal").rename(found.folder / "readings.2026-11-23.journal")
    run = Recorded(found.folder, 30)
    run.begin()
    run.touch()
    wait(lambda: "1 of 30 touches" in browser.page_source, 20)
    found.server.should_exit = True
