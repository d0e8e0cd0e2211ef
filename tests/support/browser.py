"""A real Chromium for tests of pages: a server in a thread, sizes, colors, and what axe-core and the console complain about."""

from __future__ import annotations

import contextlib
import importlib.util
import shutil
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import uvicorn
from selenium import webdriver
from selenium.webdriver.common.keys import Keys

from support.server import PASSWORD, cell
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings
from tango_cnc.web.users import add_user

PHONE, DESK = (390, 844), (1200, 900)


class Site:
    """A server in a thread, with a user ann who may operate."""

    def __init__(self, folder: Path, users: Path, nights: Sequence[dict[str, Any]] | None = None) -> None:
        self.folder = cell(folder, records=nights)
        (self.folder / "readings.20261122T184120467949.journal").write_bytes(b"")  # an earlier run, whose name is long
        add_user(users, "ann", PASSWORD, "operate")
        with socket.socket() as found:
            found.bind(("127.0.0.1", 0))
            self.port = found.getsockname()[1]
        app = create(Settings((self.folder,), users=users))
        self.server = uvicorn.Server(uvicorn.Config(app, port=self.port, log_level="warning"))
        threading.Thread(target=self.server.run, daemon=True).start()
        wait(lambda: self.server.started)
        self.base = f"http://127.0.0.1:{self.port}"


def wait(true: Callable[[], Any], seconds: float = 30.0) -> None:
    until = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < until, "it did not happen"
        time.sleep(0.1)


def sized(browser: webdriver.Chrome, size: tuple[int, int]) -> None:
    metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": size == PHONE}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)


def shown_in(browser: webdriver.Chrome, colors: str = "light", media: str = "") -> None:
    """light or dark; print for a page as it is printed."""
    wanted = {"media": media, "features": [{"name": "prefers-color-scheme", "value": colors}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", wanted)


def complaints(browser: webdriver.Chrome) -> list[str]:
    """What the console says: refused styles and scripts, failed requests, errors."""
    return [row["message"] for row in browser.get_log("browser") if row["level"] in ("SEVERE", "WARNING")]


def axe(browser: webdriver.Chrome) -> list[str]:
    """Serious and critical findings of axe-core on the page that is open."""
    spec = importlib.util.find_spec("axe_core_python")
    assert spec is not None and spec.origin is not None
    browser.execute_script(Path(spec.origin).with_name("axe.min.js").read_text(encoding="utf-8"))
    run = "axe.run(document, {resultTypes: ['violations']}).then(arguments[arguments.length - 1])"
    found = browser.execute_async_script(run)["violations"]
    return [f"{v['id']}: {v['nodes'][0]['html'][:160]}" for v in found if v["impact"] in ("serious", "critical")]


@contextlib.contextmanager
def chromium() -> Iterator[webdriver.Chrome]:
    """→ a browser without a window."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    driver.set_page_load_timeout(60)
    try:
        yield driver
    finally:
        driver.quit()


def signed_in(browser: webdriver.Chrome, base: str, user: str) -> None:
    """browser, address, user → signed in, by the keyboard alone."""
    browser.delete_all_cookies()
    browser.get(f"{base}/sign-in")
    browser.switch_to.active_element.send_keys(user, Keys.TAB, PASSWORD, Keys.ENTER)
    wait(lambda: "Sign out" in browser.page_source)
