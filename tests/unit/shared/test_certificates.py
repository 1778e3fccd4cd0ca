from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from nena_shared.certificates import Certificates, Validity, validity_of
from nena_shared.web.server import HttpServer
from nena_shared.web.settings import HttpSettings
from support.certificates import Authority

BEGIN = datetime(2020, 1, 1, tzinfo=UTC)


async def nothing_served(*_: object) -> None:
    """Answer nothing."""


def pem_until(end: datetime, *, subject: str = "nena") -> str:
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, subject)])
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(BEGIN)
        .not_valid_after(end)
        .sign(key, hashes.SHA256())
    )
    return made.public_bytes(serialization.Encoding.PEM).decode()


@pytest.mark.parametrize("year", [2026, 2049, 2050, 2126])
def test_validity_in_both_forms_of_time(year: int) -> None:
    end = datetime(year, 3, 4, 5, 6, 7, tzinfo=UTC)
    found = validity_of(pem_until(end))
    assert found == (BEGIN, end)
    assert found.lifetime == (end - BEGIN).total_seconds()


def test_the_first_certificate_of_a_chain_counts() -> None:
    end = datetime(2027, 1, 1, tzinfo=UTC)
    chain = pem_until(end) + pem_until(end + timedelta(days=900))
    assert validity_of(f"subject=CN = nena\n{chain}").end == end


@pytest.mark.parametrize(
    "text",
    [
        "",
        "-----END CERTIFICATE-----\n-----BEGIN CERTIFICATE-----",
        "-----BEGIN CERTIFICATE-----\n-----END CERTIFICATE-----\n",
        "-----BEGIN CERTIFICATE-----\nMAA=\n-----END CERTIFICATE-----\n",
        "-----BEGIN CERTIFICATE-----\nnot base 64\n-----END CERTIFICATE-----\n",
    ],
)
def test_what_is_no_certificate_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="certificate"):
        validity_of(text)


def test_damaged_certificates_are_refused_or_read() -> None:
    """However a file is cut, only a ValueError comes out."""
    text = pem_until(datetime(2030, 1, 1, tzinfo=UTC))
    lines = text.splitlines()
    for kept in range(1, len(lines) - 1):
        try:
            validity_of("\n".join([*lines[:kept], lines[-1]]))
        except ValueError:
            continue


def test_unreadable_files_are_left_out(tmp_path: Path) -> None:
    files = Authority(tmp_path).sign("robot")
    found = Certificates(http=tmp_path / "missing.pem", mqtt=files.certificate).validity()
    assert found.keys() == {"mqtt"}
    assert abs(found["mqtt"].end - datetime.now(UTC) - timedelta(days=1)) < timedelta(minutes=1)
    assert Certificates().validity() == {}


def test_renewed_file_counts_once_the_program_uses_it(tmp_path: Path) -> None:
    """The HTTP server presents the certificate that it has loaded until it has looked at the file again."""
    authority = Authority(tmp_path)
    server, client = authority.sign("server"), authority.sign("client")
    HttpServer(
        nothing_served, HttpSettings(port=0, tls_certificate=server.certificate, tls_key=server.key)
    ).stop()
    authority.sign("server", days=100)
    authority.sign("client", days=100)
    found = Certificates(server.certificate, client.certificate).validity()
    in_days = {
        name: round((each.end - datetime.now(UTC)) / timedelta(days=1)) for name, each in found.items()
    }
    assert in_days == {"http": 1, "mqtt": 100}


def test_comments_around_a_certificate_may_have_any_encoding(tmp_path: Path) -> None:
    """OpenSSL ignores them."""
    end = datetime(2030, 1, 1, tzinfo=UTC)
    file = tmp_path / "commented.pem"
    for encoding in ("utf-8", "latin-1"):
        file.write_bytes(f"subject=O = Straße\r\n{pem_until(end)}".encode(encoding))
        assert Certificates(mqtt=file).validity() == {"mqtt": Validity(BEGIN, end)}
