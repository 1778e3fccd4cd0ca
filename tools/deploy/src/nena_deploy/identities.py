"""Identities at the broker, their topics and rights."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from enum import StrEnum

from pydantic import BaseModel, ConfigDict

from nena_shared.fleet_api.topics import FleetTopics, PeripheralTopic
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme

LEVEL = re.compile(r"(?! )[^\x00-\x1f\x7f/+#.$][^\x00-\x1f\x7f/+#]{0,63}(?<! )")
"""Valid topic level and folder name. Brokers strip leading and trailing spaces of names in an access list,
which would assign the rights to another name."""


COMMON_NAME = 64
"""Maximum length of a certificate's common name, bytes in UTF-8."""


class IdentityError(Exception):
    """An identity is invalid or unknown, for the reason in the message."""


class Kind(StrEnum):
    """Kind of identity: its rights at the broker."""

    ROBOT = "robot"
    """Its own VDA 5050 topics, in a robot's directions."""
    HOST = "host"
    """Creates transport orders under its own name; reads orders and vehicles."""
    DEVICE = "device"
    """A peripheral device, such as a door: takes the jobs of its location."""
    ORDER_SERVICE = "order-service"
    STATUS_AGGREGATOR = "status-aggregator"


class Identity(BaseModel):
    """A client of the broker."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: Kind
    name: str
    """User name at the broker: ``manufacturer/serialNumber`` of a robot."""
    certificate: int
    """Serial number of the valid certificate."""

    @property
    def folder(self) -> str:
        """Folder of its files, relative to the site's folder."""
        alone = self.kind in (Kind.ORDER_SERVICE, Kind.STATUS_AGGREGATOR)
        return self.kind if alone else f"{self.kind}s/{self.name.removeprefix(DEVICES)}"


def robot_name(manufacturer: str, serial_number: str) -> str:
    """Return a robot's user name at the broker; raises IdentityError if the name is not valid in topics."""
    return _check_length(
        f"{_check_level('manufacturer', manufacturer)}/{_check_level('serial number', serial_number)}"
    )


def host_name(name: str) -> str:
    """Return a host's user name at the broker; raises IdentityError if the name is not valid in topics."""
    # An access list knows names only: such a host would have the rights of the service.
    if name in {Kind.ORDER_SERVICE, Kind.STATUS_AGGREGATOR}:
        raise IdentityError(f"{name} is the name of a service. Choose another name.")
    return _check_length(_check_level("name", name))


DEVICES = "nena/peripherals/"
"""Before a device's location in its user name, so that no robot or host has the same one."""


def device_name(location: str) -> str:
    """Return a peripheral device's user name at the broker.

    Raises:
        IdentityError: the name of the location is not valid in topics.
    """
    return _check_length(f"{DEVICES}{_check_level('location', location)}")


def _check_length(name: str) -> str:
    if len(name.encode(errors="replace")) > COMMON_NAME:
        raise IdentityError(f"{name} is too long: certificates hold {COMMON_NAME} bytes of UTF-8.")
    return name


def _check_level(what: str, text: str) -> str:
    if not LEVEL.fullmatch(text):
        raise IdentityError(
            f"The {what} {text!r} is not valid in a topic: use 1 to 64 characters without / + #, "
            "no leading dot, $ or space, no trailing space."
        )
    return text


class SiteTopics(BaseModel):
    """Topic prefixes at the broker, as in the settings of the services."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    interface_name: str = "uagv"
    interface_name_v3: str = "vda5050"
    prefix: str = "nena/v1"

    @property
    def schemes(self) -> tuple[TopicScheme, ...]:
        """Topic schemes of robots for each major version of VDA 5050."""
        return (TopicScheme(self.interface_name, "v2"), TopicScheme(self.interface_name_v3, "v3"))


FROM_ROBOT = (Topic.STATE, Topic.VISUALIZATION, Topic.CONNECTION, Topic.FACTSHEET)
TO_ROBOT = (Topic.ORDER, Topic.INSTANT_ACTIONS, Topic.ZONE_SET, Topic.RESPONSES)
WATCHED = (Topic.ORDER, Topic.INSTANT_ACTIONS)
"""Topics to robots that the order service also reads, to detect commands of other programs."""
FROM_HOST = ("transportOrders/create", "commands/delivery")
"""Requests that a host may send; other commands could concern other hosts' orders, or robots."""
ANY_ROBOT = RobotKey("+", "+")


