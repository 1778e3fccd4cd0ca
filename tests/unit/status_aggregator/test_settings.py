from __future__ import annotations

import pytest

from nena_shared.settings import ConfigurationError, load
from nena_status_aggregator.settings import AggregatorSettings


def loaded(*argv: str) -> AggregatorSettings:
    return load(AggregatorSettings, argv, program="nena-status-aggregator", description="")


def test_defaults() -> None:
    settings = loaded()
    assert (settings.http.host, settings.http.port) == ("127.0.0.1", 8080)
    assert (settings.interface_name, settings.topic_prefix) == ("uagv", "nena/v1")
    assert settings.silence_limit is None


def test_a_single_value_leaves_its_neighbours_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NENA_HTTP__HOST", "::1")
    settings = loaded("--events.backlog", "7", "--silence_limit", "4")
    assert (settings.http.host, settings.http.port) == ("::1", 8080)
    assert (settings.events.backlog, settings.events.history) == (7, 1000)
    assert settings.silence_limit == 4


def test_a_wrong_value_is_named() -> None:
    with pytest.raises(ConfigurationError, match="robots_limit"):
        loaded("--robots_limit", "0")
