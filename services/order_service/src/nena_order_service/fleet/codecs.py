"""Which version of VDA 5050 each robot speaks, as its messages tell: the one place that decides it."""

from __future__ import annotations

from nena_shared.log import get_logger
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.v2_1 import CODEC

log = get_logger(__name__)


class RobotCodecs:
    """Remembers for each robot the codec that its last good message was read with."""

    def __init__(self) -> None:
        self._codecs: dict[RobotKey, Codec] = {}

    def of(self, robot: RobotKey) -> Codec:
        """Give the codec for messages to ``robot``; 2.1.0 for one that has said nothing yet."""
        return self._codecs.get(robot, CODEC)

    def is_outdated(self, robot: RobotKey, codec: Codec) -> bool:
        """Tell whether ``robot`` is known to speak another major version than ``codec``.

        What the broker keeps from before a robot changed its version must not change it back.
        """
        known = self._codecs.get(robot)
        return known is not None and known.major_version != codec.major_version

    def learn(self, robot: RobotKey, codec: Codec) -> None:
        """Note that ``robot`` has spoken the version of ``codec``; from now on it is answered in it."""
        known = self._codecs.get(robot)
        if known is codec:
            return
        self._codecs[robot] = codec
        before = known.version if known else None
        log.info("a robot's version of VDA 5050", robot=str(robot), version=codec.version, before=before)
