"""Where each robot is spoken to, and in which version of VDA 5050: the one place that decides it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from pydantic import TypeAdapter, ValidationError

from nena_shared.log import get_logger
from nena_shared.plant import Vehicle
from nena_shared.settings import ConfigurationError, TopicPrefix
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.robot_sources import Dated, RobotSources
from nena_shared.vda5050.topics import RobotKey, TopicScheme
from nena_shared.vda5050.versions import UnknownVersionError, codec_named

log = get_logger(__name__)

KEY_LENGTH: Final = 400
"""Characters of manufacturer and serial number together, with a sign between, that the store can hold."""

_INTERFACE_NAME: Final[TypeAdapter[str | None]] = TypeAdapter(TopicPrefix | None)


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
        self._sources = RobotSources()

    @property
    def schemes(self) -> tuple[TopicScheme, ...]:
        """All topics that robots may be found under."""
        return tuple(self._schemes)

    def expect(self, vehicles: Iterable[tuple[RobotKey, Vehicle]]) -> None:
        """Note what the plant model says of its vehicles' versions and interface names.

        Raises:
            ConfigurationError: it names a version that is not spoken here, an interface name that is no
                topic, or a robot that the store cannot hold.

        """
        for robot, vehicle in vehicles:
            _require_storable(robot, vehicle)
            for major, default in self._defaults.items():
                name = _interface_name(vehicle) or default.interface_name
                self._schemes[TopicScheme(name, major)] = None
            if vehicle.protocol_version:
                address = self._addresses[robot] = self._expected(vehicle, vehicle.protocol_version)
                self._sources.expect(robot, address.scheme)

    def of(self, robot: RobotKey) -> RobotAddress | None:
        """Give where to speak to ``robot``; None for one that has said nothing yet and nobody knows of."""
        return self._addresses.get(robot)

    def learn(
        self, robot: RobotKey, codec: Codec, scheme: TopicScheme, message: Dated, *, retained: bool
    ) -> bool:
        """Note that ``robot`` has spoken there; from now on it is answered there.

        False: the message says nothing of it now, as :class:`RobotSources` has it.
        """
        if not self._sources.accepts(robot, scheme, message, retained=retained):
            return False
        known = self._addresses.get(robot)
        if known and known.codec is codec and known.scheme == scheme:
            return True
        self._addresses[robot] = RobotAddress(codec, scheme)
        log.info(
            "a robot's version of VDA 5050",
            robot=str(robot),
            version=codec.version,
            interface_name=scheme.interface_name,
            before=known.codec.version if known else None,
        )
        return True

    def _expected(self, vehicle: Vehicle, version: str) -> RobotAddress:
        try:
            codec = codec_named(version)
        except UnknownVersionError as error:
            message = f"plant: vehicle '{vehicle.name}', property vda5050:version: {error}"
            raise ConfigurationError([message]) from error
        default = self._defaults[codec.major_version]
        return RobotAddress(
            codec, TopicScheme(vehicle.interface_name or default.interface_name, codec.major_version)
        )


def _interface_name(vehicle: Vehicle) -> str | None:
    try:
        return _INTERFACE_NAME.validate_python(vehicle.interface_name or None)
    except ValidationError as error:
        problem = error.errors()[0]["msg"]
        message = f"plant: vehicle '{vehicle.name}', property vda5050:interfaceName: {problem}"
        raise ConfigurationError([message]) from error


def _require_storable(robot: RobotKey, vehicle: Vehicle) -> None:
    if len(str(robot)) > KEY_LENGTH:
        message = (
            f"plant: vehicle '{vehicle.name[:60]}': manufacturer and serial number have more than "
            f"{KEY_LENGTH} characters together"
        )
        raise ConfigurationError([message])
