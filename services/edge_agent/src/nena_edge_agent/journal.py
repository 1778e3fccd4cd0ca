"""The journal: the state that survives a restart of the agent, in one file per robot."""

from __future__ import annotations

import asyncio
import errno
import fcntl
import json
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from urllib.parse import quote
from zlib import crc32

from nena_edge_agent.durability import sync_folder
from nena_edge_agent.protocol.memory import FORMAT, Memory
from nena_shared.histogram import SHORT, Histogram
from nena_shared.tasks import StartError
from nena_shared.vda5050.topics import RobotKey

MINIMUM_RECORD_SPACE = 4 * 1024
"""Minimum space for one record, bytes. An order of a few nodes fits; more space would delay each record."""
BLOCK = 512
"""Size of a block that a disk writes atomically, bytes."""
LABEL = 23
"""Bytes at the start of each block: checksum (8 digits) and record number (13), each followed by a space."""
CHECKSUM = 9
"""Bytes of the only checksum in records of earlier releases: eight digits and a space."""


@contextmanager
def lock_journal(folder: Path, robot: RobotKey) -> Iterator[None]:
    """Lock the journal of ``robot`` in this folder, so that no other program uses it.

    Raises:
        StartError: another program holds the lock, or the folder cannot be used.
    """
    path = _expand_home(folder) / f"{_file_name(robot)}.lock"
    with ExitStack() as stack:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            file = stack.enter_context(path.open("wb"))
            # The kernel releases this lock with the process, so a killed agent leaves none behind.
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise StartError(
                f"another edge agent is running for robot {robot}: stop it first ({path} is locked)"
            ) from error
        except OSError as error:
            full = error.errno in (errno.ENOSPC, errno.EDQUOT)
            remedy = "free space on its disk" if full else "set journal.folder"
            raise StartError(
                f"the journal's folder {folder} cannot be used: {error.strerror}; {remedy}"
            ) from error
        yield


class UnreadableJournalError(Exception):
    """The journal cannot be read; the message contains the reason and what to do."""


