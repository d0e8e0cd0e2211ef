"""Certificate and key of a server: looked at before it starts, so that what is wrong with them is a sentence."""

from __future__ import annotations

import ssl
from pathlib import Path

from ..files.checked import read_bytes
from ..records import InputError
from ..texts import say


def checked(certificate: Path, key: Path) -> None:
    """PEM files of a certificate and of its key → nothing. Raises InputError where a server could not use them."""
    for file, line, what in (
        (certificate, b"-----BEGIN CERTIFICATE-----", "certificate"),
        (key, b"PRIVATE KEY-----", "private key"),
    ):
        if line not in read_bytes(file):
            raise InputError(f"{file}: found no {what} in it; {say('certificate.whole')}")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_verify_locations(cafile=certificate)
    except (ssl.SSLError, OSError):
        raise InputError(f"{certificate}: cannot be read as a certificate; {say('certificate.whole')}") from None

    def locked() -> str:
        raise InputError(f"{key}: found a key with a pass phrase; allowed: one without, 'openssl pkey -in {key} -out NEW' makes it")

    try:
        context.load_cert_chain(certificate, key, locked)
    except ssl.SSLError as error:
        if error.reason == "KEY_VALUES_MISMATCH":
            raise InputError(f"{key}: it is not the key of {certificate}; allowed: that of its request") from None
        raise InputError(
            f"{key}: cannot be used with {certificate} ({error.reason or 'damaged'}); "
            f"{say('certificate.whole')}, long enough for today"
        ) from None
    except OSError as error:
        raise InputError(f"{key}: cannot be read ({error.strerror}); check the file and its permissions") from None
