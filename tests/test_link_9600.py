"""The strategy of the example at the speed of a real serial line: 9600 baud, 7 bits, parity, XON/XOFF, as long as that takes."""

import sys

import pytest
from support.parameters import the_same_parameters

pytestmark = [pytest.mark.campaign, pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")]


def test_the_same_parameters_at_a_real_9600_baud(tmp_path):
    """Both ends keep to the rate: half a million characters of program, then the records."""
    options = ["--pty", "--parity", "--baud", "9600", "--buffer", "8192"]
    port = "serial://{}?baud=9600&bits=7&parity=even&start=xon&flow=xonxoff"
    the_same_parameters(tmp_path / "cell", "serial at 9600 baud", options, port)
