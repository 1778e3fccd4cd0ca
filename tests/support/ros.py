"""ROS for tests: a separate domain for each test, nodes in threads, and waiting with timeouts.

Importing this module sets up the process for ROS tests: discovery stays on this machine, no shared memory
(a killed process would leave zombies in it), and a number of the wrong type in a message is an error.
"""

from __future__ import annotations

import atexit
import os
import random
import shutil
import socket
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, Generic, Self, TypeVar

from nena_shared import ros
from support.waiting import wait_until

ROS_ENVIRONMENT = {
    "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "ROS_PYTHON_CHECK_FIELDS": "1",
}
"""For this process and for every process that a test starts (``os.environ`` already holds it)."""

os.environ.update(ROS_ENVIRONMENT)
if "ROS_LOG_DIR" not in os.environ:
    _log_dir = tempfile.mkdtemp(prefix="nena-test-ros-log-")
    os.environ["ROS_LOG_DIR"] = _log_dir
    atexit.register(shutil.rmtree, _log_dir, ignore_errors=True)

import rclpy  # noqa: E402
from rclpy.context import Context  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402
from rclpy.signals import SignalHandlerOptions  # noqa: E402

from support.waiting import PATIENCE  # noqa: E402

T = TypeVar("T")

LATCHED = QoSProfile(
    depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


CALLS = 3
"""Maximum number of calls of a service that does not answer."""


class Participant:
    """This process in one domain: a context with a permanent node, so that no test's node is the last in it.

    With a context's last node Fast DDS deletes its participant, which sometimes ends the process by a
    segmentation fault (rclpy/node.py, destroy_node) when others in the domain end at the same time, as at the
    end of a test.
    """

    DISCOVERY = 2.0
    """Time after which all other participants of the domain are discovered, seconds."""

    def __init__(self, domain_id: int) -> None:
        self.context = Context()
        rclpy.init(
            args=[],
            context=self.context,
            domain_id=domain_id,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self._node = self.node("_test_process", "")  # hidden, as for `ros2 node list`
        self._since = time.monotonic()

    def node(self, name: str, namespace: str) -> Node:
        """Make a node of this participant."""
        return Node(
            name,
            namespace=namespace,
            context=self.context,
            enable_rosout=False,
            start_parameter_services=False,
        )

    @property
    def alone(self) -> bool:
        """Return whether no other participant is in the domain or listed: DDS lists a killed one for 20 s."""
        seen = time.monotonic() - self._since > self.DISCOVERY
        return seen and bool(self._node.get_node_names() == [self._node.get_name()])


_joining = threading.Lock()
_participants: dict[int, Participant] = {}
_reservations: list[socket.socket] = []
_free: list[int] = []
"""Domains of this process that no test uses now; the last used one is at the end."""


def _participant(domain_id: int) -> Participant:
    """Return this process's participant in a domain, which exists until the process ends."""
    with _joining:
        if domain_id not in _participants:
            _participants[domain_id] = Participant(domain_id)
        return _participants[domain_id]


@contextmanager
def _kept_domain(domain_id: int) -> Iterator[Context]:
    """Replace the agent's own participant, which it removes at the end of its ROS session."""
    yield _participant(domain_id).context


@contextmanager
def own_domain_id(count: int = 1) -> Iterator[int]:
    """Return a ROS domain id, and the next ones, that no other test on this machine uses at the same time.

    A domain stays with the process, see :class:`Participant`, and is used again once it is empty. A test that
    had only other processes in it leaves a participant there, which sees when they have gone. From the first
    one on, agents and simulators in this process share its participants; programs that tests start do not.
    """
    ros.joined_domain = _kept_domain
    domain_id = next((each for each in _free if _participants[each].alone), None) if count == 1 else None
    if domain_id is None:
        domain_id = _reserve(count)
    else:
        _free.remove(domain_id)
    try:
        yield domain_id
    finally:
        for each in range(domain_id, domain_id + count):
            _participant(each)
            _free.append(each)


def _reserve(count: int) -> int:
    """Reserve domain IDs for this process; they are free again when it ends, even by a crash.

    The reservation is an abstract socket name. The ids 1 to 101 stay clear of the ephemeral ports of Linux.
    """
    last = 101 - count
    for domain_id in random.SystemRandom().sample(range(1, last + 2), last + 1):
        with ExitStack() as locks:
            taken = [
                locks.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) for _ in range(count)
            ]
            try:
                for number, lock in enumerate(taken, start=domain_id):
                    lock.bind(f"\0nena-test-ros-domain-{number}")
            except OSError:
                continue
            locks.pop_all()
            _reservations.extend(taken)
            return domain_id
    message = "all ROS domain ids for tests are in use"
    raise RuntimeError(message)


class Inbox(Generic[T]):
    """The messages of one topic in the order of arrival; the ROS thread adds them."""

    def __init__(self) -> None:
        self._messages: list[T] = []
        self._changed = threading.Condition()

    def add(self, message: T) -> None:
        with self._changed:
            self._messages.append(message)
            self._changed.notify_all()

    @property
    def messages(self) -> list[T]:
        with self._changed:
            return list(self._messages)

    def clear(self) -> None:
        with self._changed:
            self._messages.clear()

    def wait_for(
        self, accept: Callable[[T], bool] = lambda _: True, *, timeout: float = PATIENCE, what: str = ""
    ) -> T:
        """Return the first message (also an earlier one) for which ``accept`` is true.

        AssertionError on timeout.
        """
        seen = 0

        def found() -> list[T]:
            nonlocal seen
            fresh, seen = self._messages[seen:], len(self._messages)
            return [message for message in fresh if accept(message)]

        with self._changed:
            matches = self._changed.wait_for(found, timeout)
        assert matches, f"no {what or 'matching message'} in {timeout} s; came: {self.messages[-5:]}"
        return matches[0]

    def stays_silent(self, seconds: float) -> bool:
        """Return whether nothing new arrives for ``seconds``."""
        with self._changed:
            before = len(self._messages)
            return not self._changed.wait_for(lambda: len(self._messages) > before, seconds)


class RosPeer:
    """A node for tests in a given domain, spun by a separate thread until it is closed."""

    def __init__(self, domain_id: int, namespace: str = "", name: str = "test_peer") -> None:
        participant = _participant(domain_id)
        self.node = participant.node(name, namespace)
        self.context = participant.context
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._spin, name=f"ros peer {name}", daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        while not self._stop.is_set():
            self._executor.spin_once()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._executor.create_task(self._stop.set)
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive(), "the test's ROS thread does not end"
        self._executor.shutdown()
        self.node.destroy_node()

    def subscribe(self, message_type: Any, topic: str, qos: Any = RELIABLE) -> Inbox[Any]:
        inbox: Inbox[Any] = Inbox()
        self.node.create_subscription(message_type, topic, inbox.add, qos)
        return inbox

    def publisher(
        self, message_type: Any, topic: str, qos: Any = RELIABLE, *, timeout: float = PATIENCE
    ) -> Any:
        """Make a publisher and wait for a subscriber."""
        publisher = self.node.create_publisher(message_type, topic, qos)
        wait_until(
            lambda: publisher.get_subscription_count() > 0, timeout=timeout, what=f"a subscriber of {topic}"
        )
        return publisher

    def client(self, service_type: Any, name: str, *, timeout: float = PATIENCE) -> Any:
        """Make a service client and wait until the service is available."""
        client = self.node.create_client(service_type, name)
        wait_until(client.service_is_ready, timeout=timeout, what=f"service {name}")
        return client

    def call(self, client: Any, request: Any, *, timeout: float = PATIENCE) -> Any:
        """Call a service and return its answer.

        DDS may lose a call or its answer while client and server discover each other, so it is repeated.
        """
        done = threading.Event()
        for _ in range(CALLS):
            future = client.call_async(request)
            future.add_done_callback(lambda _: done.set())
            if done.wait(timeout / CALLS):
                return future.result()
        message = f"service {client.srv_name} gave no answer to {CALLS} calls in {timeout} s"
        raise AssertionError(message)
