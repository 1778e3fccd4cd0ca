"""A ROS node with its own context, spun by its own thread.

This keeps robots in different domains, or with different lifetimes, apart in one process.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from nena_shared import ros
from nena_shared.log import get_logger

log = get_logger(__name__)

NO_PUBLISHER_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
NO_SUBSCRIPTION_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)
"""rclpy builds the wait set again for each message and timer, so each entity in it costs time."""
NO_TYPE_DESCRIPTIONS = Parameter("start_type_description_service", value=False)


class RosSession:
    """One node in one domain; ``name`` appears in the log and names the thread."""

    def __init__(self, name: str, *, node_name: str, namespace: str, domain_id: int) -> None:
        self._name = name
        self._joined = ExitStack()
        context = self._joined.enter_context(ros.joined_domain(domain_id))
        self._node = Node(
            node_name,
            context=context,
            namespace=namespace,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=[NO_TYPE_DESCRIPTIONS],
        )
        self._callbacks = ReentrantCallbackGroup()
        # 0051: the EventsExecutor takes half a core, and its sessions do not end.
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        # rclpy's default clock is the system's: setting it would delay or hurry all timers.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._spin_executor, name=f"ros {name}", daemon=True)

    @property
    def alive(self) -> bool:
        """Whether the thread still runs callbacks."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Start running callbacks."""
        self._thread.start()

    @property
    def namespace(self) -> str:
        """The node's namespace, with a leading slash."""
        return str(self._node.get_namespace())

    def publisher(self, kind: type[Any], topic: str, qos: QoSProfile) -> Publisher:
        """Create a publisher."""
        return self._node.create_publisher(
            kind, topic, qos, callback_group=self._callbacks, event_callbacks=NO_PUBLISHER_EVENTS
        )

    def subscribe(
        self, kind: type[Any], topic: str, callback: Callable[[Any], None], qos: QoSProfile
    ) -> Subscription:
        """Pass each message of a topic to ``callback``; a failure is logged and affects only that message."""

        def isolated(message: object) -> None:
            with self._isolate_errors(topic):
                callback(message)

        return self._node.create_subscription(
            kind, topic, isolated, qos, callback_group=self._callbacks, event_callbacks=NO_SUBSCRIPTION_EVENTS
        )

    def serve(self, kind: type[Any], name: str, callback: Callable[[Any, Any], None]) -> Service:
        """Serve a service; ``callback`` fills the response, which is sent even if it fails."""

        def isolated(request: object, response: object) -> object:
            with self._isolate_errors(name):
                callback(request, response)
            return response

        return self._node.create_service(kind, name, isolated, callback_group=self._callbacks)

    def serve_later(
        self, kind: type[Any], name: str, callback: Callable[[Any, Callable[[Any], None]], None]
    ) -> Service:
        """Serve a service; ``callback`` receives each request and a function that sends the response later.

        rclpy supports late responses only by coroutines, which its executor polls continuously.
        """
        service = self._node.create_service(
            kind, name, lambda request, _response: request, callback_group=self._callbacks
        )
        send = service.send_response

        def forward(request: object, header: object) -> None:
            with self._isolate_errors(name):
                callback(request, lambda response: send(response, header))

        service.send_response = forward
        return service

    def destroy(self, entity: Publisher | Subscription | Service | None) -> None:
        """Remove a publisher, subscription or service from the ROS graph."""
        match entity:
            case Publisher():
                self._node.destroy_publisher(entity)
            case Subscription():
                self._node.destroy_subscription(entity)
            case Service():
                self._node.destroy_service(entity)

    def every(self, seconds: float, callback: Callable[[], None]) -> Timer:
        """Call ``callback`` periodically; a failure is logged and the next call follows as usual."""

        def isolated() -> None:
            with self._isolate_errors(callback.__name__):
                callback()

        return self._node.create_timer(seconds, isolated, callback_group=self._callbacks, clock=self._steady)

    @contextmanager
    def _isolate_errors(self, work: str) -> Iterator[None]:
        """Log an exception instead of ending the thread."""
        try:
            yield
        except Exception:
            # An exception in a callback would end spinning, and with it the whole robot.
            log.exception("callback failed", robot=self._name, work=work)

    def close(self, timeout: float = 1.5) -> None:
        """Stop the thread within ``timeout`` seconds, then destroy node and context."""
        if self._thread.is_alive():
            # A task wakes the executor, which waits in spin_once without a time limit.
            self._executor.create_task(self._stop.set)
            self._thread.join(timeout)
        if self._thread.is_alive():
            log.error("ROS thread does not stop; abandoned", robot=self._name)
            return
        self._executor.shutdown()
        self._node.destroy_node()
        self._joined.close()

    def _spin_executor(self) -> None:
        try:
            while not self._stop.is_set():
                self._executor.spin_once()
        except Exception:
            log.exception("ROS thread failed", robot=self._name)
