"""How long a person waits for a command to begin: CPU seconds of whole processes, beside the least that Python needs.

    python benchmarks/start.py            the floor is `python -c "import scipy.linalg"`

Promised on an idle core: `tango --help` in less than 0.3 s, `tango estimate` of 393 touches in less than 0.8 s.
"""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROUNDS = 5
TANGO = "import sys; from tango_cnc.cli import main; sys.argv[0] = 'tango'; main()"
PROMISED = {"tango --help": 0.3, "tango estimate": 0.8}


def seconds(arguments: list[str]) -> float:
    """command → CPU seconds of one run, which a busy machine stretches less than wall time; its text goes nowhere."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> int:
    """→ exit status: 1 where a promise is not kept."""
    with tempfile.TemporaryDirectory() as folder:
        cell = str(Path(folder, "cell"))
        tango = [sys.executable, "-c", TANGO]
        subprocess.run([*tango, "init", cell], check=True, stdout=subprocess.DEVNULL)
        subprocess.run([*tango, "simulate", "-C", cell, "-o", f"{cell}/measured.csv"], check=True, stdout=subprocess.DEVNULL)
        commands = {
            "python -c pass": [sys.executable, "-c", "pass"],
            "import scipy.linalg": [sys.executable, "-c", "import scipy.linalg"],
            "tango --help": [*tango, "--help"],
            "tango estimate": [*tango, "estimate", "-C", cell, "--readings", f"{cell}/measured.csv"],
        }
        found: dict[str, list[float]] = {name: [] for name in commands}
        for _ in range(ROUNDS):  # in turn, so that a slow minute of the machine meets all of them
            for name, command in commands.items():
                found[name].append(seconds(command))
    floor = statistics.median(found["import scipy.linalg"])
    kept = True
    for name, times in found.items():
        middle, promise = statistics.median(times), PROMISED.get(name)
        late = promise is not None and min(times) > promise
        kept = kept and not late
        word = "" if promise is None else f"   promised {promise} s: {'LATE' if late else 'kept'}"
        print(f"{name:20} {middle:6.2f} s  (least {min(times):.2f})  {middle / floor:5.2f} times the floor{word}")
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
