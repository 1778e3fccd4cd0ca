"""The robots' topics that the aggregator reads, one scheme for each major version of VDA 5050."""

from __future__ import annotations

from collections.abc import Iterable

from pydantic import TypeAdapter, ValidationError

from nena_shared.plant import Vehicle
from nena_shared.settings import TopicPrefix
from nena_shared.vda5050.topics import TopicScheme
from nena_status_aggregator.settings import AggregatorSettings


def schemes(settings: AggregatorSettings) -> tuple[TopicScheme, ...]:
    """Give the topics of each major version."""
    return TopicScheme(settings.interface_name, "v2"), TopicScheme(settings.interface_name_v3, "v3")


def schemes_of(vehicles: Iterable[Vehicle]) -> tuple[TopicScheme, ...]:
    """Give the topics that the plant model names for some of its vehicles, but for what is no topic."""
    names = dict.fromkeys(each.interface_name for each in vehicles if each.interface_name)
    return tuple(TopicScheme(name, major) for name in names if _is_prefix(name) for major in ("v2", "v3"))


def _is_prefix(name: str) -> bool:
    try:
        TypeAdapter(TopicPrefix).validate_python(name)
    except ValidationError:
        return False
    return True
