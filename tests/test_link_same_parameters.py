"""A whole strategy over every link: the same parameters each time, as far as the resolution of the control tells.

Over TCP it is the largest one, 393 touches; elsewhere 226 of another machine say as much of the link in half the time.
"""

import sys

import pytest
from support.parameters import the_same_parameters

pytestmark = [pytest.mark.long, pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")]

LINKS = {
    "serial, 7 bits, parity, XON/XOFF": (["--pty", "--parity"], "serial://{}?bits=7&parity=even&start=xon&flow=xonxoff"),
    "TCP": (["--tcp", "127.0.0.1:0"], "{}"),
    "Modbus TCP": (["--protocol", "modbus", "--tcp", "127.0.0.1:0"], "{}"),
    "Modbus RTU": (["--protocol", "modbus", "--pty"], "{}"),
    "grbl": (["--protocol", "grbl", "--tcp", "127.0.0.1:0"], "{}?orient=m19"),
}


@pytest.mark.parametrize("link", LINKS)
def test_the_same_parameters_over_every_link(tmp_path, link):
    the_same_parameters(tmp_path / "cell", link, *LINKS[link], example="hu40t" if link == "TCP" else "trunnion")
