"""How a program ends before its end."""

from __future__ import annotations


class Alarm(Exception):
    """The control stops and shows this; nothing goes out on the line."""

    def __init__(self, code: str, text: str, detail: str = "") -> None:
        super().__init__(f"{code} {text}" + (f" ({detail})" if detail else ""))
        self.code, self.text, self.detail = code, text, detail


class Silence(Exception):
    """The power is gone: not even an alarm is shown."""
