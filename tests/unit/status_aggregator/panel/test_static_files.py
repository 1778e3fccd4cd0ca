"""The page's files by themselves: nothing inline, nothing from elsewhere, no words outside the catalogue."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from nena_order_service.orders.transport_order import EventCode
from nena_shared.fleet_api.audit import AuditResult
from nena_shared.fleet_api.peripherals import PeripheralJobState, PeripheralState
from nena_shared.fleet_api.reasons import TEXTS as REASONS
from nena_shared.fleet_api.transport_order import (
    DependencyFailure,
    DriveOrderState,
    FailureMeasure,
    TransportOrderState,
)
from nena_shared.fleet_api.vehicle import IntegrationLevel
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorLevel
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.zone_set import ZoneType
from nena_status_aggregator.api.app import PANEL
from nena_status_aggregator.extensions.reports.report import FailureKind
from nena_status_aggregator.fleet.condition import TEXTS, URGENT, Condition, SessionState
from nena_status_aggregator.fleet.events import Code

LANGUAGES = ("en", "nl", "de")
ENTRY = re.compile(r'^  "([\w.:]+)":\s+"((?:[^"\\]|\\.)*)",$', re.MULTILINE)


def texts(language: str) -> dict[str, str]:
    source = (PANEL / "texts" / f"{language}.js").read_text(encoding="utf-8")
    found = dict(ENTRY.findall(source))
    assert len(found) == source.count('",\n'), "a text that is not one line under its key"
    return found


KEYS = set(texts("en"))


@pytest.mark.parametrize("path", sorted(PANEL.rglob("*.*")), ids=lambda path: path.name)
def test_all_content_is_from_this_host(path: Path) -> None:
    foreign = re.findall(r"https?://[^\s\"')]+", path.read_text(encoding="utf-8"))
    assert [each for each in foreign if each != "http://www.w3.org/2000/svg"] == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_language_has_every_text_with_the_same_values(language: str) -> None:
    def values(text: str) -> list[str]:
        return sorted(re.findall(r"\{\w+\}", text))

    english, other = texts("en"), texts(language)
    assert set(other) == set(english)
    assert {key for key in english if values(english[key]) != values(other[key])} == set()
    assert all(text.strip() for text in other.values())


OTHER_WORD = {"en": "vehicle", "de": "fahrzeug", "nl": "voertuig"}
"""What stands on the floor is a robot; openTCS and the interfaces of integrators say vehicle."""
DEVELOPERS = re.compile(r"--\w|\b(?:HTTP|REST|JSON|PUT|POST|GET|[A-Z]+_[A-Z_]+|[a-z]+_[a-z_]+|[45]\d\d)\b")
FILE_FORMATS = {"period.jsonl", "plant.mapFiles", "period.json"}


@pytest.mark.parametrize("language", LANGUAGES)
def test_texts_say_robot_and_no_words_of_developers(language: str) -> None:
    reasons = json.loads((REASONS / f"{language}.json").read_text(encoding="utf-8"))
    said = {key: re.sub(r"\{\w+\}", "", text) for key, text in {**texts(language), **reasons}.items()}
    assert {key for key, text in said.items() if OTHER_WORD[language] in text.lower()} == set()
    assert {key for key, text in said.items() if DEVELOPERS.search(text)} - FILE_FORMATS == set()


def test_every_code_has_a_text() -> None:
    wanted = {f"condition.{each}" for each in Condition}
    wanted |= {f"state.{each}" for each in TransportOrderState}
    wanted |= {f"state.{each}" for each in PeripheralJobState}
    wanted |= {f"peripheral.{each}" for each in PeripheralState}
    wanted |= {f"why.order.{each}" for each in TransportOrderState}
    wanted |= {f"drive.{each}" for each in DriveOrderState}
    wanted |= {f"connection.{each}" for each in ConnectionState}
    wanted |= {f"session.{each}" for each in SessionState}
    wanted |= {f"mode.{each}" for each in OperatingMode}
    wanted |= {f"level.{each}" for each in ErrorLevel}
    wanted |= {f"action.{each}" for each in ActionStatus}
    wanted |= {f"eventLog.{each}" for each in Code}
    wanted |= {f"reason.{each}" for each in TEXTS if each != "emergency_stop"}
    wanted |= {f"measure.{each}" for each in FailureMeasure if not each.last}
    wanted |= {f"policy.{each}" for each in FailureMeasure}
    wanted |= {f"dependency.{each}" for each in DependencyFailure}
    wanted |= {f"urgent.{each}" for each in URGENT}
    wanted |= {f"zone.{each}" for each in ZoneType}
    wanted |= {f"integration.{each}" for each in IntegrationLevel}
    wanted |= {f"event.{each}" for each in EventCode}
    wanted |= {f"audit.{each}" for each in AuditResult}
    wanted |= {f"reports.kind.{each}" for each in FailureKind}
    wanted |= {f"reports.cause.{each}" for each in TEXTS if each.startswith("wait")}
    assert wanted - KEYS == set()


@pytest.mark.parametrize(
    "path", sorted({*PANEL.glob("*.js"), *PANEL.glob("plant/*.js")}), ids=lambda path: path.name
)
def test_every_text_and_column_title_exists(path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    columns = re.findall(r'"([\w.:]+)"', " ".join(re.findall(r"columns = \[(.*?)\]", source, re.DOTALL)))
    assert {*columns, *re.findall(r'\bt\("(?!because\.)([\w.:]+)"', source)} - KEYS == set()
