"""When the certificates end that a program presents, read from their PEM files without an X.509 library."""

from __future__ import annotations

import ssl
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

from nena_shared.log import get_logger

log = get_logger(__name__)

BEGIN: Final = "-----BEGIN CERTIFICATE-----"
END: Final = "-----END CERTIFICATE-----"

VERSION: Final = 0xA0
"""Tag of the version, which certificates of version 1 lack."""
VALIDITY: Final = 3
"""Position of the validity, after serial number, signature algorithm and issuer (RFC 5280, 4.1)."""
FORMS: Final = {0x17: "%y%m%d%H%M%SZ", 0x18: "%Y%m%d%H%M%SZ"}
"""Tags of UTCTime and GeneralizedTime, and their only forms in certificates (RFC 5280, 4.1.2.5)."""
LONG: Final = 0x80
"""From here on, the first byte of a length is the number of bytes that follow."""


class _Element(NamedTuple):
    tag: int
    content: bytes


@dataclass(frozen=True, slots=True)
class Certificates:
    """The certificate files of a program, if it has any."""

    http: Path | None = None
    """Of its HTTP server, which uses the file as it was at the start."""
    mqtt: Path | None = None
    """With which it identifies itself at the broker; each connection reads the file again."""

    def ends(self) -> Mapping[str, float]:
        """Return the end of validity by purpose, Unix time; without certificates that cannot be read."""
        found: dict[str, float] = {}
        for purpose, file, end_of in (("http", self.http, _end_at_start), ("mqtt", self.mqtt, _end)):
            if file is None:
                continue
            try:
                found[purpose] = end_of(file)
            except (OSError, ValueError) as error:
                log.warning("certificate unreadable", file=str(file), reason=str(error))
        return found


def _end(file: Path) -> float:
    """Return the end of validity, Unix time; comments around the certificate may have any encoding."""
    return not_after(file.read_text(encoding="latin-1")).timestamp()


@cache
def _end_at_start(file: Path) -> float:
    """Return what the first call in this program has found."""
    return _end(file)


def remember_http(file: Path | None) -> None:
    """Read the certificate that an HTTP server has loaded, before the file is renewed."""
    if file:
        with suppress(OSError, ValueError):
            _end_at_start(file)


def not_after(pem: str) -> datetime:
    """Return the end of validity of the first certificate in ``pem``.

    Raises:
        ValueError: there is none, or it is not an X.509 certificate.
    """
    begin, end = pem.find(BEGIN), pem.find(END)
    if not 0 <= begin < end:
        message = "no PEM certificate found"
        raise ValueError(message)
    try:
        (certificate,) = _elements(ssl.PEM_cert_to_DER_cert(pem[begin : end + len(END)]))
        fields = [
            each for each in _elements(_elements(certificate.content)[0].content) if each.tag != VERSION
        ]
        _, last = _elements(fields[VALIDITY].content)
        return datetime.strptime(last.content.decode("ascii"), FORMS[last.tag]).replace(tzinfo=UTC)
    except (IndexError, KeyError, ValueError) as error:
        message = "not an X.509 certificate"
        raise ValueError(message) from error


def _elements(der: bytes) -> list[_Element]:
    """Return the elements of a sequence (X.690, DER); the last one is cut short if ``der`` is."""
    found = []
    at = 0
    while at < len(der):
        tag, length = der[at], der[at + 1]
        at += 2
        if length >= LONG:
            more = length - LONG
            length = int.from_bytes(der[at : at + more])
            at += more
        found.append(_Element(tag, der[at : at + length]))
        at += length
    return found
