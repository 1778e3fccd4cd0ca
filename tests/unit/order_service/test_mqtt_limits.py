from __future__ import annotations

from nena_order_service.api.mqtt import REQUESTS_LIMIT, MqttLimits
from nena_order_service.settings import HostSettings
from nena_shared.clock import ManualClock


def statuses(limits: MqttLimits, *hosts: str, in_work: int = 0) -> list[int | None]:
    told = [limits.refusal(host, in_work) for host in hosts]
    return [problem.status if problem else None for problem in told]


def test_each_host_has_a_rate_of_its_own_and_may_go_on_in_time() -> None:
    clock = ManualClock()
    limits = MqttLimits(HostSettings(requests_per_second=2.0, burst=2), clock)

    assert statuses(limits, "wms", "wms", "wms", "mes") == [None, None, 429, None]
    refused = limits.refusal("wms", 0)
    assert refused
    assert refused.detail == "Too many requests. Ask again in 0.5 s."

    clock.seconds += 0.5
    assert statuses(limits, "wms", "wms") == [None, 429]


def test_so_many_may_be_in_work_and_one_more_is_told_to_wait() -> None:
    limits = MqttLimits(HostSettings(), ManualClock())

    assert statuses(limits, "wms", in_work=REQUESTS_LIMIT - 1) == [None]
    assert statuses(limits, "wms", in_work=REQUESTS_LIMIT) == [503]
