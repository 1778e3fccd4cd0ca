"""Check the links to the broker: connection, login, and access to the robot's topics."""

from __future__ import annotations

import asyncio
import json
import os
import socket
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass

from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
from paho.mqtt.reasoncodes import ReasonCode

from nena_edge_agent.doctor.finding import Link, LinkFinding, LinkVerdict, missing, ok, unknown
from nena_edge_agent.messages import HeaderMaker, client_id_of
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.clock import SystemClock
from nena_shared.fleet_api.topics import FleetTopics, suits_all_brokers
from nena_shared.mqtt import Inbound, LinkHooks, MqttLink, Outbound
from nena_shared.mqtt.broker_check import topic_of_delivery
from nena_shared.mqtt.client import NO_MQTT, NOT_ACCEPTED
from nena_shared.mqtt.identity import tls_context
from nena_shared.settings import MqttSettings
from nena_shared.tasks import end
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.versions import RULES, codec_for, topics_for
from nena_shared.vda5050.visualization import Visualization

ANSWER_WITHIN = 5.0
"""Timeout for each answer of the broker, seconds."""

_LATE = "no answer within {:g} s"

RETAINED_WITHIN = 1.0
"""Timeout for retained messages, seconds; much longer than they usually take."""

MAP_PROPERTY = "vda5050:mapId"


@dataclass(frozen=True, slots=True)
class BrokerView:
    """The findings, and the map IDs in a plant model that the broker retains."""

    findings: list[LinkFinding]
    plant_maps: frozenset[str] = frozenset()


async def examine_broker(settings: EdgeAgentSettings) -> BrokerView:
    """Check the three links, with a separate client ID so as not to disturb the robot's running agent.

    Raises:
        ConfigurationError: the password file cannot be read.
    """
    mqtt = settings.mqtt
    mqtt.secret()
    place = f"{mqtt.host}:{mqtt.port}"
    problem = await _try_connection(mqtt)
    if problem:
        remedy = "check mqtt.host and mqtt.port, the broker, and firewalls"
        first = missing(Link.BROKER, f"{place} is unreachable: {problem}", remedy)
        return BrokerView([first, *unknown((Link.LOGIN, Link.ACCESS), "needs the broker")])
    reached = ok(Link.BROKER, f"{place} accepts connections")
    probe = _BrokerProbe(settings)
    async with probe.connected() as problem:
        if problem:
            who = f"user '{mqtt.username}'" if mqtt.username else "an anonymous client"
            text = f"the broker rejected {who}: {problem}"
            remedy = (
                "check mqtt.username and mqtt.password_file, the users of the broker, and whether it admits "
                f"the client ID {client_id(settings)}"
            )
            if problem == _LATE.format(ANSWER_WITHIN) or problem.endswith((NO_MQTT, NOT_ACCEPTED)):
                text = f"{place} does not answer as a broker of MQTT does: {problem}"
                remedy = "check that mqtt.port is the broker's port for MQTT, and the broker's log"
            if mqtt.tls.wanted:
                remedy += "; for an untrusted certificate, mqtt.tls.ca, mqtt.tls.certificate and both clocks"
            rejected = missing(Link.LOGIN, text, remedy)
            return BrokerView([reached, rejected, *unknown([Link.ACCESS], "needs the login")])
        let_in = ok(Link.LOGIN, f"logged in {login_identity(mqtt)}; {_told_of_a_loss(mqtt)}")
        plant_maps = await probe.plant_maps()
        refused = probe.refused
    robot = RobotKey(settings.manufacturer, settings.serial_number)
    topics = topics_for(settings.version, settings.interface_name)
    topic = f"{topics.interface_name}/{topics.major_version}/{robot}/doctor"
    came_back_on = await topic_of_delivery(mqtt, client_id(settings), topic)
    proof = "did not come back" if not came_back_on else "came back"
    if came_back_on not in ("", topic):
        proof = f"came back on {came_back_on}"
    if came_back_on != topic and not suits_all_brokers(robot):
        text = (
            f"a message on {topic} {proof}: NATS and RabbitMQ refuse or change '.' and spaces, or "
            "the access list hides the robot's own messages. Rename the robot"
        )
        return BrokerView([reached, let_in, *unknown([Link.ACCESS], text)], plant_maps)
    if came_back_on not in ("", topic):
        remedy = "remove mount_point from Mosquitto's listener, or install Mosquitto 2.0.12 or newer"
        changed = missing(Link.ACCESS, f"a message on {topic} {proof}", remedy)
        return BrokerView([reached, let_in, changed], plant_maps)
    access = _access_findings(settings, refused, await asyncio.to_thread(_ask_to_write, settings))
    if access.verdict is LinkVerdict.OK:
        proof += "" if came_back_on else ": the access list may hide the robot's own ones"
        access = ok(Link.ACCESS, f"{access.text}; a message on {topic} {proof}")
    return BrokerView([reached, let_in, access], plant_maps)


