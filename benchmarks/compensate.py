"""How fast NC programs are compensated: 100 000 blocks, as a ratio to reading and writing the same lines, and the memory.

python benchmarks/compensate.py [BLOCKS]
"""

from __future__ import annotations

import random
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parent.parent


def program(blocks: int) -> str:
    r = random.Random(3)
    at = [0.0, 0.0, 0.0]
    lines = ["%", "O1", "G21 G90 G17 G54", "G0 A20. C30.", "G0 X0. Y0.", "G43 H1 Z50.", "G1 Z0. F800"]
    for i in range(blocks):
        at = [max(-s, min(s, v + r.uniform(-w, w))) for v, s, w in zip(at, (120, 120, 5), (2, 2, 0.1), strict=True)]
        lines.append(f"N{i} X{at[0]:.3f} Y{at[1]:.3f} Z{at[2]:.3f}")
    return "\n".join([*lines, "M30", "%"]) + "\n"


def run(*arguments: str) -> tuple[float, float]:
    """→ s of CPU, MB of the largest memory of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run(["/usr/bin/env", "time", "-f", "%M", *arguments], check=True, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    return after - before, float(done.stderr.split()[-1]) / 1024


def copied(source: Path, target: Path) -> float:
    """Two files → s of CPU to read and write the lines: how fast this computer is."""
    begin = time.process_time()
    target.write_text("".join(f"{line}\n" for line in source.read_text().splitlines()))
    return time.process_time() - begin


def main(blocks: int) -> None:
    tango = [sys.executable, "-m", "tango_cnc"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run([*tango, "init", str(folder / "cell"), "--example", "trunnion"], check=True, capture_output=True)
        subprocess.run([*tango, "simulate", "-C", str(folder / "cell")], check=True, capture_output=True)
        for count in (blocks // 5, blocks):
            source = folder / f"{count}.nc"
            source.write_text(program(count))
            floor = min(copied(source, folder / "copy.nc") for _ in range(5))
            common = ["compensate", str(source), "-C", str(folder / "cell"), "-o", str(folder / "out.nc"), "--simulated"]
            used, memory = run(*tango, *common, "--zero", "X=0,Y=0,Z=-100", "--tool-length", "150")
            print(
                f"{count:7d} blocks: {used:5.1f} s of one core, {1e6 * used / count:.0f} µs a block, "
                f"{used / floor:.0f} times as long as copying its lines; {memory:.0f} MB"
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
