"""What is shown of a run while it goes on: a bar on stderr, and one JSON object a line for other programs."""

from __future__ import annotations

import json
import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from ..link.session import Step


def said(text: str, err: bool = True, nl: bool = True) -> bool:
    """text → on the screen, where there is one: a window that was closed ends no run. → whether it got there."""
    try:
        click.echo(text, err=err, nl=nl)
    except (OSError, ValueError):  # ValueError: the stream is closed
        _to_nowhere(2 if err else 1)
        return False
    return True


def _to_nowhere(handle: int) -> None:
    """What is still to be written to a broken stream, at the end of the program too, goes nowhere."""
    with suppress(OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, handle)
        os.close(nowhere)


class Live:
    """Steps → progress on stderr, and one JSON object a line for other programs."""

    def __init__(self, file: str | None) -> None:
        self._bar, self._stdout, self._lost = _Bar(), file == "-", False
        # begun with the first step, so that a refused run leaves the file as it was
        self._out = None if file is None or self._stdout else click.open_file(file, "w", encoding="utf-8", lazy=True)

    def __enter__(self) -> Live:
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.close()
        if self._out is not None:
            with suppress(OSError, ValueError):
                self._out.close()

    def __call__(self, step: Step) -> None:
        """what happened → shown."""
        self._bar(step)
        values = {
            "done": step.done,
            "total": step.total,
            "time_s": round(step.time, 3),
            "touch": step.touch,
            "facet": step.facet,
            "status": step.status,
            "deviation_um": step.deviation,
            "drift_um": step.drift,
            "remark": step.remark,
        }
        self.add("touch" if step.touch else "state", {name: value for name, value in values.items() if value is not None})

    def add(self, event: str, values: dict[str, Any]) -> bool:
        """what it is, plain data → one line; whether stdout is taken (so that no other text goes there)."""
        line = json.dumps({"event": event, **values}, ensure_ascii=False, allow_nan=False)
        if self._stdout:
            if not self._lost and not said(line, err=False):
                self._lose("the reader of stdout has gone")
        elif self._out is not None and not self._lost:
            try:
                self._out.write(line + "\n")
                self._out.flush()
            except (OSError, ValueError) as error:
                self._lose(str(error))
        return self._stdout

    def _lose(self, why: str) -> None:
        """Says once that nothing more goes to --json."""
        self._lost = True
        self._bar.close()
        said(f"--json ends here: {why}; the run goes on")


class _Bar:
    """Progress on stderr: a line that is written over on a terminal, one line in ten percent elsewhere."""

    def __init__(self) -> None:
        self._terminal = sys.stderr is not None and sys.stderr.isatty()
        self._open = False
        self._shown = -1

    def __call__(self, step: Step) -> None:
        if step.remark:
            self.close()
            said(step.remark)
        left = step.time / step.done * (step.total - step.done) if step.done else 0.0
        width = 24
        filled = width * step.done // max(step.total, 1)
        last = "" if step.deviation is None else f"  last {step.deviation:+.1f} µm"
        if step.drift is not None:
            last += f"  facet {step.facet} moved {step.drift:+.1f} µm"
        text = f"[{'#' * filled}{'.' * (width - filled)}] {step.done}/{step.total}  {_clock(left)} left{last}"
        if self._terminal:
            said(f"\r{text:<78}", nl=False)
            self._open = True
        elif (tenths := 10 * step.done // max(step.total, 1)) != self._shown:  # less: the next part of a run has begun
            self._shown = tenths
            said(text)

    def close(self) -> None:
        """Ends the line that is written over."""
        if self._open:
            said("")
            self._open = False


def _clock(seconds: float) -> str:
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"
