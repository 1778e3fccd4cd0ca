"""Rules that are checked, with their sections of the standard, and findings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import Enum, StrEnum
from types import MappingProxyType
from typing import Final

from nena_shared.vda5050.topics import RobotKey, Topic


class Severity(StrEnum):
    """Severity of a finding."""

    ERROR = "error"
    """The standard forbids it."""
    WARNING = "warning"
    """It may be a fault, or a message is missing from the recording."""


FIRST_2_1: Final = (2, 1)
FIRST_3: Final = (3, 0)


@dataclass(frozen=True, slots=True)
class Sections:
    """Section of each version of the standard; None: the version has no such rule."""

    v2_0: str | None
    v2_1: str | None
    v3: str | None

    def of(self, version: str) -> str | None:
        """Return the section in the text of a version, or of the nearest one known here."""
        major, minor = (int(each) for each in version.split(".")[:2])
        if (major, minor) >= FIRST_3:
            return self.v3
        return self.v2_1 if (major, minor) >= FIRST_2_1 else self.v2_0


def both_versions(section_2: str | None, section_3: str | None) -> Sections:
    """Return sections where both versions of 2.x have the same one."""
    return Sections(section_2, section_2, section_3)


def _only_3(section: str) -> Sections:
    return Sections(None, None, section)


MESSAGES: Final[Mapping[Topic, Sections]] = MappingProxyType(
    {
        Topic.ORDER: Sections("6.7", "6.6.6", "7.3"),
        Topic.INSTANT_ACTIONS: both_versions("6.9", "7.4"),
        Topic.STATE: both_versions("6.10.6", "7.8"),
        Topic.VISUALIZATION: both_versions("6.13", "7.9"),
        Topic.CONNECTION: both_versions("6.14", "7.7"),
        Topic.FACTSHEET: Sections("7", "6.15", "7.10"),
        Topic.ZONE_SET: Sections("6.5", "6.5", "7.6"),
        Topic.RESPONSES: Sections("6.5", "6.5", "7.5"),
    }
)
"""Description of each message. 2.x lists its topics in 6.5 and lacks the last two."""


class Rule(Enum):
    """Checked rules: a code, and sections; None: the section that describes the message."""

    MESSAGE = "message", None
    """The message is valid for its topic and version."""
    FIELD = "field", None
    """The message has only fields of its version."""
    SPELLING = "spelling", both_versions("6.1", "7.1")
    """Names and times are written as the version writes them."""
    GRAPH = "graph", both_versions("6.6.1", "6.1.1")
    """Nodes and edges alternate, and an order begins and ends with a node."""
    SEQUENCE = "sequence", both_versions("6.6.1", "6.1.1")
    """Nodes have even sequenceIds, edges odd ones; they rise without gaps."""
    BASE = "base", both_versions("6.6.1", "6.1.1")
    """What is released, the base, comes before the horizon."""
    VERSION = "version", both_versions("6.3", "4.2")
    """Topic and header name the same major version."""
    ADDRESS = "address", both_versions("6.4", "7.2")
    """The header names the robot of the topic."""
    HEADER_ID = "headerId", both_versions("6.4", "7.2")
    """headerId increases by one from message to message of a topic."""
    TIMESTAMP = "timestamp", both_versions("6.4", "7.2")
    """Timestamps do not go back."""
    RETAINED = "retained", both_versions("6.2", "4.1")
    """What fleet control sends is not retained: robots would get it again."""

    CONNECTION = "connection", both_versions("6.14", "6.5")
    """Only a robot that is ONLINE sends states."""
    STATE_INTERVAL = "stateInterval", both_versions("6.10", "6.6")
    """The robot sends a state at least every 30 s, or as often as its factsheet says."""

    FIRST_SEQUENCE_ID = "firstSequenceId", both_versions("6.6.1", "6.1.1")
    """A new order begins with sequenceId 0."""
    FIRST_UPDATE_ID = "firstUpdateId", _only_3("6.1.1")
    """A new order has orderUpdateId 0."""
    OTHER_ORDER = "otherOrder", both_versions("6.6.2", "6.1.4.6")
    """A new order is sent to an idle robot only."""
    START_NODE = "startNode", both_versions("6.6.4", "6.1.4.7")
    """A new order begins where the robot is: at its last node, or within the deviation of the first one."""
    OFFLINE = "offline", both_versions("6.14", "6.5")
    """Nothing is sent to a robot that is not connected."""
    MODE = "mode", both_versions("6.10.6", "6.6.6")
    """Fleet control sends only in modes in which it controls the robot."""
    NOT_OFFERED = "notOffered", Sections("7", "6.15", "7.10")
    """Fleet control requests only actions of the factsheet."""
    LIMITS = "limits", Sections("7", "6.15", "7.10")
    """Messages keep the limits of the factsheet: lengths of lists, IDs and messages."""
    ORDER_INTERVAL = "orderInterval", Sections("7", "6.15", "7.10")
    """Orders do not come faster than the factsheet allows."""
    OUTDATED_UPDATE = "outdatedUpdate", both_versions("6.6.4.3", "6.1.4.4")
    """An update has a greater orderUpdateId than the ones before."""
    SAME_UPDATE_ID = "sameUpdateId", _only_3("6.1.4.5")
    """A repeated orderUpdateId has the same content."""
    STITCHING = "stitching", both_versions("6.6.2", "6.1.2")
    """An update begins with the decision point: the base is extended, never changed."""
    STITCHING_NODE = "stitchingNode", _only_3("6.1.2")
    """An update repeats the decision point unchanged."""
    UPDATE_AFTER_CANCEL = "updateAfterCancel", _only_3("6.1.3.1")
    """A cancelled order gets no update."""
    ACTION_ID = "actionId", Sections("6.7", "6.6.6", "7.3")
    """An actionId identifies one action."""

    ANSWER = "answer", both_versions("6.10", "6.6")
    """The robot's state echoes an order, or names it in an error."""
    INSTANT_ANSWER = "instantAnswer", both_versions("6.9", "6.2.1")
    """Each instant action gets a state."""
    ECHO = "echo", both_versions("6.10.6", "7.8")
    """A state has an order and update that were sent, and never returns to an older update."""
    PROGRESS = "progress", both_versions("6.10.2", "6.6.2")
    """Nodes are those of the order; they disappear in order, without gaps, and never reappear."""
    FIRST_NODE = "firstNode", _only_3("6.6.1")
    """The first node of an order counts as reached immediately."""
    ACTION_LOST = "actionLost", both_versions("6.11", "6.6.9")
    """Each action of an order has a state from its acceptance on."""
    ACTION_STATUS = "actionStatus", both_versions("6.11", "6.6.9")
    """An action's status changes as the figure of the standard allows."""
    ACTION_EARLY = "actionEarly", both_versions("6.10.2", "6.6.2")
    """An action begins when its node is reached or its edge entered."""
    BLOCKING = "blocking", both_versions("6.12", "6.2.2")
    """HARD and SINGLE actions run alone; no driving beside HARD and SOFT ones."""
    CANCEL_END = "cancelEnd", both_versions("6.6.3", "6.1.3")
    """When cancelOrder is FINISHED, no nodes, edges or running actions of the order remain."""
    RESPONSE = "response", _only_3("6.9")
    """Fleet control answers only requests of the robot."""

    def __init__(self, code: str, sections: Sections | None) -> None:
        self.code = code
        self._sections = sections

    def section(self, version: str, topic: Topic) -> str | None:
        """Return the section in the text of a version, for a message of ``topic``; None: no such rule."""
        return (self._sections or MESSAGES[topic]).of(version)


Problem = tuple[Rule, Severity, str]
"""Problem of a message that is known from the context."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A finding about the ``number``-th message of a conversation, from 1."""

    number: int
    time: datetime
    robot: RobotKey
    topic: Topic
    version: str
    rule: Rule
    section: str
    """Section of the standard, in the message's version."""
    severity: Severity
    text: str

    def as_json(self) -> dict[str, str | int]:
        """Return the finding as a JSON object."""
        return {
            "number": self.number,
            "time": self.time.isoformat(),
            "robot": str(self.robot),
            "topic": self.topic.value,
            "version": self.version,
            "rule": self.rule.code,
            "section": self.section,
            "severity": self.severity.value,
            "text": self.text,
        }
