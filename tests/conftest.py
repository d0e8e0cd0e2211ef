"""What every test may ask for, and what a skipped test means: a notice at home, a failure where CI is set."""

from __future__ import annotations

import gc
import os
import shutil
import sys
from pathlib import Path

import pytest
from hypothesis import settings

# Before anything imports numpy: matrices of 400 × 120 gain nothing from threads, and tests that share a machine lose by them.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
pytest.register_assert_rewrite("support")  # helpers may assert, too
from support.places import history_place, postgres_server  # noqa: E402, F401  (fixtures)

pytest_plugins = [
    "support.cpu",
    "support.few",
    "support.newdialect",
    "support.cells",
    "support.plans",
    "support.rigs",
    "support.quiet",
    "support.shares",
    "support.newhistory",
]
ROOT = Path(__file__).parent.parent
CI = bool(os.environ.get("CI"))
PACKAGES = {
    "rs274": "linuxcnc-uspace",
    "linuxcnc": "linuxcnc-uspace",
    "halrun": "linuxcnc-uspace",
    "socat": "socat",
    "pg_lsclusters": "postgresql",
}
PACKAGES |= {"sshd": "openssh-server", "mosquitto": "mosquitto", "mosquitto_passwd": "mosquitto", "unshare": "util-linux"}

# Thousands of tests are objects that stay: to look for garbage among them 700 objects at a time is a sixth of some tests' time.
gc.set_threshold(20_000, 20, 20)

# The same examples everywhere and every time; how long one takes depends on who shares the machine.
settings.register_profile("tango", deadline=None, derandomize=True)
settings.load_profile("tango")


def pytest_collection_finish() -> None:
    gc.freeze()


def pytest_runtest_setup(item: pytest.Item) -> None:
    """`@pytest.mark.system("socat", …)`: without these commands the test is skipped and the notice says what to install."""
    for mark in item.iter_markers("system"):
        for command in mark.args:
            if shutil.which(command) is None:
                pytest.skip(f"needs the command {command} (apt install {PACKAGES.get(command, command)})")


def pytest_sessionfinish(session: pytest.Session) -> None:
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    skipped = reporter.stats.get("skipped", []) if reporter is not None else []
    if CI and skipped and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if CI and terminalreporter.stats.get("skipped"):
        terminalreporter.write_line("CI is set: a skipped test fails the run", red=True)


@pytest.fixture(autouse=True)
def trusting(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Posts that tests write are trusted, but where trust is what is tested; what is trusted is not kept at the user's."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path_factory.getbasetemp() / "config"))
    monkeypatch.setattr(sys, "pycache_prefix", sys.pycache_prefix)
    if request.node.get_closest_marker("untrusted") is None:
        monkeypatch.setattr("tango_cnc.commands._trusted.known", lambda file: True)


@pytest.fixture(scope="session")
def root() -> Path:
    """The folder of the project."""
    return ROOT


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder with reference data beside the project, which is not part of it."""
    folder = ROOT.parent / "shared"
    if not folder.is_dir():
        pytest.fail(f"{folder} is absent") if CI else pytest.skip(f"needs the reference data in {folder}")
    return folder
