"""A new version needs one new package in the sources and nothing else."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from nena_shared import vda5050
from nena_shared.vda5050 import versions
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.message_reader import MessageReader
from nena_shared.vda5050.repair import Repair, RepairKind
from nena_shared.vda5050.state import State
from nena_shared.vda5050.versions import CODECS
from support.fleet_examples import state

FOLDER = Path(__file__).parents[3] / "fixtures" / "vda5050"
TOPIC = "vda5050/v3/ACME/r1/state"


@pytest.fixture
def codec(monkeypatch: pytest.MonkeyPatch) -> Iterator[Codec]:
    """Yield the codec of the version 3.99.0 among the fixtures."""
    monkeypatch.setattr(vda5050, "__path__", [*vda5050.__path__, str(FOLDER)])
    monkeypatch.setattr(versions, "CODECS", versions.find_codecs())
    versions.nearest_codec.cache_clear()
    yield versions.codec_for("3.99.0")
    versions.nearest_codec.cache_clear()
    sys.modules.pop("nena_shared.vda5050.v3_99")


def test_new_version_is_found_and_inherits_rules(codec: Codec) -> None:
    assert list(versions.CODECS) == [*CODECS, "3.99.0"]
    assert codec.rules is versions.codec_for("3.0.0").rules
    assert versions.codec_named("3.100") is codec


def test_its_states_are_read_with_the_new_field(codec: Codec) -> None:
    assert codec is versions.nearest_codec("3.99.7")
    content = json.loads(versions.codec_for("3.0.0").encode(state()))
    content |= {"version": "3.99.0", "tyrePressure": 80}
    reports: list[Repair] = []
    reader = MessageReader(lambda _, repairs: reports.extend(repairs))
    read: Any = reader.read(State, TOPIC, json.dumps(content).encode(), "v3")
    assert (read.version, read.tyre_pressure, reports) == ("3.99.0", 80.0, [])

    low: Any = reader.read(State, TOPIC, json.dumps(content | {"tyrePressure": -3}).encode(), "v3")
    assert (low.tyre_pressure, reports) == (0.0, [Repair("tyrePressure", RepairKind.CLAMPED, "-3")])


def test_before_it_is_there_its_states_are_read_as_those_of_the_nearest_version() -> None:
    content = json.loads(versions.codec_for("3.0.0").encode(state())) | {
        "version": "3.99.0",
        "tyrePressure": 80,
    }
    reports: list[Repair] = []
    read = MessageReader(lambda _, repairs: reports.extend(repairs)).read(
        State, TOPIC, json.dumps(content).encode(), "v3"
    )
    assert read.version == "3.99.0"
    assert [(each.field, each.kind) for each in reports] == [("version", "unknown_version")]
