#!/usr/bin/env bash
# NATS server 2.9.10 (Debian's package) as an MQTT broker grants one connection 63 subscriptions with QoS 1 and answers
# every further one with 0x80; with QoS 0 it grants all 200 that are asked for. No limit of subscriptions is configured:
# each QoS 1 subscription reserves its max_ack_pending (default 1,024) of the 65,535 packet identifiers of the session.
# A fleet control that subscribes to a topic of each robot with QoS 1 is deaf to the 64th robot, and a client that does
# not read the codes of the SUBACK never learns of it. Mosquitto grants all 200.
set -euo pipefail
folder=$(mktemp -d)
server=
trap '[ -z "$server" ] || kill "$server" 2>/dev/null || true; rm -rf "$folder"' EXIT
cd "$folder"
apt-get download -qq nats-server=2.9.10-1+b3
dpkg -x nats-server_*.deb .
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check paho-mqtt==2.1.0
port=$(python3 -c 'import socket; probe = socket.socket(); probe.bind(("127.0.0.1", 0)); print(probe.getsockname()[1])')
cat > nats.conf <<EOF
listen: "127.0.0.1:-1"
server_name: one
jetstream { store_dir: "$folder/jetstream" }
mqtt { listen: "127.0.0.1:$port" }
EOF
usr/sbin/nats-server -c nats.conf > nats.log 2>&1 &
server=$!
timeout 60 venv/bin/python - "$port" <<'EOF'
import collections
import sys
import threading
import time

import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

SUBSCRIPTIONS = 200


def granted(qos: int) -> collections.Counter[int]:
    codes, connected, answered = [], threading.Event(), threading.Event()

    def on_subscribe(_client, _data, _mid, reasons, _properties) -> None:
        codes.extend(reason.value for reason in reasons)
        if len(codes) == SUBSCRIPTIONS:
            answered.set()

    client = mqtt.Client(CallbackAPIVersion.VERSION2, client_id=f"control-{qos}")
    client.on_connect = lambda *_: connected.set()
    client.on_subscribe = on_subscribe
    for _ in range(50):
        try:
            client.connect("127.0.0.1", int(sys.argv[1]))
            break
        except OSError:
            time.sleep(0.1)
    client.loop_start()
    assert connected.wait(10)
    for number in range(SUBSCRIPTIONS):
        client.subscribe(f"uagv/v2/maker/robot-{number}/state", qos)
    assert answered.wait(20)
    client.disconnect()
    client.loop_stop()
    return collections.Counter(codes)


seen = granted(0), granted(1)
print(f"of {SUBSCRIPTIONS} subscriptions, by code: QoS 0 {dict(seen[0])}, QoS 1 {dict(seen[1])}")
sys.exit(seen != ({0: 200}, {1: 63, 128: 137}))
EOF
