"""Links that a control cannot have are named before anybody waits for what cannot come over them."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from support.controls import GOLDEN, stating

from postprocessors import load, names
from tango_cnc.cli import guarded, tango
from tango_cnc.commands._links import doubted


@pytest.mark.parametrize(
    ("post", "port", "why"),
    [
        ("centroid", "linuxcnc://127.0.0.1:5007?file=/tmp/t.ngc&log=/tmp/t.txt", "Centroid cannot use the link linuxcnc; its post"),
        ("centroid", "lsv2://192.168.1.20/TNC:/TANGO.TXT", "Centroid cannot use the link lsv2; its post allows file"),
        ("centroid", "socket://127.0.0.1:9", "the link file needs a URL that begins with file://"),
        ("siemens", "socket://127.0.0.1:9", "Siemens 840D sl and ONE cannot use the link dnc; its post allows file"),
        ("haas", "socket://127.0.0.1:9?program=stored", ""),
        ("centroid", "file:///mnt/cnc/TANGO.TXT", ""),
        ("grbl", "grbl+socket://127.0.0.1:9", ""),
    ],
)
def test_a_link_that_a_control_cannot_have_is_named(post: str, port: str, why: str) -> None:
    """Centroid's program went into the file of LinuxCNC; over a socket ten minutes were waited for what it cannot send there."""
    found = doubted(load(post), port)
    assert found.partition(": ")[2].startswith(why) if why else not found, found


@pytest.mark.parametrize("post", names())
def test_a_post_can_have_its_own_link(post: str) -> None:
    if (one := load(post)).link != "dnc":
        assert one.link in one.links


@pytest.mark.few(0)
def test_it_is_said_before_the_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = Path(shutil.copytree(GOLDEN, tmp_path / "cell"))
    stating(cell, post="centroid", port="socket://127.0.0.1:9")
    assert guarded(tango.main, ["run", "-C", str(cell), "--yes"], prog_name="tango", standalone_mode=False) == 3
    said = capsys.readouterr().err
    assert -1 < said.index("needs a URL that begins with file://") < said.index("does not open")
