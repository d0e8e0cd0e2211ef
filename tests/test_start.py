"""What a process loads before it does anything: a control in the simulator, and the commands that stand beside a machine."""

from __future__ import annotations

import subprocess
import sys

LIGHT = ("sim_controller.server", "tango_cnc.commands.run", "tango_cnc.commands.simulate", "tango_cnc.commands.plan")
HEAVY = ("scipy.linalg", "scipy.optimize", "scipy.spatial", "scipy.special", "scipy.stats")
PROGRAM = """
import importlib, sys
for name in {light}:
    importlib.import_module(name)
    loaded = [heavy for heavy in {heavy} if heavy in sys.modules]
    assert not loaded, (name, loaded)
"""


def test_who_fits_nothing_does_not_wait_for_the_mathematics_of_fits() -> None:
    """scipy takes as long to load as all the rest; a module that needs it seldom loads it where it needs it."""
    program = PROGRAM.format(light=LIGHT, heavy=HEAVY)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
