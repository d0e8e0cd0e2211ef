"""OPC UA through asyncua: requests and answers in words (`protocols/opcua.py`), one at a time."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import time
from collections.abc import Callable
from typing import Any
from urllib.parse import quote

from ...records import InputError, LinkError
from ..address import Address
from ..nodes import read_nodes
from ..ways import Way
from ._line import Lost, reason
from ._refused import RefusedError
from ._remote import HEAD, LIES, OURS, began
from ._stores import needed

ANSWER = 4.0  # s that a server may take to answer
LOOK = 0.05  # s between two looks at the same
PIECE = 1 << 14  # bytes of a file in one request
AGAIN = 60.0  # s for which a connection that broke is tried again; what is asked can be asked twice
BETWEEN = 2.0  # s between two tries
READ, ERASE = 1, 2 | 4  # modes of a FileType: read; write after everything has been erased
TEXT = 300  # characters of an alarm
NAME = "TANGO.MPF"
LOGIN = ("UserAccessDenied", "IdentityToken")
BROKEN = ("Session", "Connection", "SecureChannel", "Timeout", "Shutdown")  # of errors of a connection


def foreseen(address: Address) -> None:
    """port → nothing. Raises InputError where the library is missing, or a name is no NodeId."""
    _parsed(address)


def _parsed(address: Address) -> dict[str, Any]:
    """port → {what: NodeId as the library has it, or None}. Raises InputError."""
    ua, nodes = needed("asyncua.ua", "opcua"), read_nodes(address.options.get("nodes", ""))
    found = {}
    for what, name in {**nodes.looked_at, "text": nodes.text, "program": address.options.get("program", "")}.items():
        try:
            found[what] = ua.NodeId.from_string(name) if name else None
        except ua.UaError:
            raise InputError(f'{what}: found {name!r}; allowed: a NodeId, e.g. "ns=2;s=/Channel/Parameter/R[u1,700]"') from None
    return found


class OpcUa:
    """A session with a server; one that breaks is opened again for a minute."""

    chunk = 1 << 16

    def __init__(self, address: Address) -> None:
        self._ua, self._sync, self._options = needed("asyncua.ua", "opcua"), needed("asyncua.sync", "opcua"), address.options
        logging.getLogger("asyncua").setLevel(logging.CRITICAL)
        self._url = f"opc.tcp://{address.target}/{address.options.get('path', '').lstrip('/')}"
        self._nodes = read_nodes(address.options.get("nodes", ""))
        self._ids = _parsed(address)
        self._request, self._before = b"", b""
        self._client: Any = None
        self._writing = False  # a program goes there, or has gone
        self._open()

    def _open(self) -> None:
        """Raises OSError when nobody answers, LinkError when the server refuses."""
        loop = self._sync.ThreadLoop(AGAIN)
        loop.daemon = True  # a session that was left open ends no program late
        loop.start()
        client = self._sync.Client(self._url, ANSWER, loop)
        client.close_tloop = True
        try:
            if user := self._options.get("user"):
                client.set_user(user)
                client.set_password(self._options.get("password", ""))
            client.connect()
        except self._ua.UaStatusCodeError as error:
            client.disconnect()
            if any(word in type(error).__name__ for word in LOGIN):
                raise RefusedError(
                    f"the control refuses the login ({error}): correct user= and password= in the port's URL"
                ) from None
            raise LinkError(f"the control refuses: {error}") from None
        except Exception as error:
            with contextlib.suppress(Exception):
                client.disconnect()
            raise error if isinstance(error, OSError) else OSError(f"{type(error).__name__}: {error}") from None
        self._client = client

    def read(self, timeout: float) -> bytes:
        """s → the answer to the request written last; empty when there is none to answer. Raises Lost."""
        line, end, rest = self._request.partition(b"\n")
        if not end:
            time.sleep(timeout)
            return b""
        self._request = rest
        if line == self._before:  # the control is being waited for
            time.sleep(LOOK)
        self._before = line
        name, _, value = line.decode("ascii").partition(" ")
        verbs: dict[str, Callable[[], str]] = {
            "ask": self._ask,
            "get": self._get,
            "alarm": lambda: f"ALARM {quote(str(self._values(['text'])[0])[:TEXT])}",
            "take": lambda: self._take(int(value)),
            "put": lambda: f"PUT {self._put(bytes.fromhex(value))}",
        }
        return f"{self._kept(verbs[name])}\n".encode("ascii")

    def _kept(self, verb: Callable[[], str]) -> str:
        """what to do → the answer; over a new connection where the old one broke. Raises Lost after a minute."""
        until = time.monotonic() + AGAIN
        while True:
            try:
                if self._client is None:
                    self._open()
                return verb()
            except self._ua.UaStatusCodeError as error:
                why = str(error)
                if not _broke(error):
                    return f"! {quote(why)}"
            except LinkError as error:
                return f"! {quote(str(error))}"
            except Exception as error:  # asyncio, sockets and the library each have their own for a line that broke
                why = reason(error) or type(error).__name__
            self.close()
            if time.monotonic() > until:
                raise Lost(f"the control cannot be reached any more: {why}{LIES if self._writing else ''}")
            time.sleep(BETWEEN)

    def write(self, data: bytes) -> int:
        """bytes of a request → how many of them are taken: all."""
        self._request += data
        return len(data)

    def close(self) -> None:
        """Ends the session."""
        if self._client is not None:
            with contextlib.suppress(Exception):
                self._client.disconnect()
            self._client = None

    def _values(self, names: list[str]) -> list[Any]:
        """what is meant → the values, read in one request. Raises LinkError for one without a good value."""
        nodes = [self._client.get_node(self._ids[name]) for name in names]
        found = self._client.read_attributes(nodes, self._ua.AttributeIds.Value)
        for name, value in zip(names, found, strict=True):
            if not value.StatusCode.is_good() or value.Value is None or value.Value.Value is None:
                raise LinkError(f"{name} ({self._ids[name].to_string()}) has no good value: {value.StatusCode.name}")
        return [value.Value.Value for value in found]

    def _ask(self) -> str:
        info = self._client.get_node(self._ua.ObjectIds.Server_ServerStatus_BuildInfo).read_value()
        return (
            f"ASK {quote(' '.join(str(text) for text in (info.ManufacturerName, info.ProductName, info.SoftwareVersion) if text))}"
        )

    def _get(self) -> str:
        names = list(self._nodes.looked_at)
        words = []
        for name, value in zip(names, self._values(names), strict=True):
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise LinkError(f"{name} ({self._ids[name].to_string()}): found {value!r:.40}; allowed: a number")
            words.append(f"{name}={float(value)!r}" if isinstance(value, float) else f"{name}={int(value)}")
        return f"GET {' '.join(words)}"

    def _take(self, number: int) -> str:
        """number → written, in the type that the variable has."""
        node = self._client.get_node(self._ids["taken"])
        kind = node.read_data_type_as_variant_type()
        real = kind in (self._ua.VariantType.Double, self._ua.VariantType.Float)
        value = self._ua.Variant(float(number) if real else number, kind)
        node.write_value(self._ua.DataValue(value))  # without time stamps, which many controls refuse
        return "TAKE"

    def _put(self, program: bytes) -> str:
        """program → SHA-256 of what was read back. Raises LinkError where it may not or cannot go."""
        place = self._client.get_node(self._ids["program"])
        methods = self._methods(place)
        if "Open" not in methods:
            place = self._in_folder(place, methods)
            methods = self._methods(place)
        file = (place, methods)
        head = self._content(file, HEAD)
        if head and not OURS.search(head) and not began(head, program):
            raise LinkError("the file at the control is no program of 'tango plan'; it would be lost: another name")
        self._writing = True
        try:
            with self._opened(file, ERASE) as (call, handle):
                for at in range(0, len(program), PIECE):
                    call("Write", handle, self._ua.Variant(program[at : at + PIECE], self._ua.VariantType.ByteString))
            back = self._content(file, len(program) + 1)
        except (self._ua.UaStatusCodeError, LinkError) as error:
            if _broke(error):
                raise
            raise LinkError(f"the program cannot be put at the control: {error}{self._left(file, program)}") from None
        if len(back) < len(program):
            self._left(file, program)  # a disk that was full without a word; what was read says that it is not the program
        self._writing = False
        return hashlib.sha256(back).hexdigest()

    def _left(self, file: tuple[Any, dict[str, Any]], program: bytes) -> str:
        """node of a file with its methods, program that was cut off → what became of the part of it, as the end of a sentence."""
        try:
            if not program.startswith(self._content(file, len(program))):
                return ""  # the file of before
            with self._opened(file, ERASE):
                pass
            if self._content(file, 1):
                return LIES
        except (self._ua.UaStatusCodeError, LinkError):
            return LIES
        self._writing = False
        return "; the part of it that lay there was erased, and the file is empty"

    def _methods(self, node: Any) -> dict[str, Any]:
        """node → {name: method of it}, whatever name space the server puts them into."""
        return {name: method for method, name in self._named(node.get_methods())}

    def _named(self, nodes: list[Any]) -> list[tuple[Any, str]]:
        """nodes → each with its name; asked for in one request."""
        found = self._client.read_attributes(nodes, self._ua.AttributeIds.BrowseName) if nodes else []
        return [(node, value.Value.Value.Name) for node, value in zip(nodes, found, strict=True) if value.StatusCode.is_good()]

    def _in_folder(self, folder: Any, methods: dict[str, Any]) -> Any:
        """node of a folder, its methods → the file of our name in it, made where there is none.

        Raises LinkError for a server without files.
        """
        name = self._options.get("name", NAME)
        if "CreateFile" not in methods:
            raise LinkError(
                "program: the node has neither Open nor CreateFile: this server transfers no files there; bring the program"
            )
        for child, called in self._named(folder.get_children()):
            if called == name:
                return child
        made = folder.call_method(methods["CreateFile"], self._ua.Variant(name), self._ua.Variant(False))
        return self._client.get_node(made[0])

    @contextlib.contextmanager
    def _opened(self, file: tuple[Any, dict[str, Any]], mode: int) -> Any:
        """node of a file with its methods, mode → (call a method of it, handle); closed behind it."""
        node, methods = file

        def call(name: str, *arguments: Any) -> Any:
            if name not in methods:
                raise LinkError(f"the file at the control has no method {name}")
            return node.call_method(methods[name], *arguments)

        handle = self._ua.Variant(call("Open", self._ua.Variant(mode, self._ua.VariantType.Byte)), self._ua.VariantType.UInt32)
        try:
            yield call, handle
        finally:
            call("Close", handle)

    def _content(self, file: tuple[Any, dict[str, Any]], most: int) -> bytes:
        """node of a file with its methods, bytes at most → what is in it."""
        data = b""
        with self._opened(file, READ) as (call, handle):
            while len(data) < most:
                count = self._ua.Variant(min(PIECE, most - len(data)), self._ua.VariantType.Int32)
                if not (piece := call("Read", handle, count)):
                    break
                data += piece
        return data


def _broke(error: BaseException) -> bool:
    """error of the library → whether it is one of the connection, which may be made anew."""
    return any(word in type(error).__name__ for word in BROKEN)


WAYS = {"opcua": Way(OpcUa, "host", foreseen=foreseen)}
