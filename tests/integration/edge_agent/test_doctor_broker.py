"""The doctor at a real broker: each link that can be missing there, and a robot that goes on meanwhile."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from pydantic import SecretStr

from nena_edge_agent.doctor.broker import BrokerView, examine_broker, login_identity
from nena_edge_agent.doctor.finding import Link, LinkFinding, LinkVerdict
from nena_edge_agent.doctor.program import main
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.mqtt import MqttLink
from nena_shared.settings import MqttSettings, MqttTlsSettings
from nena_shared.vda5050.topics import Topic
from support.broker import MOUNT_POINT, Broker, BrokerAddress, MqttPeer, free_port
from support.edge_agent import FleetControl, agent_settings, running_agent
from support.forgetful import cancel_again_at_once, forgetful
from support.waiting import PATIENCE, until

pytestmark = pytest.mark.broker

PLUGIN = Path("/usr/lib/x86_64-linux-gnu/mosquitto_dynamic_security.so")
OK, MISSING, UNKNOWN = LinkVerdict.OK, LinkVerdict.MISSING, LinkVerdict.UNKNOWN


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait long enough for answers, also on slow machines."""
    monkeypatch.setattr("nena_edge_agent.doctor.broker.ANSWER_WITHIN", PATIENCE)


def settings_for(mqtt: MqttSettings, **more: str) -> EdgeAgentSettings:
    settings = EdgeAgentSettings(manufacturer="ACME", serial_number="0001", mqtt=mqtt)
    return settings.model_copy(update=more)


def verdicts(view: BrokerView) -> dict[Link, LinkVerdict]:
    return {each.link: each.verdict for each in view.findings}


def first_missing(view: BrokerView) -> LinkFinding:
    return next(each for each in view.findings if each.verdict is MISSING)


async def test_broker_accepts_the_robot(broker: Broker, interface_name: str) -> None:
    view = await examine_broker(settings_for(broker.settings, interface_name=interface_name))

    assert verdicts(view) == {Link.BROKER: OK, Link.LOGIN: OK, Link.ACCESS: OK}
    texts = {each.link: each.text for each in view.findings}
    assert texts[Link.ACCESS].endswith(f"a message on {interface_name}/v2/ACME/0001/doctor came back")
    assert "a lost robot is reported after 22.5 s, by RabbitMQ after up to 45 s" in texts[Link.LOGIN]


async def test_names_that_the_broker_changes_are_not_called_fine(
    each_broker: BrokerAddress, interface_name: str
) -> None:
    named = {"interface_name": interface_name, "serial_number": "robot.1"}
    view = await examine_broker(settings_for(each_broker.settings, **named))
    assert verdicts(view)[Link.ACCESS] is (OK if isinstance(each_broker, Broker) else UNKNOWN)


@pytest.mark.parametrize("serial_number", ["0001", "robot.1"])
async def test_a_broker_that_changes_all_topics_is_not_called_fine(
    changing_broker: Broker, interface_name: str, serial_number: str
) -> None:
    named = {"interface_name": interface_name, "serial_number": serial_number}
    view = await examine_broker(settings_for(changing_broker.settings, **named))

    found = view.findings[-1]
    assert found.verdict is (MISSING if serial_number == "0001" else UNKNOWN)
    assert f"came back on {MOUNT_POINT}{interface_name}/v2/ACME/{serial_number}/doctor" in found.text


async def test_closed_port() -> None:
    port = free_port()

    view = await examine_broker(settings_for(MqttSettings(port=port)))

    assert verdicts(view) == {Link.BROKER: MISSING, Link.LOGIN: UNKNOWN, Link.ACCESS: UNKNOWN}
    assert f"127.0.0.1:{port} is unreachable: Connection refused" in first_missing(view).text


async def test_unknown_host() -> None:
    view = await examine_broker(settings_for(MqttSettings(host="broker.invalid")))

    assert "the name does not resolve" in first_missing(view).text


async def test_server_that_is_not_a_broker(monkeypatch: pytest.MonkeyPatch) -> None:
    """Accept the connection and close it."""
    monkeypatch.setattr("nena_edge_agent.doctor.broker.ANSWER_WITHIN", 2.0)

    async def close(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.close()

    server = await asyncio.start_server(close, "127.0.0.1", 0)
    async with server:
        port = server.sockets[0].getsockname()[1]
        view = await examine_broker(settings_for(MqttSettings(port=port)))

    assert verdicts(view) == {Link.BROKER: OK, Link.LOGIN: MISSING, Link.ACCESS: UNKNOWN}
    assert "does not answer as a broker of MQTT does" in first_missing(view).text
    assert "mqtt.port" in first_missing(view).remedy


async def test_link_that_ignores_its_end_is_ended_again(monkeypatch: pytest.MonkeyPatch) -> None:
    cancel_again_at_once(monkeypatch)
    monkeypatch.setattr("nena_edge_agent.doctor.broker.ANSWER_WITHIN", 2.0)
    monkeypatch.setattr(MqttLink, "run", forgetful)
    server = await asyncio.start_server(lambda _, writer: writer.close(), "127.0.0.1", 0)
    async with server:
        settings = settings_for(MqttSettings(port=server.sockets[0].getsockname()[1]))
        view = await asyncio.wait_for(examine_broker(settings), PATIENCE)
    assert verdicts(view)[Link.LOGIN] is MISSING


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Broker]:
    """Yield a broker with users who may not write, or not read, all of a robot's topics."""
    rules = tmp_path_factory.mktemp("acl") / "acl"
    rules.write_text(
        "user mute\ntopic read uagv/#\n\nuser robot\ntopic readwrite uagv/#\n\n"
        "user narrow\ntopic write uagv/#\ntopic read uagv/v2/+/+/order\n"
    )
    rules.chmod(0o644)
    rules.parent.chmod(0o755)
    broker = Broker(users={"mute": "m", "robot": "r", "narrow": "n"}, more=f"acl_file {rules}\n")
    yield broker
    broker.close()


