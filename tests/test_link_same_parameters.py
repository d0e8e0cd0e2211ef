"""The strategy of the example over every link: the same parameters each time, as far as the resolution of the control tells."""

import json
import re
import sys

import pytest
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
    write_example(folder, "hu40t")
    world = (folder / "world.yaml").read_text()
    (folder / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", world))
    with controller(folder, *options, once=False) as url:
        result = Result("run", "-C", folder, "--port", port.format(url), "--timeout", "60")
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
