"""MQTT topic filters (MQTT 3.1.1 section 4.7)."""

from __future__ import annotations


def matches(topic_filter: str, topic: str) -> bool:
    """Tell whether ``topic`` falls under ``topic_filter`` with its ``+`` and ``#``."""
    wanted, given = topic_filter.split("/"), topic.split("/")
    if given[0].startswith("$") and wanted[0] in ("+", "#"):
        return False  # the broker's own topics are never meant by a wildcard
    for position, level in enumerate(wanted):
        if level == "#":
            return True
        if position >= len(given) or level not in ("+", given[position]):
            return False
    return len(wanted) == len(given)
