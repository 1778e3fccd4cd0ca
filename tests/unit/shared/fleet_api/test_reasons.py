from __future__ import annotations

import json
import re
from datetime import UTC, datetime

import pytest

from nena_shared.fleet_api.reasons import TEXTS, CodedReason, Reason, ReasonCode, explained, reason_of
from nena_shared.fleet_api.transport_order import HistoryEntry

R = ReasonCode
OFFLINE = Reason(R.IS_OFFLINE)


def test_a_reason_is_a_value() -> None:
    busy = Reason(R.RECHARGES, level=80)
    assert busy == Reason(R.RECHARGES, level=80) != Reason(R.RECHARGES, level=90)
    assert len({busy, Reason(R.RECHARGES, level=80), Reason(R.ROBOT, busy), Reason(R.BUSY)}) == 3


def test_a_reason_has_a_text_and_a_code() -> None:
    reason = Reason(R.BUT, Reason(R.TRAVELS, vehicle="V1", number=1, total=2), Reason(R.ROBOT, OFFLINE))
    assert str(reason) == f"robot V1 travels to destination 1 of 2, but the robot {OFFLINE}"
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
    assert str(reason) == "held by Ann since 2026-03-01 08:30:00 UTC: spill"
    assert reason.coded.values == {"by": "Ann", "since": "2026-03-01T08:30:00.000Z"}
    assert reason.coded.causes == (CodedReason(code="words", values={"text": "spill"}),)


@pytest.mark.parametrize(
    ("reason", "text"),
    [
        (Reason(R.WAITS_FOR_ANY_VEHICLE, "A", "B"), "waits for a robot: each of them A or B"),
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
    assert str(reason) == text


def test_a_reason_is_read_from_its_code() -> None:
    reason = Reason(R.HELD, Reason(R.ROBOT, OFFLINE), by="O'Hara", since=datetime(2026, 3, 1, tzinfo=UTC))
    sent = CodedReason.model_validate_json(reason.coded.model_dump_json(by_alias=True))
    assert Reason.of("by a version with other words", sent) == reason
    assert reason.is_sent_as(sent)
    assert not OFFLINE.is_sent_as(sent)
    assert not OFFLINE.is_sent_as(None)
    newer = CodedReason(code="but", causes=(CodedReason(code="of_a_newer_version"),))
    assert Reason.of("its text", newer) == Reason.of("its text") == Reason(R.WORDS, text="its text")


def test_words_of_a_host_have_a_code_only_if_they_are_a_text_of_nena() -> None:
    assert Reason.of("spill").coded == CodedReason(code="words", values={"text": "spill"})
    assert Reason.of("withdrawn at the control panel").coded == CodedReason(code="withdrawn_at_panel")


def test_fields_of_a_status() -> None:
    assert explained(OFFLINE) == {"reason": str(OFFLINE), "coded_reason": OFFLINE.coded}
    assert type(explained(OFFLINE)["reason"]) is str
    assert explained(None) == explained("") == {"reason": "", "coded_reason": None}


def test_reason_of_an_error() -> None:
    assert reason_of(ValueError(OFFLINE)) is OFFLINE
    assert reason_of(ValueError("bad", 3)).coded.code == "words"


@pytest.mark.parametrize("language", ["en", "de", "nl"])
def test_every_code_has_a_text_with_the_same_values_in_every_language(language: str) -> None:
    """Otherwise the panel shows the English sentence instead, and hosts get none."""

    def values_of(table: str) -> dict[str, list[str]]:
        texts: dict[str, str] = json.loads((TEXTS / f"{table}.json").read_text(encoding="utf-8"))
        assert all(text.strip() for text in texts.values())
        return {code: sorted(re.findall(r"\{(\w+)\}", text)) for code, text in texts.items()}

    assert values_of(language) == values_of("en")
    assert values_of(language).keys() == {*ReasonCode, "or"}


@pytest.mark.parametrize("values", [{"names": ["a"]}, {"x": None}, 3])
def test_a_code_that_cannot_be_read_is_left_out(values: object) -> None:
    """A newer order service may send it; its text and the rest of the status count."""
    entry = {"timestamp": "2026-01-01T00:00:00Z", "eventCode": "nena:new", "supplements": ["why"]}
    read = HistoryEntry.model_validate(entry | {"codedReason": {"code": "new", "values": values}})
    assert (read.supplements, read.coded_reason) == (("why",), None)
