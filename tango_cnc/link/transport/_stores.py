"""Disks of controls that are reached over the network: five verbs whatever the protocol; libraries are imported at need."""

from __future__ import annotations

import contextlib
import errno
import ftplib
import logging
import os
import re
import ssl
import threading
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import Any, Protocol
from urllib.parse import SplitResult, unquote

from ...nearest import printable
from ...records import InputError, LinkError
from ._refused import RefusedError, as_error, changed, knows, opens, refused, size_of

PORTS = {"ftp": 21, "ftps": 21, "sftp": 22, "smb": 445}
PATIENCE = 10.0  # s for an answer
WESTERN = "latin-1"  # in which every byte is a letter: controls answer in letters of their own
LINE = 300  # characters of an answer that are shown
NO_LOGIN = "530"  # RFC 959: not logged in
REFUSALS = ("AuthenticationException", "BadAuthenticationType")  # of paramiko


class RemoteFiles(Protocol):
    """Files of another computer. Every error of the way there is an OSError or EOFError."""

    def size(self, path: str) -> int | None:
        """path → bytes of the file, None when there is none. Raises IsADirectoryError for a folder."""

    def lacks(self, folder: str) -> bool:
        """folder → whether it is certain that it does not exist there."""

    def read(self, path: str, offset: int, most: int) -> bytes:
        """path, from where, how many at most → bytes of the file."""

    def write(self, path: str, data: bytes) -> None:
        """path, bytes → the file has them."""

    def close(self) -> None:
        """Hangs up."""


class Store(RemoteFiles, Protocol):
    """The same where a file can be taken away."""

    def remove(self, path: str) -> None:
        """path → the file is there no more."""


