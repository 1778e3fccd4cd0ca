"""Settings of peripheral devices."""

from __future__ import annotations

from pydantic import Field

from nena_shared.settings import SettingsGroup


class PeripheralSettings(SettingsGroup):
    """Peripheral devices, such as doors and lifts, over MQTT."""

    enabled: bool = Field(
        default=False,
        description="Execute the peripheral operations of paths and destinations. false: they are ignored, "
        "and robots do not wait for devices. See docs/peripherals.md.",
    )
    acknowledge_timeout: float = Field(
        5.0,
        gt=0,
        description="Time for a device to acknowledge a job, seconds; then the job is sent again.",
    )
    sends: int = Field(
        6, ge=1, le=1000, description="Times that an unacknowledged job is sent; then it has failed."
    )
    execution_timeout: float = Field(
        60.0,
        gt=0,
        description="Time from a device's acknowledgement to the end of the job, seconds; then the job has "
        "failed. The location property `nena:executionTimeout` overrides it.",
    )
