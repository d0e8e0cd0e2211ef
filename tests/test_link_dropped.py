"""What a computer does to a run: a disk that fills up while the machine moves, a terminal and a connection that go away."""

import json
import os
import pty
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.remote import ssh_server
from support.runs import Control, Result, cell, readings  # noqa: F401

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="namespaces and pseudo-terminals of Linux")
TESTS = Path(__file__).parent


def until(condition):
    for _ in range(1500):
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError("it has not happened")


def touches(cell):
    journal = cell / "readings.journal"
    return journal.read_bytes().count(b'"kind":"reading"') if journal.exists() else 0


def ended(cell):
    return '"kind":"end"' in (cell / "readings.journal").read_text()


@pytest.mark.long
@pytest.mark.system("unshare")
@pytest.mark.parametrize("after", [1, 2, 4, 6])
def test_a_disk_that_fills_up_while_the_machine_moves_loses_nothing(cell, after):
    """A real file system without room: what was acknowledged is on it, the message names the file, and the run is resumed."""
    command = ["unshare", "--user", "--map-root-user", "--mount", sys.executable, "-m", "support.fulldisk", str(cell), str(after)]
    path = os.pathsep.join([str(TESTS), *filter(None, [os.environ.get("PYTHONPATH")])])
    said = subprocess.run(command, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, timeout=150, check=False)
    assert said.returncode == 0, said.stderr
    first, second, last = (json.loads(line) for line in said.stdout.splitlines() if line.startswith("{"))
    assert first["full"] and first["code"] == 3, first
    assert "readings.journal" in first["said"] and "No space left on device" in first["said"] and "Traceback" not in first["said"]
    assert first["touches"][:after] == list(range(1, after + 1))
    assert second["code"] == 0, second["said"]
    assert (last["verified"], last["rows"]) == (0, 7)


def in_a_terminal(command, cwd):
    """command → its process, the other end of its terminal; it is the first process of a session, as after a login."""
    ours, its = pty.openpty()
    process = subprocess.Popen(command, stdin=its, stdout=its, stderr=its, cwd=cwd, preexec_fn=lambda: _owns(its))
    os.close(its)
    return process, ours


def _owns(terminal):
    import fcntl
    import termios

    os.setsid()
    fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)


def stopped_in_order(cell, before):
    """The run has ended as after Ctrl-C: its touches are kept, and the rest is measured when somebody resumes."""
    assert "stopped by the user" in (cell / "readings.journal").read_text()
    assert len(readings(cell, "readings.partial.csv").touch) == before
    until(lambda: not (cell / ".tango.lock").exists())  # the run of a shell has written all, and is still about to end
    again = Result("run", "-C", cell, "--port", f"{Control(cell).url}?listen=no", "--timeout", "20", "--resume")
    assert again.code == 0, again.err
    assert sorted(readings(cell).touch) == [1, 2, 3, 4, 5, 6, 7]


def words(cell, control):
    return [
        sys.executable,
        "-m",
        "tango_cnc",
        "run",
        "-C",
        str(cell),
        "--port",
        f"{control.url}?listen=no",
        "--timeout",
        "30",
        "--yes",
    ]


@pytest.mark.few(0)
@pytest.mark.parametrize("shell", [False, pytest.param(True, marks=pytest.mark.long)], ids=["alone", "of a shell"])
def test_a_terminal_that_is_closed_ends_the_run_as_ctrl_c_does(cell, tmp_path, shell):
    """The kernel sends SIGHUP and takes the screen away; nothing of the run is lost with it."""
    command = words(cell, Control(cell, stop=3))
    if shell:
        command = [shutil.which("bash"), "--norc", "-i", "-c", " ".join([*command, ";", "true"])]
    process, screen = in_a_terminal(command, tmp_path)
    try:
        until(lambda: touches(cell) == 3)
        os.close(screen)
        process.wait(30)
        until(lambda: ended(cell))
    finally:
        process.kill()
    assert shell or process.returncode == 3
    until(lambda: (cell / "readings.partial.csv").exists())
    stopped_in_order(cell, 3)


@pytest.mark.long
@pytest.mark.system("ssh", "sshd", "ssh-keygen")
def test_a_connection_that_is_lost_ends_the_run_as_ctrl_c_does(cell, tmp_path):
    """Somebody has logged in over SSH and started the run there; their computer is switched off."""
    folder = tmp_path / "home"
    folder.mkdir()
    server = ssh_server(tmp_path, folder)
    port = server._url.rsplit(":", 1)[1].split("/")[0]
    user = server._url.split("//")[1].split("@")[0]
    options = ["-o", "StrictHostKeyChecking=no", "-o", "UserKnownHostsFile=/dev/null", "-i", str(tmp_path / "user"), "-p", port]
    remote = " ".join(["cd", str(Path.cwd()), "&&", *words(cell, Control(cell, stop=3))])
    client = subprocess.Popen(
        ["ssh", "-tt", *options, f"{user}@127.0.0.1", remote], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL
    )
    try:
        until(lambda: touches(cell) == 3)
        client.send_signal(signal.SIGKILL)
        client.wait(10)
        until(lambda: ended(cell) and (cell / "readings.partial.csv").exists())
    finally:
        client.kill()
        server.stop()
    stopped_in_order(cell, 3)