class Journal:
    """Stores the last two records, each in its half of one file.

    A record overwrites the older one. The file keeps its size, so that a write needs no new disk blocks. If a
    record needs more space, a new file replaces the old one. Each disk block has its own checksum and record
    number, so that an interrupted write (whole blocks of two records) differs from damaged data (a block that
    does not match its checksum).
    """

    def __init__(
        self, folder: Path, robot: RobotKey, *, on_record: Callable[[bytes], None] = lambda _: None
    ) -> None:
        """Create the journal; ``on_record`` gets each record, in the thread of :meth:`write`."""
        self._on_record = on_record
        self._folder = _expand_home(folder)
        self._file = self._folder / f"{_file_name(robot)}.journal"
        self._number = 0
        """Number of the last record on disk."""
        self._begun = 0
        """Highest number that blocks of the file may have, including those of a failed record."""
        self._made = False

    def read(self) -> Memory | None:
        """Return the last record, None if there is none. Call this before the first :meth:`write`.

        Raises:
            StartError: the folder cannot be used; the message says what to do.
            UnreadableJournalError: the file cannot be read, is damaged, or comes from another version.
        """
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            there = self._file.exists()
        except OSError as error:
            raise StartError(
                f"the journal {self._file} cannot be used: {error.strerror}; set journal.folder"
            ) from error
        return self._read_file() if there else None

    def _read_file(self) -> Memory:
        remedy = f"remove {self._file} and restart the agent"
        try:
            content = self._file.read_bytes()
            self._number, record = _newest_record(content)
            half = len(content) // 2
            # Blocks of an interrupted record have a higher number, which must not be used again.
            numbers = (*_block_numbers(content[:half]), *_block_numbers(content[half:]))
            self._begun = max(self._number, max((number for number in numbers if number), default=0))
            fields = {"format": FORMAT} | json.loads(record)
            # 0018: another version's record is never guessed; a person removes it after checking the robot.
            if fields["format"] == FORMAT:
                return Memory.model_validate_json(json.dumps(fields))
        except OSError as error:
            raise UnreadableJournalError(
                f"the journal cannot be read ({error.strerror}): {remedy}"
            ) from error
        except (ValueError, TypeError, RecursionError) as error:
            raise UnreadableJournalError(f"the journal is damaged: {remedy}") from error
        raise UnreadableJournalError(
            f"the journal is from another version of the agent: reinstall that version, or {remedy}"
        )

    def write(self, record: bytes) -> None:
        """Write a record: it survives the process on return, and a power failure after :meth:`sync`.

        Both methods block until the disk responds: call them outside the event loop's thread.

        Raises:
            OSError: the record could not be written; the old one is kept.
        """
        self._on_record(record)
        # An unused number for the half without the last record. With a used one, blocks of a failed record
        # and of this one would look like one record.
        number = self._begun + 1
        if (number - self._number) % 2 == 0:
            number += 1
        self._begun = number
        if not self._overwrite_record(number, record):
            self._make_file(number, record)
            self._number, self._made = number, True

    def sync(self) -> None:
        """Wait until the last record is on disk.

        Raises:
            OSError: the disk has failed, and may not have the record.
        """
        with self._file.open("rb", buffering=0) as file:
            # Not fsync: the file keeps its size, so the disk only has to write these bytes (0005).
            os.fdatasync(file.fileno())
        # A new file also needs its name on disk.
        if self._made:
            sync_folder(self._folder)
            self._made = False
        self._number = self._begun

    def _overwrite_record(self, number: int, record: bytes) -> bool:
        """Overwrite the older record; return False if the file is missing or too small."""
        with suppress(FileNotFoundError), self._file.open("r+b", buffering=0) as file:
            half = os.fstat(file.fileno()).st_size // 2
            if len(record) <= half // BLOCK * (BLOCK - LABEL):
                # Measured (0005): durable in 0.4 ms, where a new file in place of the old one takes 1 ms.
                if os.pwrite(file.fileno(), _frame_record(number, record, half), number % 2 * half) < half:
                    raise OSError(errno.EIO, "the disk took only a part of the record")
                return True
        return False

    def _make_file(self, number: int, record: bytes) -> None:
        # Room to grow: an order that is extended must not need a new file for each update.
        half = max(MINIMUM_RECORD_SPACE, 1 << (2 * len(record)).bit_length())
        halves = [b" " * half, b" " * half]
        halves[number % 2] = _frame_record(number, record, half)
        new = self._file.with_suffix(".new")
        with new.open("wb") as file:
            file.write(b"".join(halves))
            file.flush()
            os.fsync(file.fileno())
        # A file is replaced at once or not at all: a crash leaves the old one.
        new.replace(self._file)


def record_of(memory: Memory) -> bytes:
    """Return the record of a memory."""
    return memory.model_dump_json(exclude_defaults=True).encode()


def read_journal(journal: Journal | None) -> tuple[Memory | None, str]:
    """Return the memory in ``journal``, if any, and the reason why it cannot be read, or "".

    Raises:
        StartError: the folder cannot be used; the message says what to do.
    """
    try:
        # 0018: the agent starts even so, because its state tells fleet control of the loss.
        return (journal.read() if journal else None), ""
    except UnreadableJournalError as error:
        return None, str(error)


def _frame_record(number: int, record: bytes, size: int) -> bytes:
    """Return a record as blocks, ``size`` bytes in total, each with its checksum and the record's number."""
    room, count = BLOCK - LABEL, size // BLOCK
    parts = (record[start : start + room].ljust(room) for start in range(0, count * room, room))
    bodies = (b"%013d %b" % (number, part) for part in parts)
    return b"".join(b"%08x %b" % (crc32(body, count), body) for body in bodies)


