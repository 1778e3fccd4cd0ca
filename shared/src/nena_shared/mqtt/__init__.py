"""MQTT: one link to the broker per program, with automatic reconnects."""

from nena_shared.mqtt.link import BrokerLink, Handler, LinkHooks, LinkState, MqttLink, Term, always
from nena_shared.mqtt.message import Inbound, Outbound

__all__ = [
    "BrokerLink",
    "Handler",
    "Inbound",
    "LinkHooks",
    "LinkState",
    "MqttLink",
    "Outbound",
    "Term",
    "always",
]
