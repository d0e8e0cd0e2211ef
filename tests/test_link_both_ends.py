"""Every protocol that the simulated control talks is carried out against the client of that name: a new one, too."""

from __future__ import annotations

import json
import pkgutil
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.controls import GOLDEN
from support.profiles import spoken
from support.runs import Result

from postprocessors import load, names
from sim_controller.protocols import __path__ as talks
from tango_cnc.link.protocols import __path__ as clients


def files(folder: list[str]) -> set[str]:
    return {module.name for module in pkgutil.iter_modules(folder) if not module.name.startswith("_")}


BOTH = sorted(files(list(talks)) & files(list(clients)))


def test_a_talk_of_the_simulated_control_has_a_client_of_its_name() -> None:
    assert BOTH and files(list(talks)) - set(BOTH) == {"dprnt"}, (
        "a file of sim_controller/protocols/ is named as the client that it talks to (tango_cnc/link/protocols/). dprnt only sends"
    )


@pytest.mark.few(0)
@pytest.mark.parametrize("protocol", BOTH)
def test_a_run_over_it_has_every_touch(protocol: str, tmp_path: Path) -> None:
    """A client and a talk that both passed their own tests had never met."""
    cell = Path(shutil.copytree(GOLDEN, tmp_path / "cell"))
    post = next((name for name in names() if load(name).link == protocol), "fanuc")
    settings = cell / "tango.yaml"
    settings.write_text(spoken(settings.read_text("utf-8"), f"post: {post}"), "utf-8")
    strategy = (cell / "strategy.yaml").read_text("utf-8")
    (cell / "strategy.yaml").write_text(
        re.sub(r"\bS: -?\d+", "S: 0", strategy), "utf-8"
    )  # a grbl does not know the angle of its spindle
    (cell / "world.yaml").write_text("noise: 0.0\n", "utf-8")
    control = ("--cell", cell, "--protocol", protocol, "--tcp", "127.0.0.1:0", "--speed", "0")
    command = [sys.executable, "-m", "sim_controller", *map(str, control)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            result = Result("run", "-C", cell, "--port", process.stdout.readline().strip(), "--yes")
        finally:
            process.kill()
    assert result.code == 0, f"tango_cnc/link/protocols/{protocol}.py, sim_controller/protocols/{protocol}.py: {result.err}"
    found = json.loads((cell / "readings.json").read_text("utf-8"))
    assert found["ok"] == found["touches"] > 3, found