def _newest_record(content: bytes) -> tuple[int, bytes]:
    """Return the number and content of the last complete record, without an interrupted one after it.

    Raises:
        ValueError: there is none, or the last one is damaged.
    """
    half = len(content) // 2
    halves = content[:half], content[half:]
    records = [_read_half(record) for record in halves]
    newest = max(record for record in records if record)
    index = records.index(newest)
    if None in records and not _is_of_an_earlier_release(halves[index]):
        # The other half is older or was interrupted if an older block is left in it. Otherwise it was a
        # complete, newer record, which is damaged now: what it told was already acted upon.
        numbers = _block_numbers(halves[1 - index])
        if None in numbers and not any(number is not None and number <= newest[0] for number in numbers):
            raise ValueError(f"a record after {newest[0]} is damaged")
    return newest


def _blocks_of(half: bytes) -> list[bytes]:
    return [half[start : start + BLOCK] for start in range(0, len(half), BLOCK)]


def _block_numbers(half: bytes) -> list[int | None]:
    """Return the record number of each block; 0 if the block was never written, None if it is damaged.

    A checksum also covers the count of blocks, so a truncated file counts as damaged.
    """
    blocks = _blocks_of(half)
    numbers: list[int | None] = []
    for block in blocks:
        body = block[CHECKSUM:]
        if block == b" " * BLOCK:
            numbers.append(0)
        elif len(block) == BLOCK and block[:CHECKSUM] == b"%08x " % crc32(body, len(blocks)):
            numbers.append(int(body[: LABEL - CHECKSUM]))
        else:
            numbers.append(None)
    return numbers


def _read_half(half: bytes) -> tuple[int, bytes] | None:
    """Return the number and the record in a half; None if it is not one complete record."""
    if _is_of_an_earlier_release(half):
        first, _, record = half[CHECKSUM:].partition(b"\n")
        return int(first), record
    numbers = set(_block_numbers(half))
    number = numbers.pop() if len(numbers) == 1 else None
    return (number, b"".join(block[LABEL:] for block in _blocks_of(half))) if number else None


def _is_of_an_earlier_release(half: bytes) -> bool:
    """Return whether ``half`` is a record with a single checksum."""
    return half[:CHECKSUM] == b"%08x " % crc32(half[CHECKSUM:])


def _file_name(robot: RobotKey) -> str:
    """Return the robot's unique file name: manufacturer, dot, serial number.

    Characters that the standard allows stay unchanged; all others are percent-encoded as in a URL.
    """
    manufacturer = quote(robot.manufacturer, safe=" ").replace(".", "%2E")
    return f"{manufacturer}.{quote(robot.serial_number, safe=' :')}"


def _expand_home(folder: Path) -> Path:
    """Replace ``~`` by the home directory; raises StartError if there is none."""
    try:
        return folder.expanduser()
    except RuntimeError as error:
        raise StartError(
            f"the journal's folder {folder} cannot be found: {error}; set journal.folder"
        ) from error


def check_frame(memory: Memory | None, frame: str) -> None:
    """Check that the coordinates in ``memory`` still mean the same positions.

    Raises:
        StartError: the coordinates mean other positions.
    """
    if memory is None or memory.frame == frame or not (memory.progress.nodes or memory.zone_sets):
        return
    order = f"order '{memory.progress.order_id}' is active"
    raise StartError(
        f"{order if memory.progress.nodes else 'zone sets are kept'} in another frame: map_transforms was "
        f"'{memory.frame}' and is '{frame}'; restore it, let the order end or delete the zone sets, then "
        "change it"
    )


INLINE_WAIT = 0.01
"""Maximum time that the event loop blocks for a write, seconds. The kernel usually accepts a record in
0.1 ms, which is faster than a switch to another task and back."""
WRITE_TIMEOUT = 2.0
"""Timeout for writing a record, seconds; a robot that must stop cannot wait longer."""

Version = tuple[object, ...]
"""A value that differs when the memory differs."""


