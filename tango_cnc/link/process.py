"""Processes of this computer: whether one still runs, and whether its number belongs to another one by now."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

DEAD = (b"Z", b"X")  # killed, and the parent has not asked for its end yet
QUERY = 0x1000  # Windows: a handle that may only be asked
RUNNING = 259  # Windows: exit status of a process that has not ended
GONE = 87  # Windows: no process has this number


def born(pid: int) -> str:
    """process number → when that process began, as this system counts; '' where nobody can say.

    A system gives a number again, to another process. Both together belong to one process.
    """
    if os.name == "nt":
        return _windows(pid)[1]
    if (fields := _stat(pid)) is not None:
        return f"{boot()} {fields[19].decode('ascii', 'replace')}" if len(fields) > 19 else ""
    if sys.platform.startswith("linux"):
        return ""
    with contextlib.suppress(OSError, subprocess.SubprocessError):  # macOS, BSD
        told = {"LC_ALL": "C", "TZ": "UTC0", "PATH": "/bin:/usr/bin"}
        asked = subprocess.run(["ps", "-o", "lstart=", "-p", str(pid)], env=told, capture_output=True, text=True, timeout=5)
        return " ".join(asked.stdout.split())
    return ""


def alive(pid: int, since: str = "") -> bool:
    """process number, when it began ('': unknown) → whether that process is at work; where nobody can say, it is."""
    if os.name == "nt":
        runs, began = _windows(pid)
        return runs and not (since and began and began != since)
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):  # or a number that no process has
        return False
    except OSError:
        pass  # of another user
    fields = _stat(pid)
    if fields is not None and fields[:1] and fields[0] in DEAD:
        return False
    began = born(pid) if since else ""
    return not (since and began and began != since)


def endings() -> tuple[int, ...]:
    """→ signals other than Ctrl-C that ask a program to end: of the system, of a session that was closed, of Ctrl-Break."""
    if os.name == "nt":
        return signal.SIGTERM, signal.SIGBREAK  # type: ignore[attr-defined, unused-ignore]
    return signal.SIGTERM, signal.SIGHUP


def boot() -> str:
    """→ which start of this computer its clock and its processes count from, where the system says it."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError:
        return ""


def _stat(pid: int) -> list[bytes] | None:
    """process number → fields of /proc/PID/stat from the third one on, None where there is no such file."""
    try:
        return Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()
    except OSError:
        return None


def _windows(pid: int) -> tuple[bool, str]:
    """process number → whether it runs, when it began (100 ns since 1601); (True, '') where nobody can say."""
    import ctypes
    from ctypes import wintypes

    kernel = ctypes.WinDLL("kernel32", use_last_error=True)  # type: ignore[attr-defined, unused-ignore]
    kernel.OpenProcess.restype = wintypes.HANDLE
    handle = kernel.OpenProcess(wintypes.DWORD(QUERY), False, wintypes.DWORD(pid & 0xFFFFFFFF))
    if not handle:
        return ctypes.get_last_error() != GONE, ""  # type: ignore[attr-defined, unused-ignore]
    handle = wintypes.HANDLE(handle)
    try:
        status, times = wintypes.DWORD(), [wintypes.FILETIME() for _ in range(4)]
        if kernel.GetExitCodeProcess(handle, ctypes.byref(status)) and status.value != RUNNING:
            return False, ""
        if not kernel.GetProcessTimes(handle, *(ctypes.byref(t) for t in times)):
            return True, ""
        return True, str((times[0].dwHighDateTime << 32) | times[0].dwLowDateTime)
    finally:
        kernel.CloseHandle(handle)
