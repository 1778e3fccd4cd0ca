from __future__ import annotations

from pathlib import Path

import pytest

from nena_conversations.broker import BrokerError, is_broker, parse_address
from nena_shared.settings import MqttTlsSettings


@pytest.mark.parametrize(
    ("url", "tls", "encrypted", "port"),
    [
        ("mqtt://host", None, False, 1883),
        ("mqtts://host", None, True, 8883),
        ("mqtt://host", MqttTlsSettings(ca=Path("ca.pem")), True, 8883),
        ("mqtts://host:1", MqttTlsSettings(ca=Path("ca.pem")), True, 1),
    ],
)
def test_url_scheme_selects_encryption(
    url: str,
    tls: MqttTlsSettings | None,
    encrypted: bool,  # noqa: FBT001 - a table's column
    port: int,
) -> None:
    found = parse_address(url, tls=tls).settings

    assert (found.tls.wanted, found.port) == (encrypted, port)
    assert tls is None or found.tls.ca == tls.ca


def test_name_password_and_filter_stand_in_the_address() -> None:
    found = parse_address("mqtt://me:se%2Fcret@host:7/site/hall/#")

    assert found.settings.username == "me"
    assert found.settings.secret() == "se/cret"
    assert found.topic_filters == ("site/hall/#",)


@pytest.mark.parametrize("url", ["http://host", "mqtt://", "mqtt://host:port", "host:1883"])
def test_invalid_broker_url_is_refused(url: str) -> None:
    with pytest.raises(BrokerError, match="Invalid broker URL"):
        parse_address(url)


def test_files_and_brokers_are_distinguished() -> None:
    assert is_broker("mqtts://host")
    assert not is_broker("mqtt.jsonl")