class Recorder:
    """Writes records in a thread. If the disk fails or hangs, this is reported, and the robot continues.

    Call :meth:`write` before effects that need a record that survives the process, and :meth:`sync` before
    effects that need a record that survives a power failure.
    """

    def __init__(
        self,
        journal: Journal | None,
        version: Version,
        *,
        on_record: Callable[[str], None],
        wake: Callable[[], None],
    ) -> None:
        """Create the recorder of ``journal``; None: nothing is recorded.

        Args:
            journal: the journal.
            version: version of the journal's content.
            on_record: called after each record with the disk's problem, empty without one.
            wake: called when a disk that has hung responds: then the newest record can be written.
        """
        self._journal = journal
        self._durable: Version | None = version
        self._begun: Version | None = None
        self._written: Version | None = version
        self._on_record = on_record
        self._wake = wake
        self._record: asyncio.Future[None] | None = None
        self._deadline = 0.0
        self.seconds = Histogram(SHORT)
        """Seconds from the start of a record until it survives a power failure."""

    async def write(self, version: Version, memory: Callable[[], Memory]) -> None:
        """Start to write a changed memory; return when it survives the process, or the disk has failed."""
        if self._journal is None or version == self._durable:
            return
        if self._record is not None and not self._record.done():
            return  # the disk hangs: a newer record must not overtake an older one
        loop = asyncio.get_running_loop()
        self._begun, self._deadline = version, loop.time() + WRITE_TIMEOUT
        self._written = self._durable = None  # a failed record may have overwritten the previous one
        written: SimpleQueue[bool] = SimpleQueue()
        # Encoded here, not in the thread, whose core has none of these objects in its caches: measured, 6 %
        # less time from order to goal.
        self._record = loop.run_in_executor(None, _write_record, self._journal, record_of(memory()), written)
        self._record.add_done_callback(_consume_result)
        # Blocking on purpose: two switches of tasks take longer than the kernel usually does.
        try:
            outlives = written.get(timeout=INLINE_WAIT)
        except Empty:
            outlives = await asyncio.to_thread(_await_write, written, WRITE_TIMEOUT)
        self._written = version if outlives else None

    async def sync(self) -> None:
        """Wait until the record is on disk, or the disk has failed."""
        if self._record is None or self._begun is None:
            return
        version, self._begun = self._begun, None
        timeout = self._deadline - asyncio.get_running_loop().time()
        done, _ = await asyncio.wait((self._record,), timeout=max(0.0, timeout))
        if not done:
            self._record.add_done_callback(lambda _: self._wake())
            self._on_record("the disk does not answer")
        elif error := self._record.exception():
            self._on_record(str(error) or type(error).__name__)
        else:
            self._durable = version
            self.seconds.observe(asyncio.get_running_loop().time() - self._deadline + WRITE_TIMEOUT)
            self._on_record("")

    def has_written(self, version: Version) -> bool:
        """Return whether the changes in ``version`` survive the process; True without a journal."""
        return self._journal is None or version in (self._written, self._durable)

    def has_synced(self, version: Version) -> bool:
        """Return whether the changes in ``version`` survive a power failure; True without a journal."""
        return self._journal is None or version == self._durable


def _write_record(journal: Journal, record: bytes, written: SimpleQueue[bool]) -> None:
    """Write a record in a thread: report when the kernel has it, then wait for the disk."""
    outlives = False
    try:
        journal.write(record)
        outlives = True
    finally:
        written.put(outlives)
    journal.sync()


def _await_write(written: SimpleQueue[bool], seconds: float) -> bool:
    """Wait for the result of a write, at most ``seconds``; blocks its thread."""
    try:
        return written.get(timeout=seconds)
    except Empty:
        return False


def _consume_result(record: asyncio.Future[None]) -> None:
    """Consume the result of a record that is no longer awaited."""
    if not record.cancelled():
        record.exception()
