"""An executor with little work per message of a topic; all else is left to rclpy's."""

from __future__ import annotations

from contextlib import ExitStack, suppress
from typing import Any

from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor, TimeoutException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.waitable import NumberOfEntities

from nena_shared.log import get_logger

KINDS = ("subscription", "guard_condition", "timer", "client", "service")
"""The kinds of entities in a wait set, in the order of its constructor; events belong to waitables."""
FOREVER = -1
INTERNALS = ("_context", "_guard", "_tasks")
"""Private attributes of rclpy's executor that are used here; since Jazzy's rclpy 7.1.9 it has other ones."""

log = get_logger(__name__)


def make_executor(topics: Any, asked: Any, context: Any) -> SingleThreadedExecutor:  # noqa: ANN401 - rclpy carries no types
    """Return a :class:`TopicExecutor`, or rclpy's own executor if this rclpy has other internals."""
    executor = TopicExecutor(topics, asked, context=context)
    if all(hasattr(executor, each) for each in INTERNALS) and hasattr(rclpy_implementation, "WaitSet"):
        return executor
    log.info("using rclpy's own executor: this rclpy has other internals than 7.1.8")
    executor.shutdown()
    return SingleThreadedExecutor(context=context)


class TopicExecutor(SingleThreadedExecutor):  # type: ignore[misc] # rclpy carries no types
    """Calls the callbacks of the subscriptions in one callback group directly: plain functions of a message.

    For each message rclpy builds its wait set twice and makes a task. Here a wait set is kept until there is
    something else to do, which may have changed the node. Guard conditions of the node are not served.
    """

    def __init__(self, topics: Any, asked: Any, **options: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Create the executor; entities of the callback group ``asked`` do not wake it."""
        super().__init__(**options)
        self._topics, self._asked = topics, asked

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Pass on messages until something else is ready, then do that; ``timeout_sec`` is ignored."""
        del timeout_sec
        if not self._has_tasks():
            with suppress(InvalidHandle), ExitStack() as stack:  # invalid: just destroyed
                self._pass_on_messages(stack)
        with suppress(TimeoutException):
            while True:
                task, _, _ = self.wait_for_ready_callbacks(0)
                task()
                task.result()

    def _pass_on_messages(self, stack: ExitStack) -> None:
        """Return when something else than a message of a topic is ready; ``stack`` keeps the entities."""
        found, waitables = self._entities("subscriptions"), self._entities("waitables")
        others = (self._entities(f"{kind}s") for kind in KINDS[2:])
        handles = [[each.handle for each in entities] for entities in (found, [self._guard], *others)]
        count = NumberOfEntities(*map(len, handles))
        for each in (*(handle for of_kind in handles for handle in of_kind), *waitables):
            stack.enter_context(each)
        for each in waitables:
            count += each.get_num_entities()
        sizes = (getattr(count, f"num_{kind}s") for kind in (*KINDS, "event"))
        wait_set = rclpy_implementation.WaitSet(*sizes, self._context.handle)
        subscriptions = {each.handle.pointer: each for each in found}
        while not self._has_tasks():  # one may have come while the others were done
            wait_set.clear_entities()
            for kind, of_kind in zip(KINDS, handles, strict=True):
                for handle in of_kind:
                    getattr(wait_set, f"add_{kind}")(handle)
            for each in waitables:
                each.add_to_wait_set(wait_set)
            wait_set.wait(FOREVER)
            ready, *rest = map(wait_set.get_ready_entities, KINDS)
            topics = [subscriptions[each] for each in ready if each in subscriptions]
            alien = any(each.callback_group is not self._topics for each in topics)
            if alien or any(rest) or any(each.is_ready(wait_set) for each in waitables):
                return
            for each in topics:
                if taken := each.handle.take_message(each.msg_type, each.raw):
                    each.callback(taken[0])

    def _has_tasks(self) -> bool:
        return not all(task.done() for task, _, _ in self._tasks)

    def _entities(self, kinds: str) -> list[Any]:
        found = (each for node in self.get_nodes() for each in getattr(node, kinds))
        return [each for each in found if each.callback_group is not self._asked and self.can_execute(each)]
