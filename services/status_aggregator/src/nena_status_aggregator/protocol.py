"""The VDA 5050 version that the aggregator reads: the one place where it is chosen.

2.0 and 2.1 share their topics; a reader of 2.1 takes what a 2.0 robot sends (unknown fields are passed over,
what 2.1 added is optional).
"""

from __future__ import annotations

from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.topics import TopicScheme
from nena_shared.vda5050.v2_1 import CODEC


def codec() -> Codec:
    """Give the codec for everything that robots send."""
    return CODEC


def topics(interface_name: str) -> TopicScheme:
    """Give the robots' topics of that version."""
    return TopicScheme(interface_name, codec().major_version)
