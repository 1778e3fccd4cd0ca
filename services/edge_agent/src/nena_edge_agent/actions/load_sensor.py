"""A sensor that says on a topic whether the robot carries something."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from math import inf

from nena_edge_agent.actions.matching import matches
from nena_edge_agent.actions.message_types import UnknownTypeError, message_type
from nena_edge_agent.actions.ports import Fields, RosPort
from nena_edge_agent.actions.settings import LoadSensorSettings, OperationBase
from nena_edge_agent.actions.values import ActionValues, MessageTemplate
from nena_edge_agent.protocol.events import LoadSensed
from nena_shared.settings import ConfigurationError

PATH = "actions.load_sensor"
AGAIN_AFTER = 1.0
"""Seconds after which the same is told again: an action may have said something else meanwhile."""


class LoadSensor:
    """Tells what the sensor says: at once when that changes, and now and then when it does not.

    Raises:
        ConfigurationError: the message is none of its type.

    """

    def __init__(self, settings: LoadSensorSettings, port: RosPort) -> None:
        nothing = ActionValues(OperationBase(action_type=PATH))
        try:
            shape = message_type(settings.type)
        except UnknownTypeError as error:
            raise ConfigurationError([f"{PATH}.type: {error}"]) from error
        template = MessageTemplate(settings.loaded, shape, nothing, f"{PATH}.loaded", any_of=True)
        self._loaded = template.filled({})
        self._told: bool | None = None
        self._told_at = -inf
        self.tell: Callable[[LoadSensed], None] | None = None
        port.subscribe(settings.topic, settings.type, self._heard, qos=settings.qos)

    def _heard(self, message: Fields) -> None:
        loaded, now = matches(message, self._loaded), asyncio.get_running_loop().time()
        if self.tell and (loaded is not self._told or now - self._told_at >= AGAIN_AFTER):
            self._told, self._told_at = loaded, now
            self.tell(LoadSensed(loaded=loaded))
