from __future__ import annotations

from nena_order_service.api.asyncapi import channels
from nena_shared.fleet_api.topics import FleetTopics
from reference.mqtt_api import ANSWER, DOCUMENT, document


def test_document_is_up_to_date() -> None:
    expected = document()
    assert DOCUMENT.read_text(encoding="utf-8") == expected, (
        "run `make reference` and commit docs/mqtt-api.md"
    )


def test_each_topic_of_asyncapi_is_listed() -> None:
    listed = [line.split("`")[1] for line in document().splitlines() if line.startswith("| `")]
    described = [each.name for each in channels(FleetTopics()) if not each.name.endswith(ANSWER)]
    assert sorted(listed) == sorted(described)
