"""Where each robot is spoken to, and in which version of VDA 5050: the one place that decides it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from nena_shared.log import get_logger
from nena_shared.plant import Vehicle
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.topics import RobotKey, TopicScheme
from nena_shared.vda5050.versions import UnknownVersionError, codec_for

log = get_logger(__name__)


@dataclass(frozen=True, slots=True)
class RobotAddress:
    """The version that a robot speaks, and its topics."""

    codec: Codec
    scheme: TopicScheme


class RobotAddresses:
    """Remembers where each robot's last good message came from; at first, what the plant model says.

    ``schemes`` are the topics of robots of which the plant model says no others, one per major version.
    """

    def __init__(self, schemes: Sequence[TopicScheme]) -> None:
        self._defaults = {scheme.major_version: scheme for scheme in schemes}
        self._schemes = dict.fromkeys(schemes)
        self._addresses: dict[RobotKey, RobotAddress] = {}

    @property
    def schemes(self) -> tuple[TopicScheme, ...]:
        """All topics that robots may be found under."""
        return tuple(self._schemes)

    def expect(self, vehicles: Iterable[tuple[RobotKey, Vehicle]]) -> None:
        """Note what the plant model says of its vehicles' versions and interface names.

        Raises:
            ConfigurationError: it names a version that is not spoken here.

        """
        for robot, vehicle in vehicles:
            for major, default in self._defaults.items():
                name = vehicle.interface_name or default.interface_name
                self._schemes[TopicScheme(name, major)] = None
            if vehicle.protocol_version:
                self._addresses[robot] = self._expected(vehicle, vehicle.protocol_version)

    def of(self, robot: RobotKey) -> RobotAddress | None:
        """Give where to speak to ``robot``; None for one that has said nothing yet and nobody knows of."""
        return self._addresses.get(robot)

    def is_outdated(self, robot: RobotKey, codec: Codec, scheme: TopicScheme) -> bool:
        """Tell whether ``robot`` is known to speak under other topics, or in another major version.

        What the broker keeps from before a robot changed its version must not change it back.
        """
        known = self._addresses.get(robot)
        return known is not None and (known.scheme, known.codec.major_version) != (
            scheme,
            codec.major_version,
        )

    def learn(self, robot: RobotKey, codec: Codec, scheme: TopicScheme) -> None:
        """Note that ``robot`` has spoken there; from now on it is answered there."""
        known = self._addresses.get(robot)
        if known and known.codec is codec and known.scheme == scheme:
            return
        self._addresses[robot] = RobotAddress(codec, scheme)
        log.info(
            "a robot's version of VDA 5050",
            robot=str(robot),
            version=codec.version,
            interface_name=scheme.interface_name,
            before=known.codec.version if known else None,
        )

    def _expected(self, vehicle: Vehicle, version: str) -> RobotAddress:
        try:
            codec = codec_for(version)
        except UnknownVersionError as error:
            message = f"plant: vehicle '{vehicle.name}', property vda5050:version: {error}"
            raise ConfigurationError([message]) from error
        default = self._defaults[codec.major_version]
        return RobotAddress(
            codec, TopicScheme(vehicle.interface_name or default.interface_name, codec.major_version)
        )
