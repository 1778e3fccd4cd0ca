"""A robot's connection to the broker, for what outlasts the robot's agent."""

from __future__ import annotations

from collections.abc import Callable

from nena_shared.mqtt import BrokerLink, Handler, LinkState, Outbound

NOT_CONNECTED = LinkState()


class RobotLink:
    """The link of the robot's agent. A restarted agent has another one, with the same subscriptions."""

    def __init__(self) -> None:
        self._subscriptions: list[Callable[[BrokerLink], None]] = []
        self._link: BrokerLink | None = None

    @property
    def state(self) -> LinkState:
        """Return whether the robot is connected."""
        return self._link.state if self._link else NOT_CONNECTED

    def subscribe(self, topic_filter: str, handler: Handler, *, qos: int = 1, needed: bool = False) -> None:
        """Pass the messages of a topic filter to a function; only before the robot starts.

        ``needed``: the robot's state reports an error if the broker refuses.
        """
        self._subscriptions.append(lambda link: link.subscribe(topic_filter, handler, qos=qos, needed=needed))

    def publish(self, message: Outbound) -> None:
        """Send a message; before the robot starts, it is dropped."""
        if self._link:
            self._link.publish(message)

    def cut(self, seconds: float) -> None:
        """Cut the connection for ``seconds``, without a disconnect, to simulate a failure."""
        if self._link:
            self._link.cut(seconds)

    def use_link(self, link: BrokerLink) -> None:
        """Subscribe and publish on the link of a new agent from now on."""
        for subscribe in self._subscriptions:
            subscribe(link)
        self._link = link
