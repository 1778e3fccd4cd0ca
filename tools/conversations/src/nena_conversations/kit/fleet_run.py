"""Run the clauses for a fleet control, and judge what the checker saw meanwhile."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Final

from nena_conversations.broker import BrokerAddress, connect_broker
from nena_conversations.kit.clause import Clause, Outcome, Strength, Verdict
from nena_conversations.kit.engine import OF_EACH_TOPIC, Watched, try_clause, watched_verdict
from nena_conversations.kit.fleet_clauses import FLEET_CLAUSES
from nena_conversations.kit.fleet_session import OBSERVED_QOS, Ask, FleetSession
from nena_conversations.kit.honest_robot import HonestRobot
from nena_conversations.kit.played_robot import FACTSHEET_REQUEST, PlayedRobot
from nena_conversations.message import SENDERS, Sender
from nena_conversations.recording import Entry
from nena_conversations.rules import Rule, both_versions
from nena_shared.mqtt import Inbound
from nena_shared.tasks import Supervisor
from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.factsheet import (
    ActionScope,
    MaximumArrayLengths,
    MaximumStringLengths,
    MobileRobotAction,
    ProtocolLimits,
    Timing,
)
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme

PACE: Final = 1.0
"""Time in which a played robot drives to the next node, or ends an action, seconds."""
WATCH: Final = 3.0
ORDER_WITHIN: Final = 60.0
"""Time in which an order comes, seconds: a person may have to start it."""
CONNECTED_WITHIN: Final = 30.0

INSTANT: Final = ("cancelOrder", "startPause", "stopPause", "stateRequest", FACTSHEET_REQUEST)
STRINGS: Final = MaximumStringLengths(maximum_id_length=128, maximum_message_length=100_000)
ARRAYS: Final = MaximumArrayLengths(
    order_nodes=200,
    order_edges=199,
    node_actions=10,
    edge_actions=10,
    action_parameters=20,
    instant_actions=10,
)
"""Limits that the played robots declare."""

FLEET_RULES: Final = {**OF_EACH_TOPIC, Rule.RETAINED: "Messages are not retained"}
OF_ORDERS: Final = {
    Rule.GRAPH: "Nodes and edges of orders alternate",
    Rule.SEQUENCE: "sequenceIds are even for nodes, odd for edges, and rise without gaps",
    Rule.BASE: "The base comes before the horizon",
    Rule.FIRST_SEQUENCE_ID: "A new order begins with sequenceId 0",
    Rule.FIRST_UPDATE_ID: "A new order has orderUpdateId 0",
    Rule.START_NODE: "A new order begins where the robot is",
    Rule.OTHER_ORDER: "A new order goes to an idle robot only",
    Rule.MODE: "Orders and actions come only in modes in which fleet control may send them",
    Rule.OFFLINE: "Nothing is sent to a robot that is not connected",
    Rule.NOT_OFFERED: "Only actions of the factsheet are requested",
    Rule.LIMITS: "Messages keep the limits of the factsheet",
    Rule.ORDER_INTERVAL: "Orders do not come faster than the factsheet allows",
    Rule.ACTION_ID: "An actionId identifies one action",
}
"""Rules that are judged once there was an order."""
OF_UPDATES: Final = {
    Rule.OUTDATED_UPDATE: "An update has a greater orderUpdateId than the ones before",
    Rule.SAME_UPDATE_ID: "A repeated orderUpdateId has the same content",
    Rule.STITCHING: "An update begins with the last released node",
    Rule.STITCHING_NODE: "An update repeats the last released node unchanged",
    Rule.UPDATE_AFTER_CANCEL: "A cancelled order gets no update",
}
"""Rules that are judged once there was an update."""
QOS: Final = both_versions("6.2", "4.1")


@dataclass(frozen=True, slots=True)
class PlayedSetup:
    """A robot that the test plays."""

    robot: RobotKey
    codec: Codec
    topics: TopicScheme
    place: tuple[float, float, float]
    """Where it stands at first, m and rad."""
    map_id: str
    actions: tuple[str, ...] = ()
    """Types of the actions that it can do at nodes and on edges."""
    order_interval: float = 1.0
    """Shortest time between two orders that it declares, seconds."""

    def honest(self) -> HonestRobot:
        """Return the robot."""
        scopes = (ActionScope.NODE, ActionScope.EDGE)
        lists = [_declared(each, (ActionScope.INSTANT,)) for each in INSTANT]
        return HonestRobot(
            key=self.robot,
            position=self.place,
            map_id=self.map_id,
            lists=(*lists, *(_declared(each, scopes) for each in self.actions)),
            limits=ProtocolLimits(
                maximum_string_lengths=STRINGS,
                maximum_array_lengths=ARRAYS,
                timing=Timing(minimum_order_interval=self.order_interval, minimum_state_interval=0.1),
            ),
            fulfils=("stateRequest", FACTSHEET_REQUEST),
        )


def _declared(action_type: str, scopes: tuple[ActionScope, ...]) -> MobileRobotAction:
    blocking = (BlockingType.NONE,) if scopes == (ActionScope.INSTANT,) else None
    return MobileRobotAction(
        action_type=action_type,
        action_scopes=scopes,
        blocking_types=blocking,
        pause_allowed=False,
        cancel_allowed=True,
    )


async def judge_fleet(
    address: BrokerAddress,
    setups: Sequence[PlayedSetup],
    ask: Ask,
    *,
    clauses: Sequence[Clause[FleetSession]] = FLEET_CLAUSES,
    report: Callable[[Verdict], None],
    client_id: str,
    answer_within: float = ORDER_WITHIN,
    watch: float = WATCH,
    pace: float = PACE,
) -> tuple[list[Verdict], tuple[Entry, ...]]:
    """Test a fleet control with played robots; return the verdicts and the recorded messages.

    Each clause is tried once in each version; the other robots are honest meanwhile.

    Raises:
        BrokerError: the broker is unreachable or rejects the subscriptions.
    """
    verdicts: list[Verdict] = []

    def add(verdict: Verdict) -> None:
        verdicts.append(verdict)
        report(verdict)

    players = [
        PlayedRobot(address.settings, each.topics, each.honest(), each.codec, pace=pace) for each in setups
    ]
    by_version = {player.codec.version: player for player in reversed(players)}
    async with connect_broker(address, client_id) as link:
        session = FleetSession(link, players, ask, answer_within=answer_within, watch=watch)
        async with _playing(session):
            for version, player in reversed(by_version.items()):
                session.player = player
                for clause in clauses:
                    section = clause.sections.of(version)
                    if section is not None:
                        add(await try_clause(clause, section, session, _prefix(version, by_version)))
            await _hear_retained(address, session, f"{client_id}-late")
        session.findings += [each for each in session.checker.end() if SENDERS[each.topic] is Sender.FLEET]
        for player in players:
            for topic in (Topic.CONNECTION, Topic.FACTSHEET):
                link.publish(player.cleared(topic))
        await link.drain(CONNECTED_WITHIN)
    for version in reversed(by_version):
        for verdict in _seen_by_checker(session, version, _prefix(version, by_version)):
            add(verdict)
    return verdicts, tuple(session.recording)


def _prefix(version: str, versions: dict[str, PlayedRobot]) -> str:
    return f"{version} " if len(versions) > 1 else ""


@asynccontextmanager
async def _playing(session: FleetSession) -> AsyncIterator[None]:
    """Keep the robots connected until the block ends; they take leave then."""
    players = session.players.values()
    async with Supervisor() as supervisor:
        for player in players:
            supervisor.start(str(player.robot.key), player.run())
        states = [(player.robot.key, Topic.STATE) for player in players]
        what = "the robots' first states"
        await session.until(lambda: all(session.counts[each] for each in states), what, CONNECTED_WITHIN)
        yield
        for player in players:
            player.leave()
            await player.link.drain(CONNECTED_WITHIN)


async def _hear_retained(address: BrokerAddress, session: FleetSession, client_id: str) -> None:
    """Look, as a new robot would, what the broker has kept of fleet control."""
    missing = set(session.players)
    kept: list[Inbound] = []

    def on_connection(inbound: Inbound) -> None:
        missing.difference_update(key for key in session.players if f"/{key}/" in inbound.topic)
        session.wake()

    async with connect_broker(address, client_id) as link:
        for key, player in session.players.items():
            for topic in player.codec.kinds:
                if SENDERS[topic] is Sender.FLEET:
                    link.subscribe(player.topics.of(key, topic), kept.append, qos=OBSERVED_QOS)
            link.subscribe(player.topics.of(key, Topic.CONNECTION), on_connection)
        await session.until(lambda: not missing, "the retained messages of the broker", CONNECTED_WITHIN)
    for inbound in kept:
        if inbound.retained:
            session.receive(inbound)


def _seen_by_checker(session: FleetSession, version: str, prefix: str) -> Iterator[Verdict]:
    """Yield a verdict on each rule that was watched, for the robots of a version."""
    players = [each for each in session.players.values() if each.codec.version == version]
    robots = {player.robot.key for player in players}
    found = [each for each in session.findings if each.robot in robots]
    entries = session.recording

    def count(topic: Topic) -> int:
        return sum(session.counts[robot, topic] for robot in robots)

    for topic in players[0].codec.kinds:
        if SENDERS[topic] is Sender.FLEET:
            missing = "" if count(topic) else f"no message on {topic} was heard"
            for rule, title in FLEET_RULES.items():
                yield from watched_verdict(
                    Watched(rule, title, topic, missing), version, found, entries, prefix
                )
            qos = max((session.highest_qos.get((robot, topic), 0) for robot in robots), default=0)
            yield _qos_verdict(topic, version, prefix, qos, missing)
    no_order = "" if count(Topic.ORDER) else "no order was heard"
    no_update = "" if any(session.updates[robot] for robot in robots) else "no update of an order was heard"
    no_response = "" if count(Topic.RESPONSES) else "no response was heard"
    rules = [
        *((rule, title, no_order) for rule, title in OF_ORDERS.items()),
        *((rule, title, no_update) for rule, title in OF_UPDATES.items()),
        (Rule.RESPONSE, "Only requests of the robot are answered", no_response),
    ]
    for rule, title, missing in rules:
        yield from watched_verdict(Watched(rule, title, missing=missing), version, found, entries, prefix)


def _qos_verdict(topic: Topic, version: str, prefix: str, qos: int, missing: str) -> Verdict:
    outcome = Outcome.NOT_APPLICABLE if missing else Outcome.FAILED if qos else Outcome.PASSED
    reason = f"messages came with QoS {qos}, the standard names 0" if qos else missing
    title = f"Messages have QoS 0 ({topic})"
    section = QOS.of(version) or ""
    return Verdict(f"{prefix}{topic}/qos", title, section, Strength.SHOULD, outcome, reason)
