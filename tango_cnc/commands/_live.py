"""What is shown of a run while it goes on: a bar on stderr, and one JSON object a line for other programs."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from ._progress import Progress, said

if TYPE_CHECKING:
    from ..link.session import News


class LateFile:
    """A text file that begins with its first text, so that a run that is refused leaves the file as it was."""

    def __init__(self, file: str) -> None:
        self._file = Path(file)
        self._out: TextIO | None = None

    def write(self, text: str) -> int:
        """text → its length. Raises OSError, also where the file does not open: by then the machine moves."""
        if self._out is None:
            self._out = self._file.open("w", encoding="utf-8")
        return self._out.write(text)

    def flush(self) -> None:
        """What was written is in the file. Raises OSError."""
        if self._out is not None:
            self._out.flush()

    def close(self) -> None:
        """The end of the file. Raises OSError."""
        if self._out is not None:
            self._out.close()


class Live:
    """Steps → progress on stderr, and one JSON object a line for other programs."""

    def __init__(self, file: str | None) -> None:
        from ..link.aside import set_aside

        set_aside()
        self._bar, self._stdout, self._lost = Progress(), file == "-", False
        self._out = None if file is None or self._stdout else LateFile(file)

    def __enter__(self) -> Live:
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.close()
        if self._out is not None:
            with suppress(OSError, ValueError):
                self._out.close()

    def __call__(self, step: News) -> None:
        """what happened → shown."""
        if step.remark:
            self._bar.close()
            said(step.remark)
        if step.touch or not step.remark:  # a question may come behind what is remarked: no bar stands in its line
            self._bar.count(step.done, step.total, _beside(step))
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


def _beside(step: News) -> str:
    last = "" if step.deviation is None else f"last {step.deviation:+.1f} µm"
    return last if step.drift is None else f"{last}  facet {step.facet} moved {step.drift:+.1f} µm".strip()
