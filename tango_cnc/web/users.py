"""Users of the server: a JSON file of names, roles and argon2 hashes, and the sign-ins of those who are signed in."""

from __future__ import annotations

import hashlib
import json
import os
import re
import secrets
import shlex
import threading
import time
import unicodedata
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import argon2

from ..files import write_text
from ..files.checked import printable
from ..files.readjson import read_json
from ..records import InputError
from .guard import same
from .settings import ROLES, Role

NAME = re.compile(r"[^\W_][\w.@-]{0,63}")  # letters of every language
SHORTEST = 10  # characters of a password
LONGEST = 256
IDLE, WHOLE = 2 * 3600.0, 12 * 3600.0  # s: without a request, and in all
MOST = 1000  # sign-ins
FORMAT = "tango-users/1"
_HASHER = argon2.PasswordHasher(time_cost=2, memory_cost=19 * 1024, parallelism=1)  # OWASP's second choice for argon2id
_NOBODY = _HASHER.hash(secrets.token_hex(16))
_ONE_AT_A_TIME = threading.Semaphore(2)  # hashing is meant to be slow; a flood of it must not take the machine


@dataclass(frozen=True)
class User:
    """Who is signed in."""

    name: str
    role: Role
    proof: str = ""  # hash of the password with which somebody signed in; another one has ended that


def read_users(file: Path) -> dict[str, tuple[str, Role]]:
    """users file → {name: (hash, role)}. Raises InputError for a file that is none, or that others may read."""
    if not file.exists():
        raise InputError(f"{file}: no such file; make it with 'tango serve --users {shlex.quote(str(file))} --add-user NAME'")
    data = read_json(file, "what 'tango serve --add-user' writes")
    if data.get("format") != FORMAT or not isinstance(data.get("users"), dict):
        raise InputError(f"{file}: found no {FORMAT}; allowed: what 'tango serve --add-user' writes")
    if os.name == "posix" and file.stat().st_mode & 0o077:
        raise InputError(f"{file}: others may read it; allowed: its owner alone (chmod 600 {file})")
    found: dict[str, tuple[str, Role]] = {}
    for name, row in data["users"].items():
        if not NAME.fullmatch(name) or not isinstance(row, dict) or row.get("role") not in ROLES:
            raise InputError(f"{file}: {printable(name, 80)}: found {row!r:.80}; allowed: hash and role, one of {', '.join(ROLES)}")
        found[name] = (str(row.get("hash")), row["role"])
    return found


def check_name(name: str) -> None:
    """name of a new user → nothing. Raises InputError for one that no user may have."""
    if not NAME.fullmatch(plain(name)):
        raise InputError(f"--add-user: found {name!r}; allowed: letters, digits, . _ @ -, at most 64")


def plain(name: str) -> str:
    """name as it was typed → the same with one character for each letter: ë is one key or two, and one user."""
    return unicodedata.normalize("NFC", name)


def add_user(file: Path, name: str, password: str, role: Role) -> None:
    """users file, who, password, role → the user is in it, in the place of one with that name. Raises InputError."""
    check_name(name)
    name = plain(name)
    if not SHORTEST <= len(password) <= LONGEST:
        raise InputError(f"password: found {len(password)} characters; allowed: {SHORTEST} to {LONGEST}")
    users = read_users(file) if file.exists() else {}
    users[name] = (_HASHER.hash(password), role)
    _write(file, users)


def verified(file: Path, name: str, password: str) -> User | None:
    """users file, name, password → the user, or None; it takes as long for a name that is not there."""
    users, name = read_users(file), plain(name)
    known, role = users.get(name, (_NOBODY, "view"))
    with _ONE_AT_A_TIME:
        try:
            _HASHER.verify(known, password[:LONGEST])
        except (argon2.exceptions.VerificationError, argon2.exceptions.InvalidHashError):
            return None
    return User(name, role, known) if name in users else None


def remove_user(file: Path, name: str) -> None:
    """users file, who → the user is not in it any more. Raises InputError for one who is not there."""
    users, name = read_users(file), plain(name)
    if name not in users:
        raise InputError(f"--remove-user: found {printable(name, 80)}; allowed: {', '.join(sorted(users)) or 'nobody is in it'}")
    _write(file, {n: row for n, row in users.items() if n != name})


def _write(file: Path, users: Mapping[str, tuple[str, Role]]) -> None:
    rows = {n: {"hash": h, "role": r} for n, (h, r) in sorted(users.items())}
    write_text(file, json.dumps({"format": FORMAT, "users": rows}, indent=1) + "\n")
    os.chmod(file, 0o600)


@dataclass
class UsersFile:
    """The users of a file as it is now; it is read again where it has changed."""

    file: Path
    _seen: tuple[int, int, int, int] | None = None
    _users: Mapping[str, tuple[str, Role]] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def user(self, signed: User) -> User | None:
        """who has signed in → the same with the role of now; None for one who was removed, or whose password is another one now."""
        with self._lock:
            stat = self.file.stat()
            seen = (stat.st_mtime_ns, stat.st_ctime_ns, stat.st_size, stat.st_ino)
            if seen != self._seen:
                self._users, self._seen = read_users(self.file), seen
            proof, role = self._users.get(signed.name, ("", "view"))
        return User(signed.name, role, proof) if proof and same(proof, signed.proof) else None


@dataclass
class SignIn:
    """One who is signed in: until when, and the token that every form has to bring along."""

    user: User
    csrf: str
    born: float
    seen: float


@dataclass
class SignIns:
    """Sign-ins in memory: they end with the server. Only hashes of their keys are kept."""

    clock: Callable[[], float] = time.monotonic
    _open: OrderedDict[str, SignIn] = field(default_factory=OrderedDict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def begin(self, user: User) -> str:
        """user → key for the cookie."""
        key, now = secrets.token_urlsafe(32), self.clock()
        with self._lock:
            self._open[_digest(key)] = SignIn(user, secrets.token_urlsafe(32), now, now)
            while len(self._open) > MOST:
                self._open.popitem(last=False)
        return key

    def of(self, key: str | None) -> SignIn | None:
        """key of a cookie → its sign-in while it lasts."""
        if not key or len(key) > 100:
            return None
        now = self.clock()
        with self._lock:
            found = self._open.get(_digest(key))
            if found is None:
                return None
            if now - found.seen > IDLE or now - found.born > WHOLE:
                del self._open[_digest(key)]
                return None
            found.seen = now
            return found

    def end(self, key: str | None) -> None:
        """key of a cookie → its sign-in is over."""
        with self._lock:
            self._open.pop(_digest(key or ""), None)

    def __len__(self) -> int:
        return len(self._open)


def _digest(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()
