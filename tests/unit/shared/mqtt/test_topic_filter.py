from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from paho.mqtt.client import topic_matches_sub

from nena_shared.mqtt.topic_filter import matches

LEVEL = st.sampled_from(["a", "b", "", "$SYS"])


@pytest.mark.parametrize(
    ("topic_filter", "topic"),
    [
        ("a/b", "a/b"),
        ("a/+", "a/b"),
        ("+/+", "a/b"),
        ("#", "a/b"),
        ("a/#", "a/b/c"),
        ("a/#", "a"),
        ("a/+", "a/"),
    ],
)
def test_matches(topic_filter: str, topic: str) -> None:
    assert matches(topic_filter, topic)


@pytest.mark.parametrize(
    ("topic_filter", "topic"),
    [("a/b", "a/c"), ("a/b", "a"), ("a", "a/b"), ("a/+", "a"), ("+", "a/b"), ("b/#", "a/b"), ("#", "$SYS/x")],
)
def test_matches_not(topic_filter: str, topic: str) -> None:
    assert not matches(topic_filter, topic)


@given(st.data())
def test_agrees_with_a_client_library(data: st.DataObject) -> None:
    topic = "/".join(data.draw(st.lists(LEVEL, min_size=1, max_size=4)))
    levels = data.draw(st.lists(LEVEL | st.just("+"), min_size=1, max_size=4))
    topic_filter = "/".join(levels + data.draw(st.sampled_from([[], ["#"]])))

    assert matches(topic_filter, topic) == topic_matches_sub(topic_filter, topic)