class Ftp:
    """FTP, and FTP over TLS, by ftplib. A server without SIZE or REST is read from the beginning each time."""

    def __init__(self, parts: SplitResult, options: dict[str, str], secure: bool) -> None:
        self._parts, self._options, self._secure = parts, options, secure
        self._behind = False  # whether an answer may still come that belongs to a question of before
        self._begin()

    def _begin(self) -> None:
        """A new session. Raises LinkError where the control refuses it."""
        parts, options, secure = self._parts, self._options, self._secure
        user, password = (_sent(word) for word in (unquote(parts.username or "anonymous"), options.get("password", "")))
        self._behind = False
        self._ftp = (
            ftplib.FTP_TLS(context=_context(options), timeout=PATIENCE, encoding=WESTERN)
            if secure
            else ftplib.FTP(timeout=PATIENCE, encoding=WESTERN)
        )
        try:
            self._ftp.connect(parts.hostname or "", parts.port or PORTS["ftp"])
            self._ftp.login(user, password)
            if isinstance(self._ftp, ftplib.FTP_TLS):
                self._ftp.prot_p()
            self._ftp.voidcmd("TYPE I")
        except ftplib.Error as error:
            self.close()
            if not secure and re.search("TLS|SSL|AUTH", str(error)):
                raise LinkError(f"the control refuses: {_words(error)}. It asks for TLS: ftps:// in the port's URL") from None
            if str(error).startswith(NO_LOGIN):
                raise refused(_words(error)) from None
            raise LinkError(f"the control refuses: {_words(error)}") from None

    @contextlib.contextmanager
    def _asked(self) -> Iterator[None]:
        """Within it, an answer that is none to the question is an OSError, as a line that broke: the session is dropped.

        A transfer that was cut off may be answered twice (426, then 226): a new session is opened before the next question.
        """
        if self._behind:
            self.close()
            self._begin()
        try:
            yield
        except ftplib.error_perm as error:
            raise LinkError(f"the control refuses: {_words(error)}") from None
        except (ftplib.Error, ValueError, OverflowError) as error:  # or no number, or a line without end
            self._behind = True
            raise OSError(f"the control answers {_words(error)}") from None

    def size(self, path: str) -> int | None:
        """path → bytes of the file, None when there is none."""
        with self._asked():
            try:
                answer = self._ftp.sendcmd(f"SIZE {_sent(path)}")
                if not re.fullmatch(r"213 +[0-9]{1,18} *", answer):
                    raise ftplib.error_reply(answer)
                return int(answer[3:])
            except ftplib.error_perm as error:
                if not str(error).startswith("550"):
                    return len(self._whole(path) or b"")
            if self._is_folder(path):
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            return None

    def lacks(self, folder: str) -> bool:
        """folder → whether it is certain that it does not exist there."""
        with contextlib.suppress(ftplib.Error):
            before = self._ftp.pwd()
            try:
                self._ftp.cwd(_sent(folder))
            except ftplib.error_perm as error:
                return str(error).startswith("550")
            self._ftp.cwd(before)
        return False

    def _is_folder(self, path: str) -> bool:
        """path → whether it can be gone into."""
        with contextlib.suppress(ftplib.Error):
            before = self._ftp.pwd()
            self._ftp.cwd(_sent(path))
            self._ftp.cwd(before)
            return True
        return False

    def _whole(self, path: str, offset: int = 0, most: int = 1 << 28) -> bytes | None:
        pieces: list[bytes] = []
        with self._ftp.transfercmd(f"RETR {_sent(path)}", offset or None) as data:
            while sum(map(len, pieces)) < most and (piece := data.recv(1 << 16)):
                pieces.append(piece)
            with contextlib.suppress(OSError):
                if isinstance(data, ssl.SSLSocket):
                    data.unwrap()
        try:
            self._ftp.voidresp()
        except ftplib.Error:  # the rest of a file that was not read to its end; or the transfer was cut off
            self._behind = True
        return b"".join(pieces)[:most]

    def read(self, path: str, offset: int, most: int) -> bytes:
        """path, from where, how many at most → bytes of the file."""
        with self._asked():
            try:
                return self._whole(path, offset, most) or b""
            except ftplib.error_perm as error:
                if str(error).startswith("550"):
                    return b""
                return (self._whole(path) or b"")[offset : offset + most]  # no REST

    def write(self, path: str, data: bytes) -> None:
        """path, bytes → the file has them."""
        with self._asked():
            try:
                self._ftp.storbinary(f"STOR {_sent(path)}", BytesIO(data))
            except (ftplib.error_perm, ftplib.error_temp) as error:
                raise LinkError(_words(error)) from None
            except OSError:  # the server has closed the data connection, and says why on the other one
                self._behind = True
                try:
                    self._ftp.voidresp()
                except ftplib.Error as why:
                    raise LinkError(_words(why)) from None
                raise

    def remove(self, path: str) -> None:
        """path → the file is there no more."""
        with self._asked():
            try:
                self._ftp.delete(_sent(path))
            except (ftplib.error_perm, ftplib.error_temp) as error:
                raise LinkError(_words(error)) from None

    def close(self) -> None:
        """Hangs up."""
        with contextlib.suppress(Exception):
            self._ftp.close()


def _sent(text: str) -> str:
    """text → as ftplib is given it: what goes over the line is UTF-8 (RFC 2640)."""
    return text.encode("utf-8", "surrogatepass").decode(WESTERN)


def _words(error: Exception) -> str:
    """what ftplib has read of an answer → its text, in UTF-8 or, where it is none, in Western letters; no more than a line."""
    text = str(error)
    with contextlib.suppress(UnicodeError):
        text = text.encode(WESTERN).decode("utf-8")
    return printable(text, LINE).rstrip(".")


def _context(options: dict[str, str]) -> ssl.SSLContext:
    context = ssl.create_default_context()
    if options.get("verify") == "no":
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context


