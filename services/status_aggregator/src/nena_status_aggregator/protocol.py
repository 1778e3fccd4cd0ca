"""The robots' topics that the aggregator reads, one scheme for each major version of VDA 5050."""

from __future__ import annotations

from nena_shared.vda5050.topics import TopicScheme
from nena_status_aggregator.settings import AggregatorSettings


def schemes(settings: AggregatorSettings) -> tuple[TopicScheme, ...]:
    """Give the topics of each major version."""
    return TopicScheme(settings.interface_name, "v2"), TopicScheme(settings.interface_name_v3, "v3")
