"""The site's CA: issues and revokes certificates of the broker, robots, hosts and services."""

from __future__ import annotations

import os
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import NamedTuple, Self

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

AUTHORITY_DAYS = 3650
# RFC 5280, A.1: ub-common-name.
COMMON_NAME = 64
"""Maximum length of a common name; servers are identified by alternative names, which may be
longer."""
SKEW = timedelta(hours=1)
"""Tolerated delay of the clocks of robots and the broker."""


class Pair(NamedTuple):
    """A certificate and its private key (PEM)."""

    certificate: bytes
    key: bytes
    serial_number: int


class Authority:
    """A CA. Anyone with its key can impersonate any client of the site."""

    def __init__(self, certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey) -> None:
        self._certificate = certificate
        self._key = key

    @classmethod
    def new(cls, name: str, now: datetime) -> Self:
        """Create a CA that is valid for ten years."""
        key = ec.generate_private_key(ec.SECP256R1())
        subject = _common_name(name[:COMMON_NAME])
        built = (
            _certificate_builder(subject, subject, key, key, now, now + timedelta(days=AUTHORITY_DAYS))
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(_key_usage(signs=True), critical=True)
        )
        return cls(built.sign(key, hashes.SHA256()), key)

    @classmethod
    def load(cls, certificate: Path, key: Path) -> Self:
        """Load a CA from the output of :attr:`pem` and :meth:`key_pem`."""
        private = serialization.load_pem_private_key(key.read_bytes(), None)
        if not isinstance(private, ec.EllipticCurvePrivateKey):
            raise TypeError(f"{key} is not the key of a CA created by nena-deploy")
        return cls(x509.load_pem_x509_certificate(certificate.read_bytes()), private)

    @property
    def pem(self) -> bytes:
        """CA certificate (PEM), distributed to every client."""
        return self._certificate.public_bytes(serialization.Encoding.PEM)

    def key_pem(self) -> bytes:
        """Return the CA key (PEM). Keep it secret."""
        return _private_pem(self._key)

    def for_server(self, hosts: Iterable[str], now: datetime, days: int) -> Pair:
        """Issue a certificate for a server with these names and addresses.

        Raises:
            ValueError: one of them is neither a name nor an address.
        """
        names = list(hosts)
        alternatives = x509.SubjectAlternativeName([_host_name(name) for name in names])
        return self._sign_pair(names[0][:COMMON_NAME], now, days, alternatives, server=True)

    def for_client(self, name: str, now: datetime, days: int) -> Pair:
        """Issue a certificate for a client with this user name."""
        return self._sign_pair(name, now, days, None, server=False)

    def revocations(self, certificates: Iterable[int], now: datetime) -> bytes:
        """Return the revocation list (PEM) for certificates by their serial numbers.

        The list is backdated: a broker whose clock is behind rejects all clients by a list from the future.
        """
        # Valid as long as the CA: with an expired list, the broker would reject all clients.
        issued = self._certificate.not_valid_after_utc
        builder = x509.CertificateRevocationListBuilder(self._certificate.subject, now - SKEW, issued)
        for certificate in certificates:
            revoked = x509.RevokedCertificateBuilder().serial_number(certificate).revocation_date(now).build()
            builder = builder.add_revoked_certificate(revoked)
        return builder.sign(self._key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM)

    def _sign_pair(
        self, name: str, now: datetime, days: int, more: x509.SubjectAlternativeName | None, *, server: bool
    ) -> Pair:
        key = ec.generate_private_key(ec.SECP256R1())
        # RFC 5280, 6.1.3: nobody accepts it longer than its CA.
        until = min(now + timedelta(days=days), self._certificate.not_valid_after_utc)
        purpose = ExtendedKeyUsageOID.SERVER_AUTH if server else ExtendedKeyUsageOID.CLIENT_AUTH
        built = (
            _certificate_builder(_common_name(name), self._certificate.subject, key, self._key, now, until)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_key_usage(signs=False), critical=True)
            .add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
        )
        if more is not None:
            built = built.add_extension(more, critical=False)
        signed = built.sign(self._key, hashes.SHA256())
        return Pair(signed.public_bytes(serialization.Encoding.PEM), _private_pem(key), signed.serial_number)


def write_secret(path: Path, content: bytes) -> None:
    """Write a file that only its owner may read."""
    # Mode at creation: with a later chmod alone, others could open a new file before it.
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "wb") as file:
        os.fchmod(file.fileno(), 0o600)  # a file that exists keeps its mode when it is opened
        file.write(content)


def serial_number(certificate: Path) -> int:
    """Return the serial number of a certificate."""
    return x509.load_pem_x509_certificate(certificate.read_bytes()).serial_number


def expiry(certificate: Path) -> datetime:
    """Return the expiry time of a certificate."""
    return x509.load_pem_x509_certificate(certificate.read_bytes()).not_valid_after_utc


def utc_now() -> datetime:
    """Return the current time."""
    return datetime.now(UTC)


def _certificate_builder(  # noqa: PLR0917 - the contents of every certificate
    subject: x509.Name,
    issuer: x509.Name,
    key: ec.EllipticCurvePrivateKey,
    issuer_key: ec.EllipticCurvePrivateKey,
    now: datetime,
    until: datetime,
) -> x509.CertificateBuilder:
    """Start a certificate; CPython 3.13 rejects it without both key identifiers (RFC 5280, 4.2.1)."""
    identifier = x509.SubjectKeyIdentifier.from_public_key(key.public_key())
    issuers = x509.AuthorityKeyIdentifier.from_issuer_public_key(issuer_key.public_key())
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - SKEW)
        .not_valid_after(until)
        .add_extension(identifier, critical=False)
        .add_extension(issuers, critical=False)
    )


def _key_usage(*, signs: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        # TLS 1.3 requires it of every certificate with key usages (RFC 8446, 4.4.2.2).
        digital_signature=not signs,
        key_cert_sign=signs,
        crl_sign=signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _host_name(text: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_address(text))
    except ValueError:
        return x509.DNSName(text)


def _common_name(text: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])


def _private_pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    form, plain = serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    return key.private_bytes(serialization.Encoding.PEM, form, plain)
