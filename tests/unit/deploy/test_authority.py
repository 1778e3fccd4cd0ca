from __future__ import annotations

from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID

from nena_deploy.authority import Authority, expiry, write_secret

NOW = datetime(2026, 1, 1, tzinfo=UTC)


@pytest.fixture(scope="module")
def authority() -> Authority:
    return Authority.new("site", NOW)


def test_server_certificate_is_valid_for_each_of_its_names(authority: Authority) -> None:
    made = authority.for_server(["broker.example", "192.0.2.1"], NOW, 30)
    certificate = x509.load_pem_x509_certificate(made.certificate)

    certificate.verify_directly_issued_by(x509.load_pem_x509_certificate(authority.pem))
    names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.DNSName) == ["broker.example"]
    assert names.get_values_for_type(x509.IPAddress) == [ip_address("192.0.2.1")]
    purpose = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert list(purpose) == [ExtendedKeyUsageOID.SERVER_AUTH]


def test_client_certificate_is_valid_for_neither_server_nor_ca(authority: Authority) -> None:
    made = authority.for_client("ACME/1", NOW, 30)
    certificate = x509.load_pem_x509_certificate(made.certificate)

    assert certificate.subject.rfc4514_string() == "CN=ACME/1"
    purpose = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert list(purpose) == [ExtendedKeyUsageOID.CLIENT_AUTH]
    assert not certificate.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    assert certificate.not_valid_after_utc == NOW + timedelta(days=30)
    assert certificate.not_valid_before_utc < NOW, "a robot's clock may be behind"


def test_revoked_certificate_is_on_the_list(authority: Authority) -> None:
    made = authority.for_client("ACME/1", NOW, 30)
    revoked = x509.load_pem_x509_crl(authority.revocations([made.serial_number], NOW))

    assert [each.serial_number for each in revoked] == [made.serial_number]
    assert list(x509.load_pem_x509_crl(authority.revocations([], NOW))) == []
    assert revoked.last_update_utc < NOW, "a broker's clock may be behind"


def test_it_is_kept_in_two_files(authority: Authority, tmp_path: Path) -> None:
    (tmp_path / "ca.pem").write_bytes(authority.pem)
    write_secret(tmp_path / "key.pem", authority.key_pem())
    again = Authority.load(tmp_path / "ca.pem", tmp_path / "key.pem")

    assert again.pem == authority.pem
    made = x509.load_pem_x509_certificate(again.for_client("x", NOW, 1).certificate)
    made.verify_directly_issued_by(x509.load_pem_x509_certificate(authority.pem))
    assert (tmp_path / "key.pem").stat().st_mode & 0o077 == 0
    assert expiry(tmp_path / "ca.pem") == NOW + timedelta(days=3650)


def test_a_certificate_ends_with_its_authority(authority: Authority) -> None:
    for made in (authority.for_client("x", NOW, 9999), authority.for_server(["x.example"], NOW, 9999)):
        certificate = x509.load_pem_x509_certificate(made.certificate)
        assert certificate.not_valid_after_utc == NOW + timedelta(days=3650)


def test_a_secret_that_replaces_a_readable_file_is_readable_for_its_owner_only(tmp_path: Path) -> None:
    path = tmp_path / "key.pem"
    path.touch(mode=0o644)
    path.chmod(0o644)
    write_secret(path, b"key")
    assert path.stat().st_mode & 0o777 == 0o600
