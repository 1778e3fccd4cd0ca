from __future__ import annotations

import re
from datetime import UTC, datetime

import pytest

from nena_shared.fleet_api.reasons import NOTED, CodedReason, Reason, ReasonCode, explained, reason_of
from nena_shared.fleet_api.transport_order import HistoryEntry

R = ReasonCode
OFFLINE = Reason(R.IS_OFFLINE)


def test_a_reason_is_its_text_and_keeps_its_code() -> None:
    reason = Reason(R.BUT, Reason(R.TRAVELS, vehicle="V1", number=1, total=2), Reason(R.ROBOT, OFFLINE))
    assert reason == f"vehicle V1 travels to destination 1 of 2, but the robot {OFFLINE}"
    assert reason.coded.model_dump() == {
        "code": "but",
        "values": {},
        "causes": (
            {"code": "travels", "values": {"vehicle": "V1", "number": 1, "total": 2}, "causes": ()},
            {
                "code": "robot",
                "values": {},
                "causes": ({"code": "is_offline", "values": {}, "causes": ()},),
            },
        ),
    }


def test_times_are_sent_in_iso_8601() -> None:
    since = datetime(2026, 3, 1, 8, 30, tzinfo=UTC)
    reason = Reason(R.HELD, "spill", by="Ann", since=since)
    assert reason == "held by Ann since 2026-03-01 08:30:00 UTC: spill"
    assert reason.coded.values == {"by": "Ann", "since": "2026-03-01T08:30:00.000Z"}
    assert reason.coded.causes == (CodedReason(code="words", values={"text": "spill"}),)


@pytest.mark.parametrize(
    ("reason", "text"),
    [
        (Reason(R.WAITS_FOR_ANY_VEHICLE, "A", "B"), "waits for a vehicle: each of them A or B"),
        (Reason(R.ALL, "A", "B"), "A; B"),
        (Reason(R.BUT, "A", "B", "C"), "A, but B; C"),
        (Reason(R.PASSED_OVER, "A", "B", "C"), "A (B; C)"),
        (
            Reason(R.LOADED, Reason(R.AT_PLACE, place="fork")),
            "carries a load and has no room for another one at 'fork'",
        ),
    ],
)
def test_causes_are_joined(reason: Reason, text: str) -> None:
    assert reason == text


def test_a_text_that_was_stored_with_its_code_keeps_both() -> None:
    sent = CodedReason.model_validate_json(OFFLINE.coded.model_dump_json(by_alias=True))
    stored = Reason.of("is offline", sent)  # by a version with other words
    assert (stored, stored.coded) == ("is offline", OFFLINE.coded)
    assert Reason.of(OFFLINE) is OFFLINE


def test_words_of_a_host_have_a_code_only_if_they_are_a_text_of_nena() -> None:
    assert Reason.of("spill").coded == CodedReason(code="words", values={"text": "spill"})
    assert Reason.of("withdrawn at the control panel").coded == CodedReason(code="withdrawn_at_panel")


def test_fields_of_a_status() -> None:
    assert explained(OFFLINE) == {"reason": str(OFFLINE), "coded_reason": OFFLINE.coded}
    assert type(explained(OFFLINE)["reason"]) is str
    assert explained("") == {"reason": "", "coded_reason": None}


def test_reason_of_an_error() -> None:
    assert reason_of(ValueError(OFFLINE)) is OFFLINE
    assert reason_of(ValueError("bad", 3)).coded.code == "words"


def test_codes_are_distinct_and_their_values_are_names() -> None:
    assert len(ReasonCode.__members__) == len(ReasonCode), "two codes with one text"
    assert len(NOTED) > 50
    names = {name for each in ReasonCode for name in re.findall(r"\{(\w*)", each.value)}
    assert "" not in names


@pytest.mark.parametrize("values", [{"names": ["a"]}, {"x": None}, 3])
def test_a_code_that_cannot_be_read_is_left_out(values: object) -> None:
    """A newer order service may send it; its text and the rest of the status count."""
    entry = {"timestamp": "2026-01-01T00:00:00Z", "eventCode": "nena:new", "supplements": ["why"]}
    read = HistoryEntry.model_validate(entry | {"codedReason": {"code": "new", "values": values}})
    assert (read.supplements, read.coded_reason) == (("why",), None)
