#!/usr/bin/env bash
# paho-mqtt 2.2.0: Client.loop_read(max_packets=N), part of the documented interface for an event loop of one's own,
# ignores its argument. With ten messages in the socket, loop_read(max_packets=10) handles one packet; the number that it
# really reads is that of the client's own unacknowledged messages, at least one. A program that drains the socket once
# per readiness notification of an edge-triggered poller stops receiving, and one with a level-triggered poller pays a
# turn of its loop for each message.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check paho-mqtt==2.2.0
timeout 60 "$folder/venv/bin/python" - <<'EOF'
import socket
import struct
import sys
import threading
import time

import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

MESSAGES = 10
CONNACK = b"\x20\x02\x00\x00"


def publish(topic: bytes, payload: bytes) -> bytes:
    content = struct.pack("!H", len(topic)) + topic + payload
    return bytes([0x30, len(content)]) + content


def be_a_broker(listening: socket.socket, done: threading.Event) -> None:
    connection, _ = listening.accept()
    with connection:
        connection.recv(1000)  # CONNECT
        connection.sendall(CONNACK + b"".join(publish(b"a/b", b"%d" % number) for number in range(MESSAGES)))
        done.wait(30)


received: list[bytes] = []
done = threading.Event()
with socket.create_server(("127.0.0.1", 0)) as listening:
    threading.Thread(target=be_a_broker, args=(listening, done), daemon=True).start()
    client = mqtt.Client(CallbackAPIVersion.VERSION2)
    client.on_message = lambda _client, _data, message: received.append(message.payload)
    client.connect(*listening.getsockname())
    time.sleep(1)  # until everything is in the client's socket
    seen = []
    for _ in range(4):
        client.loop_read(max_packets=MESSAGES)
        seen.append(len(received))
    done.set()
print(f"messages after each loop_read(max_packets={MESSAGES}): {seen}; the first reads CONNACK")
sys.exit(seen != [0, 1, 2, 3])
EOF