class Sftp:
    """SFTP by paramiko. The control's key has to be known: in known_hosts, or by its hash."""

    def __init__(self, parts: SplitResult, options: dict[str, str]) -> None:
        paramiko = needed("paramiko", "sftp")
        logging.getLogger("paramiko").setLevel(logging.CRITICAL + 1)  # it prints a traceback of what it then raises
        self._client = paramiko.SSHClient()
        knows(self._client)
        opens(paramiko, options)
        hash_, port = options.get("hostkey", ""), parts.port or PORTS["sftp"]
        self._named = f"{parts.hostname}" if port == PORTS["sftp"] else f"[{parts.hostname}]:{port}"

        class Known(paramiko.MissingHostKeyPolicy):  # type: ignore[misc, name-defined, unused-ignore]
            """A key that is not in known_hosts: taken when its hash was stated, never otherwise."""

            def missing_host_key(self, client: Any, hostname: str, key: Any) -> None:
                own, stated = key.fingerprint, hash_.rstrip("=")
                if own.rstrip("=") == stated:
                    return
                if known := (client._system_host_keys.lookup(hostname) or {}):
                    raise changed(hostname, own, f"known_hosts has {' and '.join(k.fingerprint for k in known.values())}")
                if stated:
                    raise changed(hostname, own, f"hostkey in the port's URL is {hash_}")
                raise RefusedError(
                    f"the key of {hostname} is not known: {own}. Compare it at the control, then state "
                    f"hostkey={own} in the port's URL, or add it to known_hosts"
                )

        self._client.set_missing_host_key_policy(Known())
        self._errors = paramiko.SSHException
        try:
            with watched(self._client.close), self._asked():  # opening a channel waits for an hour by itself
                self._client.connect(
                    parts.hostname or "",
                    port,
                    unquote(parts.username or "") or None,
                    options.get("password") or None,
                    key_filename=options.get("key") or None,
                    passphrase=options.get("passphrase") or None,
                    timeout=PATIENCE,
                    banner_timeout=PATIENCE,
                    auth_timeout=PATIENCE,
                )
                self._sftp = self._client.open_sftp()
                self._sftp.get_channel().settimeout(PATIENCE)
        except AttributeError:  # a connection that was closed while paramiko was signing in leaves it without a transport
            self.close()
            raise OSError("the connection was closed while it was opened") from None
        except (OSError, EOFError, LinkError) as error:
            self.close()
            raise next(iter(getattr(error, "errors", {}).values()), error) from None  # paramiko has one for each address
        except Exception as error:  # what the library makes of a damaged key of this user in ~/.ssh
            self.close()
            raise OSError(f"a key of this user or an answer cannot be read ({type(error).__name__}: {error})"[:LINE]) from None

    @contextlib.contextmanager
    def _asked(self) -> Iterator[None]:
        """Within it, what the library raises is a LinkError where the control refuses, else an OSError or EOFError."""
        try:
            yield
        except self._errors as error:
            if type(error).__name__ == "BadHostKeyException":
                known = f"known_hosts has {error.expected_key.fingerprint}"
                raise changed(self._named, error.key.fingerprint, known) from None
            if type(error).__name__ in REFUSALS:
                raise refused(error) from None
            raise OSError(str(error) or type(error).__name__) from None

    def size(self, path: str) -> int | None:
        """path → bytes of the file, None when there is none."""
        try:
            with self._asked():
                return size_of(self._sftp.stat(path))
        except FileNotFoundError:
            return None

    def lacks(self, folder: str) -> bool:
        """folder → whether it is certain that it does not exist there."""
        try:
            with self._asked():
                self._sftp.stat(folder)
        except FileNotFoundError:
            return True
        return False

    def read(self, path: str, offset: int, most: int) -> bytes:
        """path, from where, how many at most → bytes of the file."""
        try:
            with self._asked(), self._sftp.open(path, "rb") as file:
                file.seek(offset)
                return bytes(file.read(most))
        except FileNotFoundError:
            return b""

    def write(self, path: str, data: bytes) -> None:
        """path, bytes → the file has them."""
        with self._asked(), self._sftp.open(path, "wb") as file:
            file.write(data)

    def remove(self, path: str) -> None:
        """path → the file is there no more."""
        with self._asked():
            self._sftp.remove(path)

    def close(self) -> None:
        """Hangs up."""
        with contextlib.suppress(Exception):
            self._client.close()