def _told_of_a_loss(mqtt: MqttSettings) -> str:
    # measured (docs/brokers.md); a broker of MQTT 3.1.1 does not say which one it is
    on_most, on_rabbitmq, on_activemq = (f"{factor * mqtt.keep_alive:g}" for factor in (1.5, 3, 2.5))
    return (
        f"with mqtt.keep_alive {mqtt.keep_alive}, a lost robot is reported after {on_most} s, "
        f"by RabbitMQ after up to {on_rabbitmq} s, by ActiveMQ after up to {on_activemq} s"
    )


async def _try_connection(mqtt: MqttSettings) -> str:
    """Open and close a connection; return the problem as text, empty if there is none."""
    try:
        async with asyncio.timeout(ANSWER_WITHIN):
            _, writer = await asyncio.open_connection(mqtt.host, mqtt.port)
    except TimeoutError:
        return _LATE.format(ANSWER_WITHIN)
    except socket.gaierror:
        return "the name does not resolve"
    except OSError as error:
        return os.strerror(error.errno) if error.errno else str(error)
    writer.close()
    return ""


class _BrokerProbe:
    """A link such as the agent's, with a separate client ID."""

    def __init__(self, settings: EdgeAgentSettings) -> None:
        robot = RobotKey(settings.manufacturer, settings.serial_number)
        scheme = topics_for(settings.version, settings.interface_name)
        mqtt = settings.mqtt.model_copy(update={"client_id": client_id(settings)})
        self._answered = asyncio.Event()
        # Some brokers refuse a connection whose will is retained or of QoS 1, as the agent's is.
        will = Outbound(f"{scheme.interface_name}/{scheme.major_version}/{robot}/doctor", b"", retain=True)
        hooks = LinkHooks(will=lambda: will, on_subscribed=self._answered.set)
        self._link = MqttLink(mqtt, client_id="", hooks=hooks)
        self._plant: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        # What the agent itself subscribes to; zone sets and responses exist since VDA 5050 3.0.
        topics_read = [Topic.ORDER, Topic.INSTANT_ACTIONS]
        if RULES[settings.version].zones:
            topics_read += [Topic.ZONE_SET, Topic.RESPONSES]
        self._topics = [scheme.of(robot, topic) for topic in topics_read]
        for topic in self._topics:
            self._link.subscribe(topic, lambda _: None)

        def on_plant_model(message: Inbound) -> None:
            # A second one, published meanwhile, would raise InvalidStateError.
            if not self._plant.done():
                self._plant.set_result(message.payload)

        # Not a wildcard, to which RabbitMQ sends no retained messages (measured, 3.10.8).
        self._link.subscribe(FleetTopics(settings.topic_prefix).plant_model, on_plant_model)

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[str]:
        """Connect for the duration of the block; yield the problem as text, empty if there is none."""
        work = asyncio.create_task(self._link.run(), name="doctor's link")
        try:
            for _ in range(int(ANSWER_WITHIN / 0.02)):
                # The link retries after an error; the doctor reports the first one.
                if self._answered.is_set() or self._link.state.last_error:
                    break
                await asyncio.sleep(0.02)
            late = _LATE.format(ANSWER_WITHIN)
            yield "" if self._answered.is_set() else self._link.state.last_error or late
        finally:
            await end(work)

    @property
    def refused(self) -> list[str]:
        """Return the robot's topics for which the broker refuses a subscription."""
        return [topic for topic in self._topics if topic in self._link.state.refused]

    async def plant_maps(self) -> frozenset[str]:
        """Return the map IDs in the plant model that the broker retains, if any."""
        try:
            async with asyncio.timeout(RETAINED_WITHIN):
                return map_ids(await self._plant)
        except TimeoutError:
            return frozenset()


