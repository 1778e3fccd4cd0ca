"""What needs a person: each condition of the table, and what people and time change."""

from __future__ import annotations

from datetime import timedelta

import pytest

from nena_shared.fleet_api.attention import Acknowledgement, MatterKind, advice_on
from nena_shared.fleet_api.service_status import LOST_AFTER
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.fleet.robot import Timestamp
from nena_status_aggregator.settings import JamSettings
from support.clocks import ManualClock
from support.fleet_examples import START, power
from support.matters import CONDITIONS, OWN, Condition, ModelSite, emergency

LIMITS = ModelLimits(jam=JamSettings(robots=2, seconds=1), silence=3600)


def make_site(limits: ModelLimits = LIMITS) -> ModelSite:
    return ModelSite(FleetModel(limits), ManualClock(start=START))


@pytest.mark.parametrize("condition", CONDITIONS, ids=lambda each: each.name)
def test_condition_is_in_the_list_within_five_seconds(condition: Condition) -> None:
    site = make_site()
    condition.arrange(site)
    site.wait(5)
    found = {matter.id: matter for matter in site.list()}
    assert set(found) == set(condition.matters)
    if condition.matters:
        first = found[condition.matters[0]]
        held = (condition.robots, condition.orders)
        counted = (first.robot_count, first.order_count)
        assert counted == held
        assert site.now - first.since <= timedelta(seconds=5)
        assert first.reason
        assert first.advice


def test_all_conditions_together_are_the_sum_of_each() -> None:
    site = make_site()
    for each in OWN:
        each.arrange(site)
    site.wait(5)
    assert site.ids() == {name for each in OWN for name in each.matters}


def test_what_is_past_leaves_the_list() -> None:
    site = make_site()
    site.robot("Hit", **emergency("MANUAL"))
    assert site.ids() == {"emergency_stop:Hit"}
    site.clock.advance(1)
    site.robot("Hit")
    assert site.ids() == set()


def test_acknowledged_matter_is_the_last_of_its_severity_and_is_new_when_it_returns() -> None:
    site = make_site()
    site.robot("Hit", **emergency("MANUAL"))
    site.order("Failed", TransportOrderState.FAILED, finished=site.now)
    site.robot("Weak", **power(12.0))
    registry = site.model.attention
    warning = "battery_low:Weak"
    assert [each.id for each in site.list()] == ["emergency_stop:Hit", "order_failed:Failed", warning]
    assert registry.acknowledge("emergency_stop:Hit", "Anna", site.now)
    assert registry.acknowledge("emergency_stop:Hit", "Ben", site.now)
    assert registry.acknowledge("emergency_stop:Other", "Ben", site.now) is None
    site.wait(2)
    assert [each.id for each in site.list()] == ["order_failed:Failed", "emergency_stop:Hit", warning]
    done = site.list()[1].acknowledged
    assert done
    assert done.by == "Anna"

    site.robot("Hit")
    site.wait(1)
    site.robot("Hit", **emergency("MANUAL"))
    site.wait(1)
    assert [each.acknowledged for each in site.list()] == [None, None, None]


def test_each_change_is_told_once() -> None:
    told: list[tuple[str, str]] = []
    model = FleetModel(LIMITS, on_matter=lambda change, matter: told.append((change.value, matter.id)))
    site = ModelSite(model, ManualClock(start=START))
    site.robot("Hit", **emergency("MANUAL"))
    site.wait(2)
    assert told == [("began", "emergency_stop:Hit")]
    for name in ("Anna", "Ben"):
        site.model.attention.acknowledge("emergency_stop:Hit", name, site.now)
    site.wait(2)
    site.robot("Hit")
    site.wait(2)
    assert told[1:] == [("acknowledged", "emergency_stop:Hit"), ("ended", "emergency_stop:Hit")]


