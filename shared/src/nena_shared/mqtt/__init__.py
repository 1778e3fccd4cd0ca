"""MQTT: one link to the broker per program, which comes back by itself."""

from nena_shared.mqtt.link import Handler, LinkState, MqttLink, Term, always
from nena_shared.mqtt.message import Inbound, Outbound

__all__ = ["Handler", "Inbound", "LinkState", "MqttLink", "Outbound", "Term", "always"]
