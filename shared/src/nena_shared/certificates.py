"""How long a program's certificates are valid, read from their PEM files without an X.509 library."""

from __future__ import annotations

import ssl
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
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
# %y counts from 1969 and RFC 5280 from 1950: no certificate is of the years between
FORMS: Final = {0x17: "%y%m%d%H%M%SZ", 0x18: "%Y%m%d%H%M%SZ"}
"""Tags of UTCTime and GeneralizedTime, and their only forms in certificates (RFC 5280, 4.1.2.5)."""
LONG: Final = 0x80
"""From here on, the first byte of a length is the number of bytes that follow."""


class _Element(NamedTuple):
    tag: int
    content: bytes


class Validity(NamedTuple):
    """When a certificate is valid, UTC."""

    begin: datetime
    end: datetime

    @property
    def lifetime(self) -> float:
        """Return how long it is valid in all, s."""
        return (self.end - self.begin).total_seconds()


@dataclass(frozen=True, slots=True)
class Certificates:
    """The certificate files of a program, if it has any."""

    http: Path | None = None
    """Of its HTTP server; what counts is what the server has loaded."""
    mqtt: Path | None = None
    """With which it identifies itself at the broker; each connection reads the file again."""

    def validity(self) -> Mapping[str, Validity]:
        """Return the validity by purpose; without certificates that cannot be read."""
        found: dict[str, Validity] = {}
        for purpose, file in (("http", self.http), ("mqtt", self.mqtt)):
            if file is None:
                continue
            try:
                loaded = _loaded.get(file) if purpose == "http" else None
                found[purpose] = loaded or _read_validity(file)
            except (OSError, ValueError) as error:
                log.warning("certificate unreadable", file=str(file), reason=str(error))
        return found


_loaded: Final[dict[Path, Validity]] = {}
"""What HTTP servers of this program have loaded: a file may have been renewed since."""


def remember_http(file: Path | None) -> None:
    """Read the certificate that an HTTP server has just loaded."""
    if file:
        _loaded.pop(file, None)
        with suppress(OSError, ValueError):
            _loaded[file] = _read_validity(file)


def _read_validity(file: Path) -> Validity:
    """Return the validity of a file; comments around the certificate may have any encoding."""
    return validity_of(file.read_text(encoding="latin-1"))


def validity_of(pem: str) -> Validity:
    """Return the validity of the first certificate in ``pem``.

    Raises:
        ValueError: there is none, or it is not an X.509 certificate.
    """
    begin, end = pem.find(BEGIN), pem.find(END)
    if not 0 <= begin < end:
        raise ValueError("no PEM certificate found")
    try:
        # the first one of a chain is the program's own (RFC 8446, 4.4.2)
        (certificate,) = _elements(ssl.PEM_cert_to_DER_cert(pem[begin : end + len(END)]))
        fields = [
            element
            for element in _elements(_elements(certificate.content)[0].content)
            if element.tag != VERSION
        ]
        first, last = _elements(fields[VALIDITY].content)
        return Validity(_time(first), _time(last))
    except (IndexError, KeyError, ValueError) as error:
        raise ValueError("not an X.509 certificate") from error


def _time(element: _Element) -> datetime:
    return datetime.strptime(element.content.decode("ascii"), FORMS[element.tag]).replace(tzinfo=UTC)


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
