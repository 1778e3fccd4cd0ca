"""A ROS node with a context of its own, spun by a thread of its own.

Robots in different domains, or with different lives, stay apart this way in one process.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from nena_shared.log import get_logger

log = get_logger(__name__)


class RosSession:
    """One node in one domain; ``name`` is for the log and the thread."""

    def __init__(self, name: str, *, node_name: str, namespace: str, domain_id: int) -> None:
        self._name = name
        self._context = Context()
        rclpy.init(
            args=[],
            context=self._context,
            domain_id=domain_id,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self._node = Node(
            node_name,
            context=self._context,
            namespace=namespace,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._spin, name=f"ros {name}", daemon=True)

    @property
    def alive(self) -> bool:
        """Whether the thread still runs callbacks."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Run callbacks from now on."""
        self._thread.start()

    @property
    def namespace(self) -> str:
        """The node's namespace, with a leading slash."""
        return str(self._node.get_namespace())

    def publisher(self, kind: type[Any], topic: str, qos: QoSProfile) -> Publisher:
        """Offer a topic."""
        return self._node.create_publisher(kind, topic, qos)

    def subscribe(
        self, kind: type[Any], topic: str, callback: Callable[[Any], None], qos: QoSProfile
    ) -> Subscription:
        """Give each message of a topic to ``callback``; a failure is logged and costs that message only."""

        def guarded(message: object) -> None:
            with self._guard(topic):
                callback(message)

        return self._node.create_subscription(kind, topic, guarded, qos)

    def serve(self, kind: type[Any], name: str, callback: Callable[[Any, Any], None]) -> Service:
        """Let ``callback`` fill the answers of a service; after a failure the answer goes out as it is."""

        def guarded(request: object, response: object) -> object:
            with self._guard(name):
                callback(request, response)
            return response

        return self._node.create_service(kind, name, guarded)

    def serve_later(
        self, kind: type[Any], name: str, callback: Callable[[Any, Callable[[Any], None]], None]
    ) -> Service:
        """Give each request of a service to ``callback``, with what sends its answer, now or later.

        rclpy lets a service answer late only by a coroutine, which its executor then asks without a pause.
        """
        service = self._node.create_service(kind, name, lambda request, _response: request)
        send = service.send_response

        def hand_on(request: object, header: object) -> None:
            with self._guard(name):
                callback(request, lambda response: send(response, header))

        service.send_response = hand_on
        return service

    def destroy(self, entity: Publisher | Subscription | Service | None) -> None:
        """Take a topic's end or a service out of the ROS graph."""
        match entity:
            case Publisher():
                self._node.destroy_publisher(entity)
            case Subscription():
                self._node.destroy_subscription(entity)
            case Service():
                self._node.destroy_service(entity)

    def every(self, seconds: float, callback: Callable[[], None]) -> Timer:
        """Call ``callback`` again and again; after a failure the next round follows as usual."""

        def guarded() -> None:
            with self._guard(callback.__name__):
                callback()

        return self._node.create_timer(seconds, guarded, clock=self._steady)

    @contextmanager
    def _guard(self, work: str) -> Iterator[None]:
        """Keep an exception from ending the thread."""
        try:
            yield
        except Exception:
            log.exception("callback has failed", robot=self._name, work=work)

    def close(self, timeout: float = 1.5) -> None:
        """End the thread within ``timeout`` seconds, then the node and the context."""
        if self._thread.is_alive():
            self._executor.create_task(self._stop.set)
            self._thread.join(timeout)
        if self._thread.is_alive():
            log.error("ROS thread does not end; left to the end of the process", robot=self._name)
            return
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def _spin(self) -> None:
        try:
            while not self._stop.is_set():
                self._executor.spin_once()
        except Exception:
            log.exception("ROS thread has failed", robot=self._name)
