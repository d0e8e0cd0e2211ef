"""The strategy of the example over every link: the same parameters each time, as far as the resolution of the control tells."""

import json
import re
import subprocess
import sys

import pytest
from test_link_remote import KINDS, NEEDED, place
from test_run import Result
from test_run_simulated import controller

from tango_cnc.commands.init import write_example

pytestmark = [pytest.mark.long, pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")]

LINKS = {
    "serial, 7 bits, parity, XON/XOFF": (["--pty", "--parity"], "serial://{}?bits=7&parity=even&start=xon&flow=xonxoff"),
    "TCP": (["--tcp", "127.0.0.1:0"], "{}"),
    "Modbus TCP": (["--protocol", "modbus", "--tcp", "127.0.0.1:0"], "{}"),
    "Modbus RTU": (["--protocol", "modbus", "--pty"], "{}"),
    "grbl": (["--protocol", "grbl", "--tcp", "127.0.0.1:0"], "{}?orient=m19"),
}
SIGMAS = 6.0  # of the estimate itself: without noise its residuals are what the control's resolution leaves


def estimate(folder, name):
    result = Result("estimate", "-C", folder, "--readings", folder / name, "--json", "-")
    assert result.code == 0, result.err
    return json.loads(result.out)


@pytest.mark.parametrize("link", LINKS)
def test_the_same_parameters_over_every_link(tmp_path, link):
    the_same_parameters(tmp_path / "cell", link, *LINKS[link])


def the_same_parameters(folder, link, options, port):
    quiet(folder)
    with controller(folder, *options, once=False) as url:
        result = Result("run", "-C", folder, "--port", port.format(url), "--timeout", "60")
    compared(folder, link, result)


@pytest.mark.parametrize("kind", [pytest.param(k, marks=pytest.mark.system(*NEEDED.get(k, ()))) for k in ("ftp", "sftp", "smb")])
def test_the_same_parameters_over_the_disk_of_the_control(kind, tmp_path):
    """The program goes to the disk, somebody starts it there, its record file is followed."""
    folder, disk = tmp_path / "cell", tmp_path / "control"
    quiet(folder)
    disk.mkdir()
    server = KINDS[kind](tmp_path, disk)
    command = [sys.executable, "-m", "sim_controller", "--cell", folder]
    command += ["--start", disk / "O8700.NC", "--records", disk / "TANGO.TXT"]
    with subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL) as control:
        try:
            result = Result("run", "-C", folder, "--port", server.url(program=place(server, "O8700.NC")), "--timeout", "60")
        finally:
            control.kill()
            server.stop()
    compared(folder, kind, result)


def quiet(folder):
    """The example, whose machine has no noise."""
    write_example(folder, "hu40t")
    world = (folder / "world.yaml").read_text()
    (folder / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", world))


def compared(folder, link, result):
    """What was measured gives the parameters of the true machine."""
    assert result.code == 0, result.err
    assert Result("simulate", "-C", folder, "-o", folder / "simulated.csv").code == 0
    true, got = estimate(folder, "simulated.csv"), estimate(folder, "readings.csv")
    assert got["terms"] == true["terms"]
    assert got["residual"]["rms_um"] < 1.0
    away = {
        name: abs(parameter["value"] - true["parameters"][name]["value"]) / max(parameter["std"], 1e-12)
        for name, parameter in got["parameters"].items()
    }
    print(
        f"\n{link}: residual {got['residual']['rms_um']:.3f} µm rms, parameters within {max(away.values()):.1f} standard deviations"
    )
    assert max(away.values()) < SIGMAS
