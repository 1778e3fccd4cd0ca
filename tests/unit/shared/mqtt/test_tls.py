from __future__ import annotations

import ssl
from pathlib import Path

import pytest

from nena_shared.mqtt.identity import tls_context
from nena_shared.settings import ConfigurationError, MqttTlsSettings
from support.certificates import Authority


@pytest.mark.parametrize("wish", ["enabled", "ca", "certificate"])
def test_each_setting_encrypts_and_checks_the_broker(wish: str, tmp_path: Path) -> None:
    authority = Authority(tmp_path)
    own = authority.sign("me")
    settings = {
        "enabled": MqttTlsSettings(enabled=True),
        "ca": MqttTlsSettings(ca=authority.ca),
        "certificate": MqttTlsSettings(certificate=own.certificate, key=own.key),
    }[wish]

    context = tls_context(settings)

    assert context is not None
    assert (context.verify_mode, context.check_hostname) == (ssl.CERT_REQUIRED, True)
    assert context.minimum_version >= ssl.TLSVersion.TLSv1_2


def test_only_the_configured_ca_is_trusted(tmp_path: Path) -> None:
    context = tls_context(MqttTlsSettings(ca=Authority(tmp_path, "mine").ca))

    assert context is not None
    assert [each["subject"] for each in context.get_ca_certs()] == [((("commonName", "mine"),),)]


def test_unusable_files_are_named(tmp_path: Path) -> None:
    authority = Authority(tmp_path)
    one, other = authority.sign("one"), authority.sign("other")
    empty = tmp_path / "empty.pem"
    empty.touch()

    for settings, complaint in (
        (MqttTlsSettings(ca=tmp_path / "none.pem"), r"mqtt\.tls\.ca: .*none\.pem: No such file"),
        (MqttTlsSettings(ca=empty), r"mqtt\.tls\.ca: .*empty\.pem: not a PEM file"),
        (
            MqttTlsSettings(certificate=one.certificate, key=other.key),
            r"one\.pem and .*other-key\.pem: not a PEM",
        ),
        (
            MqttTlsSettings(certificate=tmp_path / "me.pem"),
            r"mqtt\.tls\.certificate: .*me\.pem: No such file",
        ),
    ):
        with pytest.raises(ConfigurationError, match=complaint):
            tls_context(settings)
