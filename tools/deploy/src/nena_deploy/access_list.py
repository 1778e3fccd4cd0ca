"""The broker's access list (Mosquitto's ``acl_file``): what is not named there is refused."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from nena_deploy.identity import Identity, Kind
from nena_deploy.topics import SiteTopics
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme

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