class Smb:
    """A share of Windows, Samba or a control, by smbprotocol (SMB 2 and 3); the first folder of a path is the share.

    The record file is opened so that its writer can go on writing, and rename or delete it.
    """

    def __init__(self, parts: SplitResult, options: dict[str, str]) -> None:
        self._smb, self._errors = needed("smbclient", "smb"), needed("smbprotocol.exceptions", "smb")
        self._host, self._port = parts.hostname or "", parts.port or PORTS["smb"]
        self._connections: dict[str, Any] = {}  # of this store alone: a connection that broke is not found again
        user, password = unquote(parts.username or ""), options.get("password", "")
        named = f"{options['domain']}\\{user}" if options.get("domain") else user
        self._to = {"port": self._port, "connection_cache": self._connections}
        with self._asked():
            self._smb.register_session(self._host, named or None, password or None, connection_timeout=PATIENCE, **self._to)

    @contextlib.contextmanager
    def _asked(self) -> Iterator[None]:
        """Within it, what the library raises is a LinkError or an OSError; it waits for an answer for ever by itself."""
        try:
            with watched(self._cut):
                yield
        except self._errors.SMBOSError as error:  # made anew, a missing file is a FileNotFoundError
            raise as_error(error.errno, str(error.strerror)) from None
        except self._errors.LogonFailure as error:
            raise refused("user or password is wrong") from error
        except self._errors.AccessDenied:
            raise LinkError("the control refuses: this user may not do that there") from None
        except (self._errors.SMBException, ValueError) as error:  # ValueError: what it could not connect to
            why = error.__cause__
            raise why if isinstance(why, OSError) else as_error(0, str(error), type(error).__name__) from None

    def _cut(self) -> None:
        for connection in list(self._connections.values()):
            with contextlib.suppress(Exception):
                connection.transport.close()

    def _path(self, path: str) -> str:
        return "\\\\" + self._host + path.replace("/", "\\")

    def size(self, path: str) -> int | None:
        """path → bytes of the file, None when there is none."""
        try:
            with self._asked():
                return size_of(self._smb.stat(self._path(path), **self._to))
        except FileNotFoundError:
            return None

    def lacks(self, folder: str) -> bool:
        """folder → whether it is certain that it does not exist there."""
        try:
            with self._asked():
                self._smb.stat(self._path(folder), **self._to)
        except FileNotFoundError:
            return True
        return False

    def read(self, path: str, offset: int, most: int) -> bytes:
        """path, from where, how many at most → bytes of the file."""
        try:
            with self._asked(), self._smb.open_file(self._path(path), "rb", share_access="rwd", **self._to) as file:
                file.seek(offset)
                return bytes(file.read(most))
        except FileNotFoundError:
            return b""

    def write(self, path: str, data: bytes) -> None:
        """path, bytes → the file has them."""
        # shared: a connection that broke leaves its handle at the server for hours, and that must not keep the next one out
        with self._asked(), self._smb.open_file(self._path(path), "wb", share_access="rwd", **self._to) as file:
            file.write(data)

    def remove(self, path: str) -> None:
        """path → the file is there no more."""
        with self._asked():
            self._smb.remove(self._path(path), **self._to)

    def close(self) -> None:
        """Hangs up."""
        with contextlib.suppress(Exception):
            self._smb.reset_connection_cache(connection_cache=self._connections)


@contextlib.contextmanager
def watched(hang_up: Callable[[], None]) -> Iterator[None]:
    """what closes a connection → within it, that is done after three times PATIENCE: the line has fallen silent."""
    timer = threading.Timer(3 * PATIENCE, hang_up)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def needed(module: str, extra: str) -> Any:
    """module, extra of this project that brings it → the module. Raises InputError that says how to install it."""
    import importlib

    try:
        return importlib.import_module(module)
    except ImportError:
        raise InputError(f"{extra}:// needs the library {module}: pip install 'tango-cnc[{extra}]'") from None


def store(scheme: str, parts: SplitResult, options: dict[str, str]) -> Store:
    """ftp, ftps, sftp or smb, host and user, settings → open store. Raises OSError, LinkError, InputError."""
    if scheme == "sftp":
        return Sftp(parts, options)
    if scheme == "smb":
        return Smb(parts, options)
    return Ftp(parts, options, scheme == "ftps")
