"""The audit trail: who changed what, in rows that are chained by hashes.

Each row contains the SHA-256 of the previous row's hash and of its own fields, so a row that is changed,
removed, inserted or moved later no longer fits its neighbours. :class:`ChainCheck` finds the first such row.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from enum import StrEnum
from typing import Annotated, Final, Self

from pydantic import ConfigDict, Field

from nena_shared.fleet_api.base import Moment, Resource

ANONYMOUS: Final = "anonymous"
"""User of requests while no login is required."""

GENESIS: Final = "0" * 64
"""Hash before the first row."""

HASH: Final = "hash"


class AuditInterface(StrEnum):
    """The API by which a request arrived."""

    REST = "REST"
    MQTT = "MQTT"
    OPENTCS = "openTCS"


class AuditResult(StrEnum):
    """The result of a request."""

    DONE = "DONE"
    """Executed, or without effect because it was executed before."""
    REFUSED = "REFUSED"
    FAILED = "FAILED"
    """Ended by an internal error or a restart; it may have had an effect."""


class AuditEntry(Resource):
    """One changing request."""

    model_config = ConfigDict(extra="allow")  # fields of newer releases also count for the hash

    sequence: int
    """Number of the row, from 1, without gaps."""
    timestamp: Moment
    user: str
    """REST: user of the token, or ``anonymous``. MQTT: name of the host in the topic."""
    interface: AuditInterface
    client: str
    """User-Agent of REST clients, as sent: not verified."""
    operation: str
    """Name of the operation; method and path for routes that only openTCS's web API has."""
    object_kind: str
    object: str
    """Name of the object; empty for none."""
    request: str
    """Body of the request as JSON, with secrets masked; cut if long."""
    before: str
    """State of the object before the request, as JSON; empty if unknown."""
    after: str
    """State of the object after the request, as JSON; empty if unknown."""
    result: AuditResult
    reason: str
    """Why the request was refused or failed; empty if it was executed."""
    hash: str
    """SHA-256 over the previous row's hash and this row, in hex; see :func:`hash_after`."""

    def fits(self, previous: str) -> bool:
        """Return whether the row has the hash that its fields have after the row with hash ``previous``."""
        return self.hash == hash_after(previous, self.model_dump(mode="json", by_alias=True))


def hash_after(previous: str, row: Mapping[str, object]) -> str:
    """Return the hash of a row, given as in JSON; its own ``hash`` and empty fields do not count."""
    # without empty fields, a field that a newer release adds does not change the hash of older rows
    fields = {name: value for name, value in row.items() if value not in (None, "") and name != HASH}
    # 0055: texts and one number only, so that this form is the same in any language
    text = json.dumps(fields, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(f"{previous}\n{text}".encode()).hexdigest()


class AuditMark(Resource):
    """A row, named by number and hash."""

    model_config = ConfigDict(frozen=True)

    sequence: int = 0
    hash: str = GENESIS

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``SEQUENCE:HASH``; raises ValueError."""
        sequence, _, hash_ = text.partition(":")
        if not sequence.isdecimal() or len(hash_) != len(GENESIS):
            raise ValueError(f"Invalid row {text!r}: use SEQUENCE:HASH, as printed by nena audit verify")
        return cls(sequence=int(sequence), hash=hash_)

    def __str__(self) -> str:
        return f"{self.sequence}:{self.hash}"


class AuditFilter(Resource):
    """Filter of the audit trail."""

    user: Annotated[str, Field(max_length=200)] | None = None
    operation: Annotated[str, Field(max_length=200)] | None = None
    object: Annotated[str, Field(max_length=200)] | None = None
    """Name of the object."""
    result: AuditResult | None = None
    since: Moment | None = None
    """Only rows of this time or later."""
    until: Moment | None = None
    """Only rows before this time."""
    oldest_first: bool = False


class AuditQuery(AuditFilter):
    """Filter and page of the audit trail."""

    limit: Annotated[int, Field(ge=1, le=1000)] = 100
    after: Annotated[str, Field(pattern=r"^[0-9]{1,18}$")] | None = None


class AuditPage(Resource):
    """A page of the audit trail, newest first unless ``oldestFirst`` is set."""

    entries: tuple[AuditEntry, ...]
    next: str | None
    """Value of ``after`` for the next page; None: this is the last one."""
    deleted: AuditMark
    """The last row that was deleted because of its age; the chain begins after it."""
    last: AuditMark
    """The last row that was written."""


class ChainCheck:
    """Checks an audit trail, in pages that begin with the oldest rows."""

    def __init__(self, expected: AuditMark | None = None) -> None:
        """``expected`` is a row that is known from an earlier check."""
        self.rows = 0
        """Number of checked rows."""
        self.last = AuditMark()
        """The last checked row."""
        self._expected = expected

    def problems(self, page: AuditPage) -> Iterator[str]:
        """Check the next page; yield what is wrong, the oldest first."""
        expected, deleted = self._expected, page.deleted
        if deleted.sequence > self.last.sequence:
            if expected and self.last.sequence < expected.sequence < deleted.sequence:
                yield (
                    f"row {expected.sequence} cannot be compared: rows up to {deleted.sequence} were deleted "
                    "because of their age; expect a newer one"
                )
            elif expected and expected.sequence == deleted.sequence and expected.hash != deleted.hash:
                yield (
                    f"row {deleted.sequence}, which was deleted because of its age, is not the expected one"
                )
            self.last = deleted
        for entry in page.entries:
            yield from self._problems_of(entry)
            self.rows += 1
            self.last = AuditMark(sequence=entry.sequence, hash=entry.hash)
        if page.next is None:
            yield from self._problems_at_end(page.last)

    def _problems_of(self, entry: AuditEntry) -> Iterator[str]:
        number, due, expected = entry.sequence, self.last.sequence + 1, self._expected
        if number > due:
            which = f"row {due} is" if number == due + 1 else f"rows {due} to {number - 1} are"
            yield f"{which} missing: row {number} follows row {due - 1}"
        elif number < due:
            yield f"row {number} is out of order: it follows row {due - 1}"
        elif not entry.fits(self.last.hash):  # behind a gap, the hash says nothing
            yield (
                f"row {number} ({entry.operation} by {entry.user}, {entry.timestamp:%Y-%m-%d %H:%M:%S} UTC) "
                "does not have the hash of its content: it was changed, or the row before it was replaced"
            )
        if expected and number == expected.sequence and entry.hash != expected.hash:
            yield f"row {number} is not the expected one: its hash is {entry.hash}"

    def _problems_at_end(self, last: AuditMark) -> Iterator[str]:
        # somebody who can delete the newest rows can lower ``last``, too, but not what an auditor has noted
        expected = self._expected.sequence if self._expected else 0
        first, end = self.last.sequence + 1, max(last.sequence, expected)
        if first <= end:
            which = f"row {first} is" if first == end else f"rows {first} to {end} are"
            yield f"{which} missing: the trail ends with row {first - 1}"
        elif self.last.sequence == last.sequence and self.last.hash != last.hash:
            yield f"row {last.sequence} was replaced: the row that was written last has the hash {last.hash}"
