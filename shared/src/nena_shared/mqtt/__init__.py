"""MQTT: one link to the broker per program, with automatic reconnects."""

from nena_shared.mqtt.link import Handler, Link, LinkHooks, LinkState, MqttLink, Term, always
from nena_shared.mqtt.message import Inbound, Outbound

__all__ = ["Handler", "Inbound", "Link", "LinkHooks", "LinkState", "MqttLink", "Outbound", "Term", "always"]