@pytest.mark.parametrize(
    ("username", "password", "verdict"),
    [("robot", "r", OK), ("robot", "wrong", MISSING), ("nobody", "r", MISSING), (None, None, MISSING)],
)
async def test_wrong_credentials(
    guarded: Broker, username: str | None, password: str | None, verdict: LinkVerdict
) -> None:
    secret = SecretStr(password) if password else None
    mqtt = guarded.settings.model_copy(update={"username": username, "password": secret})

    view = await examine_broker(settings_for(mqtt))

    assert verdicts(view)[Link.BROKER] is OK
    assert verdicts(view)[Link.LOGIN] is verdict
    if verdict is MISSING:
        assert "whether it admits the client ID" in first_missing(view).remedy


@pytest.mark.parametrize("more", ["retain_available false\n", "max_qos 0\n"])
async def test_broker_that_refuses_the_last_will(more: str) -> None:
    with closing(Broker(more=more)) as broker:
        view = await examine_broker(settings_for(broker.settings))

    assert verdicts(view)[Link.LOGIN] is MISSING
    assert "whether it allows the last will: a retained message of QoS 1" in first_missing(view).text


async def test_robot_without_write_permission(guarded: Broker) -> None:
    mqtt = guarded.settings.model_copy(update={"username": "mute", "password": SecretStr("m")})

    view = await examine_broker(settings_for(mqtt))

    assert verdicts(view) == {Link.BROKER: OK, Link.LOGIN: OK, Link.ACCESS: MISSING}
    assert "may not write uagv/v2/ACME/0001/visualization: Not authorized" in first_missing(view).text
    assert "write below uagv/v2/ACME/0001/" in first_missing(view).remedy


async def test_robot_that_may_not_read_its_own_messages_misses_nothing(guarded: Broker) -> None:
    mqtt = guarded.settings.model_copy(update={"username": "narrow", "password": SecretStr("n")})

    view = await examine_broker(settings_for(mqtt))

    assert verdicts(view)[Link.ACCESS] is OK
    assert "did not come back" in view.findings[-1].text


@pytest.mark.skipif(not PLUGIN.exists(), reason=f"Mosquitto's dynamic security plug-in is not at {PLUGIN}")
async def test_robot_without_permission_to_read_orders(tmp_path: Path) -> None:
    deny = {"acltype": "subscribePattern", "topic": "+/v2/+/+/order", "priority": 1, "allow": False}
    rules = {
        "defaultACLAccess": dict.fromkeys(
            ("publishClientSend", "publishClientReceive", "subscribe", "unsubscribe"), True
        ),
        "roles": [{"rolename": "deaf", "acls": [deny]}],
        "groups": [{"groupname": "all", "roles": [{"rolename": "deaf"}], "clients": []}],
        "anonymousGroup": "all",
        "clients": [],
    }
    file = tmp_path / "security.json"
    file.write_text(json.dumps(rules))
    file.chmod(0o666)
    broker = Broker(more=f"plugin {PLUGIN}\nplugin_opt_config_file {file}\n")
    try:
        view = await examine_broker(settings_for(broker.settings))
    finally:
        broker.close()

    assert verdicts(view)[Link.ACCESS] is MISSING
    assert first_missing(view).text == "may not subscribe to uagv/v2/ACME/0001/order"


async def test_the_maps_of_a_plant_model_are_read(
    own_broker: Broker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nena_edge_agent.doctor.broker.RETAINED_WITHIN", PATIENCE)
    with MqttPeer(own_broker) as peer:
        plant = {"points": [{"properties": {"vda5050:mapId": "hall"}}]}
        peer.publish("nena/v1/plantModel", json.dumps(plant), retain=True)

        view = await examine_broker(settings_for(own_broker.settings))

    assert view.plant_maps == {"hall"}


async def test_running_agent_is_not_disturbed(broker: Broker, interface_name: str, tmp_path: Path) -> None:
    settings = agent_settings(broker, interface_name, tmp_path)
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        fleet = FleetControl(peer, interface_name)
        async with running_agent(settings):
            await fleet.state()

            view = await examine_broker(settings)

            await until(lambda: len(peer.received(fleet.topic(Topic.VISUALIZATION))) > 0)
            assert set(verdicts(view).values()) == {OK}
            assert fleet.connections == ["ONLINE"]


def test_exit_status_reflects_the_findings(capsys: pytest.CaptureFixture[str], broker: Broker) -> None:
    loopback = ("--driver", "loopback", "--mqtt.port")

    well = main((*loopback, str(broker.port)))
    report = capsys.readouterr().out
    assert well == 0
    assert report.endswith("No link is missing.\n")

    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        ill = main((*loopback, str(closed.getsockname()[1])))
    report = capsys.readouterr().out
    assert ill == 1
    assert report.endswith("The first missing link: broker.\n")


def test_invalid_settings_are_one_clear_line(capsys: pytest.CaptureFixture[str]) -> None:
    status = main(("--mqtt.password_file", "/nowhere/password", "--driver", "loopback"))

    assert status == 2
    assert capsys.readouterr().err.startswith("nena-edge-agent doctor: setting mqtt.password_file: ")


def test_reports_the_identity_it_connected_with() -> None:
    tls = MqttTlsSettings(certificate=Path("me.pem"), key=Path("key.pem"))

    assert login_identity(MqttSettings()) == "as anonymous"
    assert login_identity(MqttSettings(username="robot")) == "as robot"
    assert login_identity(MqttSettings(tls=tls)) == "by the certificate me.pem"