def client_id(settings: EdgeAgentSettings) -> str:
    """Return the doctor's client ID: the agent's with a suffix, for brokers that check the prefix."""
    robot = RobotKey(settings.manufacturer, settings.serial_number)
    topics = topics_for(settings.version, settings.interface_name)
    return f"{settings.mqtt.client_id or client_id_of(robot, topics, settings.mqtt)}-doctor"


def map_ids(plant: bytes) -> frozenset[str]:
    """Return the map IDs in a plant model (JSON); empty if ``plant`` is not one."""
    try:
        return frozenset(_map_ids(json.loads(plant)))
    except (ValueError, RecursionError):
        return frozenset()


def _map_ids(part: object) -> list[str]:
    if isinstance(part, list):
        return [map_id for inner in part for map_id in _map_ids(inner)]
    if not isinstance(part, dict):
        return []
    map_ids = [map_id for inner in part.values() for map_id in _map_ids(inner)]
    own = part.get(MAP_PROPERTY)
    return [*map_ids, own] if isinstance(own, str) else map_ids


def login_identity(mqtt: MqttSettings) -> str:
    """Return the agent's identity at the broker, as far as the settings define it."""
    if mqtt.username:
        return f"as {mqtt.username}"
    return f"by the certificate {mqtt.tls.certificate}" if mqtt.tls.certificate else "as anonymous"


def _access_findings(settings: EdgeAgentSettings, refused: list[str], not_written: str) -> LinkFinding:
    robot = RobotKey(settings.manufacturer, settings.serial_number)
    scheme = topics_for(settings.version, settings.interface_name)
    subtree = f"{scheme.interface_name}/{scheme.major_version}/{robot}"
    # A broker may accept a login and refuse topics: the agent would then wait for orders in vain.
    # Not seen at Mosquitto 2.0.11, which grants what its list refuses and withholds the messages (measured).
    if refused:
        remedy = f"in the broker's access list, allow this user to read {', '.join(refused)}"
        return missing(Link.ACCESS, f"may not subscribe to {', '.join(refused)}", remedy)
    if not_written:
        text = f"may not write {scheme.of(robot, Topic.VISUALIZATION)}: {not_written}"
        remedy = f"in the broker's access list, allow this user to write below {subtree}/"
        return missing(Link.ACCESS, text, remedy)
    return ok(Link.ACCESS, f"may subscribe and write below {subtree}/")


def _ask_to_write(settings: EdgeAgentSettings) -> str:
    """Publish one message and return the broker's refusal, as text; empty if there is none.

    Uses MQTT 5, because older versions cannot report a refusal; a broker without MQTT 5 refuses nothing here.
    The message is a visualization without a position: displays ignore it, and nothing else reads it.
    """
    robot = RobotKey(settings.manufacturer, settings.serial_number)
    topic = topics_for(settings.version, settings.interface_name).of(robot, Topic.VISUALIZATION)
    codec = codec_for(settings.version)
    headers = HeaderMaker(robot, version=codec.version, clock=SystemClock())
    message = codec.encode(Visualization(**headers.make(Topic.VISUALIZATION), reference_state_header_id=0))
    mqtt, answered, refusals = settings.mqtt, threading.Event(), list[str]()

    def on_publish(_client: Client, _data: object, _mid: int, code: ReasonCode, _more: object) -> None:
        if code.is_failure:
            refusals.append(str(code))
        answered.set()

    def on_connect(client: Client, _data: object, _flags: object, code: ReasonCode, _more: object) -> None:
        if code.is_failure:
            answered.set()
        else:
            client.publish(topic, message, qos=1)

    # Measured: Mosquitto, NATS and ejabberd acknowledge a refused message of MQTT 3.1.1 as any other.
    client = Client(
        CallbackAPIVersion.VERSION2, client_id=f"{client_id(settings)}-5", protocol=MQTTProtocolVersion.MQTTv5
    )
    client.username_pw_set(mqtt.username, mqtt.secret())
    if (tls := tls_context(mqtt.tls)) is not None:
        client.tls_set_context(tls)
    client.on_connect, client.on_publish = on_connect, on_publish
    try:
        client.connect(mqtt.host, mqtt.port)
        client.loop_start()
        answered.wait(ANSWER_WITHIN)
    except OSError:
        return ""  # the connection worked a moment ago: the next check shows what broke it
    finally:
        client.disconnect()
        client.loop_stop()
    return refusals[0] if refusals else ""
