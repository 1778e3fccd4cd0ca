"""What a check finds, and the section of the standard that says otherwise."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import Enum, StrEnum

from nena_shared.vda5050.topics import RobotKey, Topic


class Severity(StrEnum):
    """How bad it is."""

    ERROR = "error"
    """The standard forbids it."""
    WARNING = "warning"
    """It may be a fault, or a message that was not recorded."""


class Rule(Enum):
    """The rules that are checked, with their sections in 2.x and in 3.0."""

    MESSAGE = "message", "7.1", "7.1.1"
    """It is a message of its topic and version, and an order a valid graph."""
    VERSION = "version", "6.3", "4.2"
    """Topic and header name the same major version."""
    ADDRESS = "address", "6.4", "7.2"
    """The header names the robot of the topic."""
    HEADER_ID = "headerId", "6.4", "7.2"
    """headerId rises by one from message to message of a topic."""
    TIMESTAMP = "timestamp", "6.4", "7.2"
    """Timestamps do not go back."""
    FIRST_UPDATE = "firstUpdate", "6.6.4", "6.1.4"
    """A new order begins with sequenceId 0 and, in 3.0, with orderUpdateId 0."""
    OTHER_ORDER = "otherOrder", "6.6.4", "6.1.4.6"
    """A new order is sent to an idle robot only."""
    UPDATE_ID = "updateId", "6.6.2", "6.1.4.4"
    """An update has a greater orderUpdateId; the same id says the same."""
    STITCHING = "stitching", "6.6.2", "6.1.2"
    """An update begins with the decision point, and the base is never changed."""
    UPDATE_AFTER_CANCEL = "updateAfterCancel", "6.6.3", "6.1.3.1"
    """A cancelled order gets no update."""
    ANSWER = "answer", "6.6.4", "6.1.4"
    """The robot's state echoes an order, or names it in an error."""
    UNKNOWN_ORDER = "unknownOrder", "6.10", "6.6"
    """A state names an order that was sent."""
    PROGRESS = "progress", "6.10.2", "6.6.2"
    """Nodes and edges leave the state in their order, none is left out, none comes back."""
    ACTION_LOST = "actionLost", "6.11", "6.6.9"
    """Each action of an order has a state from its acceptance on."""
    ACTION_STATUS = "actionStatus", "6.11", "6.6.9"
    """An action's status changes as the figure of the standard allows."""
    ACTION_ID = "actionId", "6.9", "6.2.1"
    """An actionId stands for one action."""
    INSTANT_ANSWER = "instantAnswer", "6.9", "6.2.1"
    """Each instant action gets a state."""
    CANCEL_END = "cancelEnd", "6.6.3", "6.1.3"
    """When cancelOrder is finished, nothing of the order is left."""
    STATE_INTERVAL = "stateInterval", "6.10", "6.6"
    """A state comes at least every 30 s."""
    MODE = "mode", "6.10.6", "6.6.6"
    """Orders are sent in modes only in which fleet control has the robot."""

    def __init__(self, code: str, section_2: str, section_3: str) -> None:
        self.code = code
        self.section_2 = section_2
        self.section_3 = section_3

    def section(self, version: str) -> str:
        """Give the section in the text of a version."""
        return self.section_3 if version.startswith("3") else self.section_2


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding about one message, the ``number``-th of the conversation, from 1."""

    number: int
    time: datetime
    robot: RobotKey
    topic: Topic
    version: str
    rule: Rule
    severity: Severity
    text: str

    @property
    def section(self) -> str:
        """The section of the standard, in the message's own version."""
        return self.rule.section(self.version)
