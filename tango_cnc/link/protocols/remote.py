"""A control whose disk is reached over the network: the program goes there and is compared, its record file is followed.

    put ──read back, the same──▶ waiting ──start mark of the program──▶ running ──end mark──▶ done

`ftp://`, `ftps://`, `sftp://`, `smb://` (the first folder of its path is the share). The path is the file that the program
writes its records into; `program=` is where the program goes, a file or a folder that ends in /. Nothing is started from here:
the person does that at the control. Without `program=` the person brings the program there too. What the file says is taken as
in `file`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

from ..client import Event, Task
from . import file

OPTIONS: Mapping[str, tuple[str, ...]] = {
    **file.OPTIONS,
    "program": (),  # where the program goes
    "password": (),
    "passphrase": (),  # of the key
    "key": (),  # sftp: a private key
    "hostkey": (),  # sftp: SHA256:… of the control's key, where it is not in known_hosts
    "domain": (),  # smb: of the user, where the server asks for one
    "verify": ("yes", "no"),  # ftps: no: the control's certificate is not looked at
}
SCHEMES: Mapping[str, str] = {"ftp": "ftp", "ftps": "ftps", "sftp": "sftp", "smb": "smb"}


class Client(file.Client):
    """Puts the program where the control finds it, then reads its records."""

    def __init__(self, task: Task, options: Mapping[str, str]) -> None:
        """task, {option: value of `OPTIONS`} → client."""
        super().__init__(task, options)
        self._put = b""
        self._hash = hashlib.sha256(task.program.encode()).hexdigest()
        self._waits = bool(options.get("program"))
        if self._waits:
            self.brought = False
            self.advice = "the program is at the control, compared by reading it back: start it there"
            self._put = b"put %s\n" % task.program.encode().hex().encode()
        self._all, self._there = len(self._put), False

    @property
    def sent(self) -> tuple[int, int]:
        """→ (bytes of the program that stand at the control and were compared, bytes in all)."""
        return self._all * self._there, self._all

    def bytes_to_send(self, limit: int) -> bytes:
        """most bytes wanted → the next piece of the program."""
        piece, self._put = self._put[:limit], self._put[limit:]
        return piece

    def _complete(self, text: str) -> list[Event]:
        if not text.startswith("PUT "):
            return super()._complete(text)
        self._silence = 0.0
        if text == f"PUT {self._hash}":
            self._there = True
            return []
        return self._fail("the program that was read back from the control is not the one that was put there: start nothing")
