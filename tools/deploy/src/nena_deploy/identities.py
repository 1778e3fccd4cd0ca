"""Identities at the broker, their topics and rights."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from enum import StrEnum

from pydantic import BaseModel, ConfigDict

from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme

LEVEL = re.compile(r"(?! )[^\x00-\x1f\x7f/+#.$][^\x00-\x1f\x7f/+#]{0,63}(?<! )")
"""What may be one level of a topic, and the name of a folder; brokers drop blanks at the ends of names in an
access list, so that the rights would be somebody else's."""


COMMON_NAME = 64
"""Bytes in UTF-8 that the common name of a certificate may have."""


class IdentityError(Exception):
    """An identity cannot be made, found or removed; the text says why."""


class Kind(StrEnum):
    """What an identity may do at the broker."""

    ROBOT = "robot"
    """Its own topics, as VDA 5050 gives them to a robot."""
    HOST = "host"
    """Asks for transport orders under its own name, and sees orders and vehicles."""
    ORDER_SERVICE = "order-service"
    STATUS_AGGREGATOR = "status-aggregator"


class Identity(BaseModel):
    """One that connects to the broker."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: Kind
    name: str
    """At the broker: ``manufacturer/serialNumber`` of a robot."""
    certificate: int
    """Serial number of the certificate that counts."""

    @property
    def folder(self) -> str:
        """Where its files are, below the site's folder."""
        return self.kind if self.kind not in (Kind.ROBOT, Kind.HOST) else f"{self.kind}s/{self.name}"


def robot_name(manufacturer: str, serial_number: str) -> str:
    """Give a robot's user name at the broker.

    Raises:
        IdentityError: it could not stand in a topic.

    """
    return _short(f"{_level('manufacturer', manufacturer)}/{_level('serial number', serial_number)}")


def host_name(name: str) -> str:
    """Give a host's user name at the broker.

    Raises:
        IdentityError: it could not stand in a topic.

    """
    if name in {Kind.ORDER_SERVICE, Kind.STATUS_AGGREGATOR}:
        message = f"{name} is a service's name; a host of that name would have its rights."
        raise IdentityError(message)
    return _short(_level("name", name))


def _short(name: str) -> str:
    if len(name.encode(errors="replace")) > COMMON_NAME:
        message = (
            f"{name} is too long: a certificate holds {COMMON_NAME} letters, fewer of those beyond ASCII."
        )
        raise IdentityError(message)
    return name


def _level(what: str, text: str) -> str:
    if not LEVEL.fullmatch(text):
        message = (
            f"The {what} {text!r} cannot stand in a topic: 1 to 64 signs, none of / + #, no dot or $ first, "
            "no blank at an end."
        )
        raise IdentityError(message)
    return text


class SiteTopics(BaseModel):
    """First levels of the topics at the broker."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    interface_name: str = "uagv"
    interface_name_v3: str = "vda5050"
    prefix: str = "nena/v1"

    @property
    def schemes(self) -> tuple[TopicScheme, ...]:
        """The topics of robots, for each major version of VDA 5050."""
        return (TopicScheme(self.interface_name, "v2"), TopicScheme(self.interface_name_v3, "v3"))


FROM_ROBOT = (Topic.STATE, Topic.VISUALIZATION, Topic.CONNECTION, Topic.FACTSHEET)
TO_ROBOT = (Topic.ORDER, Topic.INSTANT_ACTIONS, Topic.ZONE_SET, Topic.RESPONSES)
FROM_HOST = ("transportOrders/create", "commands/delivery")
"""What a host may ask for; the other commands concern orders and robots that are not its own."""
ANY_ROBOT = RobotKey("+", "+")
OWN_TOPICS = "nena/#"
"""Below a robot's topics: what NeNa's edge agent tells beyond VDA 5050."""


def access_list(identities: Iterable[Identity], topics: SiteTopics) -> str:
    """Write the access list for all identities of a site."""
    parts = ["# Made by nena-deploy: changes by hand are lost.\n"]
    for identity in identities:
        parts += [f"\nuser {identity.name}\n", *(f"topic {rule}\n" for rule in _rules(identity, topics))]
    return "".join(parts)


def _rules(identity: Identity, topics: SiteTopics) -> Iterator[str]:
    fleet = FleetTopics(topics.prefix)
    match identity.kind:
        case Kind.ROBOT:
            robot = RobotKey(*identity.name.split("/"))
            for scheme in topics.schemes:
                yield from _of_robots(scheme, robot, out="write", back="read")
            yield f"read {fleet.plant_model}"
        case Kind.HOST:
            own = f"{topics.prefix}/hosts/{identity.name}"
            yield from (f"write {own}/{each}" for each in FROM_HOST)
            yield f"read {own}/#"
            statuses = (fleet.all_order_statuses, fleet.all_sequence_statuses, fleet.all_vehicle_statuses)
            yield from (f"read {each}" for each in statuses)
            yield f"read {fleet.plant_model}"
        case Kind.ORDER_SERVICE:
            for scheme in topics.schemes:
                yield from _of_robots(scheme, ANY_ROBOT, out="read", back="write")
            yield f"readwrite {topics.prefix}/#"
        case Kind.STATUS_AGGREGATOR:
            for scheme in topics.schemes:
                yield f"read {scheme.interface_name}/{scheme.major_version}/#"
            yield f"read {topics.prefix}/#"


def _of_robots(scheme: TopicScheme, robot: RobotKey, *, out: str, back: str) -> Iterator[str]:
    """Give the rules for a robot's topics: ``out`` for what it writes, ``back`` for what it reads."""
    yield from (f"{out} {scheme.of(robot, topic)}" for topic in FROM_ROBOT)
    yield f"{out} {scheme.interface_name}/{scheme.major_version}/{robot}/{OWN_TOPICS}"
    yield from (f"{back} {scheme.of(robot, topic)}" for topic in TO_ROBOT)