def test_restored_acknowledgement_is_that_of_the_same_matter_and_goes_with_it() -> None:
    site = make_site()
    registry = site.model.attention
    done = Acknowledgement(by="Anna", at=START)
    names = ("emergency_stop:Hit", "jam:Gone", "order_failed:Failed")
    registry.restore(dict.fromkeys(names, done), site.now + timedelta(seconds=60))
    site.robot("Hit", **emergency("MANUAL"))
    site.wait(30)
    assert [each.acknowledged for each in site.list()] == [done]
    site.order("Failed", TransportOrderState.FAILED, finished=site.now)
    site.wait(31)
    assert set(registry.acknowledged) == {"emergency_stop:Hit", "order_failed:Failed"}
    site.robot("Hit")
    site.wait(1)
    assert set(registry.acknowledged) == {"order_failed:Failed"}


def test_protective_field_is_a_matter_only_if_it_stays_violated() -> None:
    site = make_site()
    site.robot("Stands", safety_state={"active_emergency_stop": "NONE", "field_violation": True})
    site.wait(8)
    assert site.ids() == set()
    site.wait(4)
    assert site.ids() == {"protective_field:Stands"}


def test_silent_order_service_is_in_the_list_within_five_seconds_of_its_last_heartbeat() -> None:
    site = make_site()
    site.robot("Idle")
    site.service()
    site.wait(5, beating=False)
    (found,) = site.list()
    assert (found.kind, found.robots, found.urgent) == (MatterKind.ORDER_SERVICE_DOWN, ("Idle",), True)
    assert LOST_AFTER < 5


def test_paths_that_a_person_locks_in_one_go_are_one_matter() -> None:
    site = make_site()
    began = site.now - timedelta(hours=1)
    late = began + timedelta(minutes=5)
    locks = {"C": ("Anna", began), "B": ("Anna", began + timedelta(seconds=8))}
    locks |= {"A": ("Anna", began + timedelta(seconds=16)), "D": ("Ben", began), "E": ("Anna", late)}
    known = {path: {"by": by, "since": since} for path, (by, since) in locks.items()}
    site.service(locked_paths=(*sorted(locks), "F", "G"), locked_by=known)
    found = {each.paths: each for each in site.list()}
    assert set(found) == {("C", "B", "A"), ("D",), ("E",), ("F",), ("G",)}
    matter = found["C", "B", "A"]
    assert (matter.id, matter.since) == ("path_locked:C", began)
    assert matter.reason == "These paths are locked by Anna: C, B, A"


def test_without_the_broker_only_that_is_new() -> None:
    site = make_site()
    site.robot("Hit", **emergency("MANUAL"))
    site.robot("Idle")
    site.service(locked_paths=("A --- B",))
    site.wait(1)
    site.model.on_link(connected=False, at=Timestamp.of(site.clock))
    site.wait(1, beating=False)
    known = {"emergency_stop:Hit", "path_locked:A --- B"}
    assert site.ids() == known
    site.wait(3600, beating=False)
    assert site.ids() == {"broker_lost", *known}, "nobody knows that they have ended"
    site.model.on_link(connected=True, at=Timestamp.of(site.clock))
    assert site.ids() >= known, "what the broker retains has not arrived yet"
    site.service()
    site.wait(1)
    assert site.ids() == {"robot_silent:Hit", "robot_silent:Idle"}


def test_silent_robot_and_old_failure() -> None:
    site = make_site(ModelLimits(silence=10))
    site.robot("Mute")
    site.order(
        "Failed", TransportOrderState.FAILED, finished=site.now - timedelta(hours=7, minutes=59, seconds=55)
    )
    assert site.ids() == {"order_failed:Failed"}
    site.wait(12)
    assert site.ids() == {"robot_silent:Mute"}


def test_offline_robot_for_which_an_order_waits_holds_it_up() -> None:
    site = make_site()
    site.robot("Off")
    site.connection("Off", "OFFLINE")
    assert site.ids() == set()
    site.order("T-1", TransportOrderState.DISPATCHABLE, processing_vehicle=None, intended_vehicle="Off")
    site.wait(1)
    (found,) = site.list()
    assert (found.id, found.orders) == ("robot_offline:Off", ("T-1",))


def test_every_kind_says_what_to_do() -> None:
    assert all(advice_on(kind, "X") for kind in MatterKind)
