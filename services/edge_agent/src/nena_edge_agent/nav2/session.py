"""A ROS session in its own thread, and its bounded mailbox to the event loop."""

from __future__ import annotations

import asyncio
import threading
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from typing import Any, Generic, TypeVar

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from nena_edge_agent.driver.port import SessionError, SessionState
from nena_shared import ros
from nena_shared.log import get_logger
from nena_shared.tasks import set_within

T = TypeVar("T")


class RosMailbox(Generic[T]):
    """Accepts items in one thread and passes them to ``deliver`` in another, in order.

    ``post`` runs a function in the other thread. When more than ``limit`` items wait, the oldest is dropped:
    every topic read here reports a state, of which the newest counts.
    """

    def __init__(
        self, limit: int, deliver: Callable[[T], None], post: Callable[[Callable[[], None]], None]
    ) -> None:
        self._items: deque[T] = deque(maxlen=limit)
        self._lock = threading.Lock()
        self._posted = False
        self._deliver = deliver
        self._post = post

    def put(self, item: T) -> None:
        """Queue an item; returns at once."""
        with self._lock:
            # deque(maxlen) drops the oldest: a delayed loop gets the newest state.
            self._items.append(item)
            post, self._posted = not self._posted, True
        if post:
            self._post(self._deliver_items)

    def _deliver_items(self) -> None:
        with self._lock:
            items = list(self._items)
            self._items.clear()
            self._posted = False
        for item in items:
            self._deliver(item)


log = get_logger(__name__)

LOOP_TIMEOUT = 5.0
"""Maximum time in which the event loop is told of a failure, seconds."""
NO_TYPE_DESCRIPTIONS = Parameter("start_type_description_service", value=False)
"""A service of each node that only introspection tools call, since Jazzy."""


RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(
    depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
SENSOR = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Matches every publisher, and never gets a latched message."""

NO_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
"""Without QoS events: rclpy builds the wait set twice for each message, and most of it would be events."""
STATUS_ARRAYS = 10
"""Maximum number of status arrays waiting for the loop; each is complete, so the oldest can be dropped."""


class RosSession:
    """One node in one domain. A session that has ended or failed is not restarted: create a new one."""

    def __init__(self, *, node_name: str, namespace: str, domain_id: int) -> None:
        """Prepare the session, in the event loop that it will work for."""
        self._node_name = node_name
        self._namespace = namespace
        self._domain_id = domain_id
        self._loop = asyncio.get_running_loop()
        self._began = asyncio.Event()
        self._ended = asyncio.Event()
        self._stop = threading.Event()
        self._executor: SingleThreadedExecutor | None = None
        self._on_failure: Callable[[str], None] = lambda _reason: None
        self.state = SessionState.NOT_ACTIVE
        self.reason = ""

    async def start(
        self,
        populate: Callable[[Any], None],
        *,
        on_failure: Callable[[str], None] = lambda _reason: None,
        seconds: float = 10.0,
    ) -> None:
        """Create the node, run ``populate`` on it (in the ROS thread), and run its callbacks.

        ``on_failure`` is called, in the loop, when the thread ends unexpectedly.

        Raises:
            SessionError: ROS refuses, or takes longer than ``seconds``.
        """
        self.state = SessionState.INITIATING
        self._thread = threading.Thread(
            target=self._run_thread, args=(populate,), name=f"ros {self._node_name}", daemon=True
        )
        self._thread.start()
        try:
            if not await set_within(self._began, seconds):
                self.state, self.reason = SessionState.FAILED, f"ROS did not start within {seconds:g} s"
                self._end_thread()
        except asyncio.CancelledError:
            self._end_thread()
            raise
        if self.state is SessionState.FAILED:
            raise SessionError(self.reason)
        self._on_failure = on_failure

    async def stop(self, *, seconds: float = 5.0) -> None:
        """End callbacks, node and context, in this order, waiting at most ``seconds``."""
        if self.state is not SessionState.ACTIVE:
            return
        self.state = SessionState.TERMINATING
        self._end_thread()
        if await set_within(self._ended, seconds):
            self._thread.join(1.0)  # its last action was to report that it has ended
        else:
            log.warning("the ROS thread did not end; leaving it until the process exits", seconds=seconds)

    def subscribe(
        self,
        node: Any,  # noqa: ANN401 - rclpy carries no types
        kind: Any,  # noqa: ANN401
        topic: str,
        qos: Any,  # noqa: ANN401
        *,
        read: Callable[[Any], T],
        handle: Callable[[T], None],
        limit: int = 1,
        due: Callable[[], bool] | None = None,
        events: bool = False,
    ) -> Any:  # noqa: ANN401
        """Read each message of a topic in the ROS thread and handle the result in the loop.

        Returns the subscription.

        At most ``limit`` readings wait for the loop; the oldest is dropped. A message that cannot be read is
        skipped; the first one after a good one is logged. For a topic with more messages than needed, ``due``
        returns whether the next one is wanted: others are not even deserialised. ``events``: say in the log
        that a publisher does not fit ``qos``; each such topic costs time for every message of the others.
        """
        mailbox = RosMailbox(limit, handle, self.post)
        well = True

        def on_message(message: object) -> None:
            nonlocal well
            if due is not None and not due():
                return
            try:
                mailbox.put(read(deserialize_message(message, kind) if due else message))
                well = True
            except Exception as error:  # noqa: BLE001 - one let go here would end the thread
                if well:
                    log.warning("messages cannot be used", topic=topic, reason=repr(error))
                well = False

        return node.create_subscription(
            kind,
            topic,
            on_message,
            qos,
            raw=due is not None,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=events),
        )

    async def call(self, client: Any, request: Any, *, seconds: float) -> Any:  # noqa: ANN401
        """Call a service and return its answer; None if it is missing or silent for ``seconds``."""
        if self.state is not SessionState.ACTIVE or not client.service_is_ready():
            return None
        answered = asyncio.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: self.post(answered.set))
        try:
            return future.result() if await set_within(answered, seconds) else None
        finally:
            # rclpy keeps a request whose server has died for ever.
            client.remove_pending_request(future)

    def late_client(self, node: Any, kind: Any, name: str) -> LateClient:  # noqa: ANN401
        """Return a client that is created with its first call."""
        return LateClient(self, lambda: node.create_client(kind, name))

    def post(self, function: Callable[[], None]) -> None:
        """Call ``function`` in the event loop; it is dropped if the loop has ended."""
        try:
            self._loop.call_soon_threadsafe(function)
        except RuntimeError:
            log.debug("the event loop has ended before ROS")

    def _end_thread(self) -> None:
        if self._executor is None:
            self._stop.set()
        else:  # in the thread: one that had noticed the event before this call would have closed the executor
            self._executor.create_task(self._stop.set)

    def _run_thread(self, populate: Callable[[Any], None]) -> None:
        """Run the session's thread: open, spin, close."""
        reason = "its thread has ended"
        try:
            with ExitStack() as stack:
                try:
                    executor = self._open_node(stack, populate)
                    self.post(self._begin_session)
                    while not self._stop.is_set():
                        executor.spin_once()
                except Exception as error:  # any failure has to reach the program
                    log.exception(
                        "ROS session has failed", domain_id=self._domain_id, namespace=self._namespace
                    )
                    reason = str(error) or type(error).__name__
                    # The loop is told before the node is destroyed: nothing in it uses the node afterwards.
                    told = threading.Event()
                    self.post(partial(self._end_session, reason))
                    self.post(told.set)
                    told.wait(LOOP_TIMEOUT)
        finally:
            self.post(lambda: self._end_session(reason))

    def _open_node(self, stack: ExitStack, populate: Callable[[Any], None]) -> SingleThreadedExecutor:
        # A context of its own: a robot can change its domain, and its end leaves others alone.
        context = stack.enter_context(ros.joined_domain(self._domain_id))
        # No log topic, parameters and type descriptions: each costs entities in the wait set of every
        # message.
        node = Node(
            self._node_name,
            context=context,
            namespace=self._namespace,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=[NO_TYPE_DESCRIPTIONS],
        )
        stack.callback(node.destroy_node)
        self._executor = executor = SingleThreadedExecutor(context=context)
        stack.callback(executor.shutdown)
        populate(node)
        executor.add_node(node)
        return executor

    def _begin_session(self) -> None:
        if self.state is SessionState.INITIATING:
            self.state = SessionState.ACTIVE
        self._began.set()

    def _end_session(self, reason: str) -> None:
        if self._ended.is_set():
            return
        asked = self._stop.is_set()
        self.state = SessionState.NOT_ACTIVE if asked else SessionState.FAILED
        self.reason = "" if asked else reason
        self._began.set()
        self._ended.set()
        if not asked:
            self._on_failure(reason)


LOOK_PERIOD = 0.01
"""Interval between checks whether a new client has found its server, seconds."""


class LateClient:
    """A client created on demand for a service that is seldom called: each delays the start of a session."""

    def __init__(self, session: RosSession, create: Callable[[], Any]) -> None:
        self._session = session
        self._create = create
        self._client: Any = None
        self._created_at = 0.0

    def prepare(self) -> None:
        """Create the client in advance, so that it has found its server by its first call."""
        if self._client is None and self._session.state is SessionState.ACTIVE:
            self._client = self._create()
            self._created_at = asyncio.get_running_loop().time()

    async def call(self, request: Any, *, seconds: float) -> Any:  # noqa: ANN401 - rclpy carries no types
        """Call the service and return its answer; None if it is missing or silent for ``seconds``.

        A new client searches for its server for ``seconds`` in total, however many calls are waiting.
        """
        self.prepare()
        if self._client is None:
            return None
        loop = asyncio.get_running_loop()
        while self._session.state is SessionState.ACTIVE and not self._client.service_is_ready():
            if loop.time() - self._created_at >= seconds:
                break
            await asyncio.sleep(LOOK_PERIOD)
        return await self._session.call(self._client, request, seconds=seconds)
