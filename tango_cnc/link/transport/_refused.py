"""What servers and keys say, in plain English: errors of logins, of host keys, of SMB."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import stat
import tempfile
from pathlib import Path
from typing import Any

from ...records import InputError, NothingSentError

STATUS = {  # of SMB, where the system has no number for it
    "OBJECT_NAME_INVALID": "the control takes no such name",
    "DISK_FULL": "no room is left at the control",
    "QUOTA_EXCEEDED": "no room is left at the control for this user",
    "SHARING_VIOLATION": "another program has it open at the control",
    "FILE_LOCK_CONFLICT": "another program has it open at the control",
    "BAD_NETWORK_NAME": "there is no such share at the control",
    "NETWORK_NAME_DELETED": "the share is there no more",
    "USER_SESSION_DELETED": "the control has ended the session",
}


class RefusedError(NothingSentError):
    """The control answers and lets nobody in by this name: another try may lock the name, and a password helps.

    What opens a port ends with the status of wrong input for it: nothing was sent, and the same command would be refused again.
    """

    exit_code = InputError.exit_code


def refused(why: object) -> RefusedError:
    """what a server said of a login → the error that ends it."""
    return RefusedError(
        f"the control refuses the login ({str(why).rstrip('.')}): correct user and password. The port's URL has the user, and "
        "password=env:NAME or file:PATH says where the password stands (sftp: key= where the private key is)"
    )


def opens(paramiko: Any, options: dict[str, str]) -> None:
    """library, settings → nothing. Raises InputError for a file that is no key, or that its passphrase does not open.

    What else the library says of a key, the control may still take it otherwise.
    """
    key, phrase = options.get("key"), options.get("passphrase") or options.get("password")
    if not key:
        return
    try:
        loads = paramiko.PKey.from_path
    except AttributeError:  # an older one
        return
    try:
        loads(key, phrase.encode() if phrase else None)
    except (OSError, paramiko.SSHException, paramiko.UnknownKeyType):
        return
    except TypeError:
        if not phrase:  # with one the key needs none
            raise InputError(
                f"key: found {key}, which is encrypted; allowed: passphrase=env:NAME or file:PATH. The control was not asked"
            ) from None
    except Exception:  # of a damaged one: ValueError, AssertionError, and what the library of the library has
        raise InputError(
            f"key: found {key}; allowed: a private key, and its passphrase=env:NAME or file:PATH. The control was not asked"
        ) from None


def knows(client: Any) -> None:
    """client of paramiko → it has the keys of known_hosts. A damaged line is passed over, as OpenSSH does; paramiko stops there."""
    try:
        client.load_system_host_keys()
    except Exception:
        file = Path("~/.ssh/known_hosts").expanduser()
        lines = file.read_bytes().decode("ascii", "replace").splitlines(keepends=True)
        with tempfile.TemporaryDirectory() as folder:
            one = Path(folder, "known_hosts")
            for line in lines:
                one.write_text(line, encoding="ascii", errors="replace")
                with contextlib.suppress(Exception):
                    client.load_system_host_keys(str(one))


def changed(host: str, key: str, known: str) -> RefusedError:
    """host, hash of its key, which key it had → the error that ends the connection: somebody else may answer in its place."""
    return RefusedError(
        f"the key of {host} has changed: it is {key}, and {known}. The control was set up anew, or another computer answers in its "
        "place; nothing was sent to it. Compare the key at the control. Where it is the control's, take the old one out (of "
        f"known_hosts: ssh-keygen -R '{host}') and state hostkey={key} in the port's URL"
    )


def size_of(found: Any) -> int:
    """what the server says of a path → bytes of the file. Raises IsADirectoryError for a folder."""
    if stat.S_ISDIR(found.st_mode or 0):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    return int(found.st_size)


def as_error(number: int, text: str, kind: str = "") -> OSError:
    """number of an error of the system or 0, what the library says, its class → the error, in plain English."""
    if number > 0:
        return OSError(number, os.strerror(number))  # of a missing file it is a FileNotFoundError
    name = re.search(r"STATUS_(\w+)", text)
    if name is None:
        return OSError("the connection was closed" if "Closed" in kind else f"the share does not answer as one ({kind})")
    return OSError(STATUS.get(name[1], f"the control refuses ({name[1].replace('_', ' ').lower()})"))
