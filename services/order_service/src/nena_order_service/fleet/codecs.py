"""Which version of the protocol a robot speaks: the one place that decides it."""

from __future__ import annotations

from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.v2_1 import CODEC


def codec_of(robot: RobotKey) -> Codec:  # noqa: ARG001 - every robot speaks 2.1.0 as yet
    """Give the codec for the messages from and to ``robot``."""
    return CODEC
