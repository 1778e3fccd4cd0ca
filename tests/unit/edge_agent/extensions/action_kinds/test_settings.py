"""Settings of charging and turn signals."""

from __future__ import annotations

from nena_edge_agent.extensions.action_kinds.settings import ChargeOperationSettings, TurnSignalSettings


def test_the_battery_confirms_charging_unless_configured_otherwise() -> None:
    begins = ChargeOperationSettings(kind="charge")
    ends = ChargeOperationSettings(kind="charge", action_type="stopCharging", charging=False)

    assert begins.confirmation.match == {"power_supply_status": [1, 4]}
    assert ends.confirmation.match == {"power_supply_status": [0, 2, 3]}
    assert TurnSignalSettings(kind="turn_signal").values["off"] == "off"
