"""A cell on a real disk of a few hundred kB that fills up while a run is at work.

`python -m support.fulldisk CELL AFTER`, in a namespace of its own, prints a JSON line a run: exit status, what it
said, the touches in the journal.
"""

from __future__ import annotations

import contextlib
import json
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

from support.runs import Control


def journaled(cell: Path) -> list[int]:
    """folder → touches whose reading is in the journal."""
    file = cell / "readings.journal"
    text = file.read_text(errors="replace") if file.exists() else ""
    return [int(touch) for touch in re.findall(r'"kind":"reading".*?"touch":(\d+).*\n', text)]


def fill(cell: Path) -> None:
    """Takes every byte that is left on the disk of the cell."""
    with contextlib.suppress(OSError), (cell / "filler").open("ab", buffering=0) as out:
        for size in (4096, 256, 1):
            with contextlib.suppress(OSError):
                while True:
                    out.write(bytes(size))


def run(cell: Path, control: Control, *more: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "tango_cnc", "run", "-C", cell, "--port", f"{control.url}?listen=no", "--timeout", "20", *more]
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    return subprocess.Popen([str(word) for word in command], text=True, **streams)  # type: ignore[call-overload, no-any-return]


def main(source: str, after: int) -> None:
    """cell, touches after which the disk is full → two runs: the one that meets it, and the one that resumes."""
    cell = Path(source).parent / "small"
    cell.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=600k", "none", str(cell)], check=True)
    shutil.copytree(source, cell, dirs_exist_ok=True)
    full: list[int] = []

    def meets(number: int, line: str) -> str:
        if number > after and not full:
            while len(journaled(cell)) < after:
                time.sleep(0.01)
            fill(cell)
            full.append(number)
        return line

    outputs = ["--transcript", str(cell / "bytes.txt"), "--json", str(cell / "events.json")]
    for more, control in ((outputs, Control(cell, edit=meets)), (["--resume"], Control(cell))):
        process = run(cell, control, *more)
        _, said = process.communicate(timeout=60)
        print(json.dumps({"code": process.returncode, "said": said, "touches": journaled(cell), "full": bool(full)}), flush=True)
        (cell / "filler").unlink(missing_ok=True)
    verified = subprocess.run([sys.executable, "-m", "tango_cnc", "journal", "verify", "-C", str(cell)], check=False).returncode
    rows = (cell / "readings.csv").read_text().count("\n") - 1
    print(json.dumps({"verified": verified, "rows": rows}), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
