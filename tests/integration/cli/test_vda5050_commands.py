"""The commands as a user calls them, at a real broker."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from nena_conversations.recording import read_file
from support.broker import Broker, MqttPeer, free_port
from support.certificates import Authority
from support.conversations import FOLDER, recorder
from support.waiting import PATIENCE, until

pytestmark = pytest.mark.broker

FILE = FOLDER / "3.0.0-cancel.jsonl"
RECORD = ("vda5050", "record")


def nena(*arguments: str, stdin: str = "") -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "nena_cli", "vda5050", *arguments]
    return subprocess.run(command, capture_output=True, text=True, input=stdin, timeout=PATIENCE, check=False)


def url(broker: Broker) -> str:
    return f"mqtt://{broker.host}:{broker.port}"


async def test_replay_equals_the_recording(own_broker: Broker, tmp_path: Path) -> None:
    again = tmp_path / "again.jsonl"
    with recorder(own_broker, again):
        await until(lambda: "SUBSCRIBE" in own_broker.log, what="the recorder")
        done = nena("replay", str(FILE), url(own_broker), "--speed", "1000")
        assert done.returncode == 0, done.stderr
        count = len(FILE.read_text().splitlines())
        await until(lambda: again.exists() and len(again.read_text().splitlines()) == count)

    first, second = list(read_file(FILE)), list(read_file(again))
    assert [(each.topic, each.payload) for each in first] == [(each.topic, each.payload) for each in second]


async def test_one_side_is_replayed_with_fresh_headers(own_broker: Broker) -> None:
    told = [entry for entry in read_file(FILE) if entry.topic.endswith(("/order", "/instantActions"))]
    with MqttPeer(own_broker, "fleet/#") as peer:
        done = nena("replay", str(FILE), url(own_broker), "--speed", "1000", "--only", "fleet", "--fresh")
        assert done.returncode == 0, done.stderr
        received = await until(lambda: got if len(got := peer.received()) >= len(told) else None)

    assert len(received) == len(told)
    assert {each.topic.rsplit("/", 1)[1] for each in received} <= {"order", "instantActions"}
    recorded = {entry.topic: json.loads(entry.payload)["timestamp"] for entry in read_file(FILE)}
    for each in received:
        assert json.loads(each.payload)["timestamp"] > recorded[each.topic]


async def test_a_part_of_a_recording_is_replayed(own_broker: Broker) -> None:
    states = ("--topic", "fleet/+/+/+/state", "--speed", "1000")
    with MqttPeer(own_broker, "#") as peer:
        assert "2 messages" in nena("replay", str(FILE), url(own_broker), *states, "--messages", "2").stderr
        assert "0 messages" in nena("replay", str(FILE), url(own_broker), "--robot", "ACME/0002").stderr
        received = await until(lambda: got if len(got := peer.received()) >= 2 else None)

    first, second = [each for each in read_file(FILE) if each.topic.endswith("/state")][:2]
    assert [each.payload for each in received] == [first.payload, second.payload]


async def test_messages_of_one_robot_are_recorded_unchanged(own_broker: Broker, tmp_path: Path) -> None:
    file = tmp_path / "one.jsonl"
    wanted = ("--interface", "site/hall", "--robot", "ACME/1", "--messages", "3")
    with MqttPeer(own_broker, "none") as peer:
        peer.publish("site/hall/v2/ACME/1/connection", b"kept", retain=True)
        process = await _start(
            [sys.executable, "-m", "nena_cli", *RECORD, url(own_broker), str(file), *wanted]
        )
        try:
            await until(lambda: own_broker.log.count("SUBSCRIBE") > 1, what="the recorder")
            for topic, qos in (("2/state", 1), ("1/order", 0), ("1/state", 1)):
                peer.publish(f"site/hall/v2/ACME/{topic}", b"\xff", qos=qos)
            assert process.wait(PATIENCE) == 0
        finally:
            process.kill()

    assert [(each.topic[-7:], each.payload, each.qos, each.retain) for each in read_file(file)] == [
        ("nection", b"kept", 1, True),
        ("1/order", b"\xff", 0, False),
        ("1/state", b"\xff", 1, False),
    ]


async def test_interrupted_recording_is_complete(own_broker: Broker, tmp_path: Path) -> None:
    file = tmp_path / "some.jsonl"
    with MqttPeer(own_broker, "none") as peer, recorder(own_broker, file) as process:
        await until(lambda: own_broker.log.count("SUBSCRIBE") > 1, what="the recorder")
        peer.publish("fleet/v2/ACME/1/state", b"{}")
        await until(lambda: file.exists() and file.read_text().endswith("\n"), what="the line")
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0

    assert [each.payload for each in read_file(file)] == [b"{}"]


def test_failed_recording_leaves_no_file(tmp_path: Path) -> None:
    assert nena("record", "mqtt://127.0.0.1:1", str(tmp_path / "it.jsonl")).returncode == 2
    assert list(tmp_path.iterdir()) == []


def test_existing_recording_is_never_overwritten(own_broker: Broker, tmp_path: Path) -> None:
    file = tmp_path / "there.jsonl"
    file.write_text("precious")

    done = nena("record", url(own_broker), str(file), "--seconds", "0.1")

    assert (done.returncode, file.read_text()) == (2, "precious")
    assert "there.jsonl" in done.stderr


def test_show_lists_changes() -> None:
    done = nena("show", str(FILE))

    assert done.returncode == 0, done.stderr
    assert "fleet → ACME/0001 order" in done.stdout
    assert "do cancelOrder" in done.stdout
    assert "cancelOrder" in done.stdout.split("FAILED")[0]
    assert "WARNING NO_ORDER_TO_CANCEL" in done.stdout
    assert nena("show", str(FILE), "--robot", "ACME/0009").stdout == ""


def test_check_reports_errors_and_exits_with_1() -> None:
    lines = FILE.read_text()

    assert nena("check", str(FILE)).returncode == 0
    broken = nena("check", "-", "--json", stdin=lines.replace('\\"driving\\":true', '\\"driving\\":7'))
    assert broken.returncode == 1
    finding = json.loads(broken.stdout.splitlines()[0])
    assert (finding["rule"], finding["severity"], finding["version"]) == ("message", "error", "3.0.0")
    assert finding["robot"] == "ACME/0001"
    text = nena("check", "-", stdin=lines.replace('\\"driving\\":true', '\\"driving\\":7')).stdout
    assert "message; VDA 5050 3.0.0, 7.8" in text


@pytest.mark.parametrize(
    ("lines", "told"), [("", ""), ('ACME/1/state {"orderId": ""}', ", such as 'ACME/1/state'")]
)
def test_a_recording_without_a_message_of_vda_5050_does_not_pass(lines: str, told: str) -> None:
    done = nena("check", "-", stdin=lines)
    assert done.returncode == 1
    assert (
        f"No message has a topic of VDA 5050 (interface/v2/manufacturer/serialNumber/state){told}."
        in done.stderr
    )


def test_warnings_count_with_the_option() -> None:
    recorded = (FOLDER / "2.1.0-refusals.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    # without the order that begins 70 m from the robot, which is an error
    refusals = "".join(line for line in recorded if '"orderId\\":\\"far' not in line)

    assert nena("check", "-", stdin=refusals).returncode == 0
    assert nena("check", "-", "--strict", stdin=refusals).returncode == 1
    assert "0 errors, 1 warnings" in nena("check", "-", stdin=refusals).stderr
    assert nena("check", "-", "--strict", "--topic", "+/+/+/+/state", stdin=refusals).returncode == 0


async def test_check_reads_from_a_broker(own_broker: Broker) -> None:
    command = [
        sys.executable,
        "-m",
        "nena_cli",
        "vda5050",
        "check",
        url(own_broker),
        "--messages",
        "1",
        "--json",
    ]
    with MqttPeer(own_broker, "none") as peer:
        process = await _start(command)
        try:
            await until(lambda: own_broker.log.count("SUBSCRIBE") > 1, what="the checker")
            peer.publish("fleet/v3/ACME/0001/state", b"{}")
            out, _ = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()

    assert process.returncode == 1
    assert json.loads(out.splitlines()[0])["topic"] == "state"


async def _start(command: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)  # noqa: ASYNC220 - at once


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("check", "/nowhere.jsonl"), "cannot be read"),
        (("check", "mqtt://127.0.0.1:1", "--seconds", "30"), "Cannot connect to the broker"),
        (("record", "http://x", "never.jsonl"), "Invalid broker URL"),
    ],
)
def test_errors_are_one_clear_line_and_status_2(arguments: tuple[str, ...], text: str) -> None:
    done = nena(*arguments)

    assert done.returncode == 2
    assert text in done.stderr
    assert "Traceback" not in done.stderr


async def test_a_recording_is_replayed_over_tls(tmp_path: Path) -> None:
    authority, port = Authority(tmp_path), free_port()
    server = authority.sign("broker")
    door = f"listener {port} 127.0.0.1\ncertfile {server.certificate}\nkeyfile {server.key}\n"
    broker = Broker(more=door)
    address = f"mqtts://127.0.0.1:{port}"
    try:
        with MqttPeer(broker, "fleet/#") as peer:
            ours = ("--ca", str(authority.ca))
            done = nena(*ours, "replay", str(FILE), address, "--speed", "1000", "--messages", "2")
            assert done.returncode == 0, done.stderr
            await until(lambda: len(peer.received()) == 2, what="both messages")
        unknown = nena("replay", str(FILE), address, "--messages", "2")
    finally:
        broker.close()

    assert unknown.returncode == 2
    assert "CERTIFICATE_VERIFY_FAILED" in unknown.stderr
