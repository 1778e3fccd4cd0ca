"""Has the journal written in a thread, so that a slow disk delays the robot but never its link."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from queue import Empty, SimpleQueue

from nena_edge_agent.journal import Journal
from nena_edge_agent.protocol.memory import Memory

AT_ONCE = 0.01
"""Seconds for which the event loop itself waits: the kernel takes a record in a tenth of a millisecond, and
to come back to a loop that has gone on takes longer than that."""
PATIENCE = 2.0
"""Seconds that the disk has to take a record; a robot that is told to stop cannot wait for longer."""

Version = tuple[object, ...]
"""Differs from another one when the memories differ that they are of."""


class Recorder:
    """Records what a robot must still know; a disk that fails or hangs is told, and the robot goes on.

    To be used in turn: :meth:`write`, then what may be done once the record outlives the process, then
    :meth:`sync`, then what may be done once it outlives a power cut.
    """

    def __init__(
        self,
        journal: Journal | None,
        version: Version,
        *,
        tell: Callable[[str], None],
        wake: Callable[[], None],
    ) -> None:
        """Prepare to record what differs from ``version``.

        Args:
            journal: where to; None: nowhere.
            version: of what the journal holds.
            tell: is told after each record what is wrong with the disk, "" for nothing.
            wake: is called when a disk that hung has answered: the newest record can be written then.

        """
        self._journal = journal
        self._durable: Version | None = version
        self._begun: Version | None = None
        self._written: Version | None = version
        self._tell = tell
        self._wake = wake
        self._record: asyncio.Future[None] | None = None
        self._deadline = 0.0

    async def write(self, version: Version, memory: Callable[[], Memory]) -> None:
        """Begin to record what is new; come back when it outlives the process, or the disk has failed."""
        if self._journal is None or version == self._durable or self._hangs:
            return  # while the disk hangs at an older record, a newer one must not get in between
        loop = asyncio.get_running_loop()
        self._begun, self._deadline = version, loop.time() + PATIENCE
        self._written = self._durable = None  # a record that fails may have taken the place of the one before
        written: SimpleQueue[bool] = SimpleQueue()
        self._record = loop.run_in_executor(None, _work, self._journal, memory(), written)
        self._record.add_done_callback(_hear)
        try:
            outlives = written.get(timeout=AT_ONCE)
        except Empty:
            outlives = await asyncio.to_thread(_await, written, PATIENCE)
        self._written = version if outlives else None

    async def sync(self) -> None:
        """Come back when what was begun is on the disk, or the disk has failed."""
        if self._record is None or self._begun is None:
            return
        version, self._begun = self._begun, None
        patience = self._deadline - asyncio.get_running_loop().time()
        done, _ = await asyncio.wait((self._record,), timeout=max(0.0, patience))
        if not done:
            self._record.add_done_callback(lambda _: self._wake())
            self._tell("the disk does not answer")
        elif error := self._record.exception():
            self._tell(str(error) or type(error).__name__)
        else:
            self._durable = version
            self._tell("")

    def has_written(self, version: Version) -> bool:
        """Tell whether what differs in ``version`` outlives the process; without a journal nothing does."""
        return self._journal is None or version in (self._written, self._durable)

    def has_synced(self, version: Version) -> bool:
        """Tell whether what differs in ``version`` outlives a power cut; without a journal nothing does."""
        return self._journal is None or version == self._durable

    @property
    def _hangs(self) -> bool:
        return self._record is not None and not self._record.done()


def _work(journal: Journal, memory: Memory, written: SimpleQueue[bool]) -> None:
    """Live in a thread: write, tell whether the kernel has it, and wait for the disk."""
    taken = False
    try:
        journal.write(memory)
        taken = True
    finally:
        written.put(taken)
    journal.sync()


def _await(written: SimpleQueue[bool], seconds: float) -> bool:
    """Live in another thread: wait for what is told, for so long."""
    try:
        return written.get(timeout=seconds)
    except Empty:
        return False


def _hear(record: asyncio.Future[None]) -> None:
    """Take in what became of a record; where nobody waits for it any more, it does not matter."""
    if not record.cancelled():
        record.exception()
