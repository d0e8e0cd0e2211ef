"""What a process loads before it does anything: a control in the simulator, and the commands that stand beside a machine."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.histories import record

from tango_cnc.cli import tango
from tango_cnc.history import opened

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


LISTED = """
import sys
from tango_cnc.cli import main
sys.argv = ["tango", "history", "list", "--history", sys.argv[1]]
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
loaded = [heavy for heavy in {heavy} if heavy in sys.modules]
assert not loaded, loaded
"""


@pytest.mark.long
def test_a_list_of_nights_loads_neither_the_diagnosis_nor_what_nights_compute_with(tmp_path: Path) -> None:
    with opened(tmp_path / "history.db") as history:
        history.add_night(record(2))
    program = LISTED.format(heavy=(*HEAVY, "tango_cnc.diagnose", "tango_cnc.state"))
    command = [sys.executable, "-c", program, str(tmp_path / "history.db")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "2026-10-02" in done.stdout, done.stderr


COMMAND = """
import sys
from tango_cnc.cli import main
sys.argv = ["tango", "estimate", "-C", sys.argv[1], "--readings", "measured.csv"]
try:
    main()
except SystemExit as end:
    assert end.code == 0, end.code
assert "scipy.linalg" in sys.modules
loaded = [name for name in ("numpy.f2py.crackfortran", "numpy.testing._private.utils") if name in sys.modules]
assert not loaded, loaded
import numpy
numpy.testing.assert_allclose(1.0, 1.0)  # it is there for whoever uses it
assert "numpy.testing._private.utils" in sys.modules
"""


@pytest.mark.long
def test_what_scipy_asks_of_numpy_and_nobody_uses_is_not_loaded(tmp_path: Path) -> None:
    """A Fortran compiler's front end and numpy's own tests are a third of the time in which scipy loads."""
    cell = tmp_path / "cell"
    for words in (["init", str(cell)], ["simulate", "-C", str(cell), "-o", str(cell / "measured.csv")]):
        assert CliRunner().invoke(tango, words).exit_code == 0
    done = subprocess.run([sys.executable, "-c", COMMAND, str(cell)], capture_output=True, text=True, check=False, cwd=cell)
    assert done.returncode == 0, done.stderr


REPORT = """
import sys
from tango_cnc.cli import main
sys.argv = ["tango", "report", "-C", sys.argv[1], "--readings", "measured.csv", "-o", "report.html"]
try:
    main()
except SystemExit as end:
    assert end.code in (0, 1), end.code
assert "tango_cnc.report.page" in sys.modules
assert "sqlalchemy" not in sys.modules
"""


@pytest.mark.long
def test_a_report_of_a_cell_without_nights_loads_no_database(tmp_path: Path) -> None:
    cell = tmp_path / "cell"
    for words in (["init", str(cell)], ["simulate", "-C", str(cell), "-o", str(cell / "measured.csv")]):
        assert CliRunner().invoke(tango, words).exit_code == 0
    done = subprocess.run([sys.executable, "-c", REPORT, str(cell)], capture_output=True, text=True, check=False, cwd=cell)
    assert done.returncode == 0, done.stderr
    assert (cell / "report.html").exists()


NOTES = """
import sys
from tango_cnc import lean
from scipy._lib import _array_api
kept = _array_api.FunctionDoc
{spoilt}
lean.leave_notes_out()
from scipy import special
assert _array_api.FunctionDoc is kept and special.ndtr(0.0) == 0.5
assert not any(type(finder).__module__ == lean.__name__ for finder in sys.meta_path)
print("Array API" in special.ndtr.__doc__)
"""


@pytest.mark.long
@pytest.mark.parametrize(
    ("spoilt", "noted"),
    [("", False), ("del lean._Unwritten.__getitem__", True)],  # the second: a scipy that asks for more than it did
)
def test_functions_of_scipy_are_loaded_without_notes_and_whatever_scipy_asks_for(spoilt: str, noted: bool) -> None:
    done = subprocess.run([sys.executable, "-c", NOTES.format(spoilt=spoilt)], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and done.stdout.strip() == str(noted), done.stderr
