"""What several tests share of run simulated."""

import contextlib
import re
import select
import subprocess
import sys

import numpy as np
import pytest

from support.runs import STRATEGY, Result, readings
from tango_cnc.commands.init import write_example


@pytest.fixture
def cell(tmp_path):
    folder = tmp_path / "cell"
    write_example(folder, "hu40t")
    (folder / "strategy.yaml").write_text(STRATEGY)
    world = (folder / "world.yaml").read_text()
    (folder / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", world))
    return folder


@contextlib.contextmanager
def controller(folder, *options, once=True):
    """A simulated control → its address; it is gone afterwards."""
    command = [
        sys.executable,
        "-m",
        "sim_controller",
        "--cell",
        str(folder),
        "--speed",
        "inf",
        *(["--once"] if once else []),
        *options,
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            assert select.select([process.stdout], [], [], 20)[0], "the simulated control does not start"
            yield process.stdout.readline().strip()
        finally:
            process.kill()


def simulated(folder):
    """What the true machine gives when nobody has to program it."""
    assert Result("simulate", "-C", folder, "-o", folder / "simulated.csv").code == 0
    return readings(folder, "simulated.csv")


def agree(folder):
    got, expected = readings(folder), simulated(folder)
    order = np.argsort(got.touch)
    assert list(got.touch[order]) == list(expected.touch)
    assert tuple(got.facet[i] for i in order) == expected.facet
    assert set(got.status) == {"ok"}
    # a tenth of a micrometre printed, and the least increment of 1 µm in which the control was sent where to go sideways
    assert np.abs(got.position[order] - expected.position)[:, :3].max() < 1.5e-3
    return True