def topics_of_robot(robot: RobotKey, topics: SiteTopics) -> Iterator[str]:
    """Yield all topics that a robot may write, in every version of VDA 5050."""
    for scheme in topics.schemes:
        yield from (scheme.of(robot, topic) for topic in FROM_ROBOT)
    fleet = FleetTopics(topics.prefix)
    yield from (fleet.robot_map(robot), fleet.recording_chunks(robot))


def access_list(identities: Iterable[Identity], topics: SiteTopics) -> str:
    """Return Mosquitto's access list (``acl_file``) for all identities; everything else is denied."""
    parts = ["# Created by nena-deploy: manual changes will be lost.\n"]
    for identity in identities:
        parts += [f"\nuser {identity.name}\n", *(f"topic {rule}\n" for rule in _rules_of(identity, topics))]
    return "".join(parts)


def _rules_of(identity: Identity, topics: SiteTopics) -> Iterator[str]:
    fleet = FleetTopics(topics.prefix)
    match identity.kind:
        case Kind.ROBOT:
            robot = RobotKey(*identity.name.split("/"))
            for scheme in topics.schemes:
                yield from _of_robots(scheme, robot, out="write", back="read")
            yield from (f"write {each}" for each in (fleet.robot_map(robot), fleet.recording_chunks(robot)))
            yield f"read {fleet.recording_answers(robot)}"
            yield f"read {fleet.plant_model}"
        case Kind.HOST:
            own = f"{topics.prefix}/hosts/{identity.name}"
            yield from (f"write {own}/{each}" for each in FROM_HOST)
            yield f"read {own}/#"
            statuses = (fleet.all_order_statuses, fleet.all_sequence_statuses, fleet.all_vehicle_statuses)
            yield from (f"read {status}" for status in statuses)
            yield f"read {fleet.all_peripherals(PeripheralTopic.STATUS)}"
            yield from (f"read {topic}" for topic in (fleet.service_status, fleet.plant_model))
        case Kind.DEVICE:
            yield from _of_device(identity.name.removeprefix(DEVICES), fleet)
        case Kind.ORDER_SERVICE:
            for scheme in topics.schemes:
                yield from _of_robots(scheme, ANY_ROBOT, out="read", back="write")
                yield from (f"read {scheme.of(ANY_ROBOT, topic)}" for topic in WATCHED)
            yield f"readwrite {topics.prefix}/#"
        case Kind.STATUS_AGGREGATOR:
            for scheme in topics.schemes:
                yield f"read {scheme.interface_name}/{scheme.major_version}/#"
            yield f"read {topics.prefix}/#"
            yield f"write {fleet.all_recording_answers}"
            yield f"write {topics.prefix}/acknowledgements/+"
            # To pause all robots while the order service does not answer.
            yield f"write {fleet.direct_stops}"
            yield from (f"write {scheme.of(ANY_ROBOT, Topic.INSTANT_ACTIONS)}" for scheme in topics.schemes)


def _of_device(location: str, fleet: FleetTopics) -> Iterator[str]:
    for topic in (PeripheralTopic.JOB_STATE, PeripheralTopic.STATE):
        yield f"write {fleet.peripheral(location, topic)}"
    for topic in (PeripheralTopic.JOB, PeripheralTopic.CANCEL):
        yield f"read {fleet.peripheral(location, topic)}"


def _of_robots(scheme: TopicScheme, robot: RobotKey, *, out: str, back: str) -> Iterator[str]:
    """Yield the rules for a robot's topics: ``out`` for topics it writes, ``back`` for topics it reads."""
    yield from (f"{out} {scheme.of(robot, topic)}" for topic in FROM_ROBOT)
    yield from (f"{back} {scheme.of(robot, topic)}" for topic in TO_ROBOT)
