from __future__ import annotations

from pathlib import Path

import pytest

from nena_shared.mqtt.identity import DIGITS, private_client_id
from nena_shared.settings import ConfigurationError, MqttSettings, MqttTlsSettings


def with_key(folder: Path, content: str) -> MqttSettings:
    file = folder / "key.pem"
    file.write_text(content)
    return MqttSettings(tls=MqttTlsSettings(certificate=file, key=file))


def with_password(password: str) -> MqttSettings:
    return MqttSettings.model_validate({"username": "robot", "password": password})


def test_it_is_the_same_at_each_start_and_another_one_for_each_name_and_secret(tmp_path: Path) -> None:
    made = {
        private_client_id(name, settings)
        for name in ("robot-1", "robot-2")
        for settings in (
            with_key(tmp_path, "a"),
            with_password("a b"),
            with_password("c"),
            with_key(tmp_path, "a"),
        )
    }

    assert len(made) == 6
    assert {each[:8] for each in made} == {"robot-1-", "robot-2-"}
    assert {len(each) for each in made} == {8 + DIGITS}


def test_it_does_not_show_the_secret(tmp_path: Path) -> None:
    assert "sesame" not in private_client_id("robot-1", with_password("sesame"))
    assert "sesame" not in private_client_id("robot-1", with_key(tmp_path, "sesame"))


def test_a_key_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    tls = MqttTlsSettings(certificate=tmp_path / "none", key=tmp_path / "none")
    with pytest.raises(ConfigurationError, match=r"mqtt\.tls\.key: .*No such file"):
        private_client_id("robot-1", MqttSettings(tls=tls))
