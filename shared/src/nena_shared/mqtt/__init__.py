"""MQTT: one link to the broker per program, with automatic reconnects."""

from nena_shared.mqtt.client import Inbound, Outbound
from nena_shared.mqtt.link import BrokerLink, Handler, LinkHooks, LinkState, MqttLink, Term, always

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
