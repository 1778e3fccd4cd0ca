"""A simulated peripheral device, such as a door: executes each job once, after some seconds.

An example for authors of real devices: it answers a job that it already has by its last answer, so that the
order service may ask again at any time.
"""

from __future__ import annotations

import argparse
import asyncio
from collections import OrderedDict
from typing import Final

from pydantic import BaseModel

from nena_shared.fleet_api.peripherals import (
    DeviceAnswer,
    DeviceCancellation,
    DeviceJobState,
    DeviceReport,
    DeviceRequest,
    PeripheralState,
)
from nena_shared.fleet_api.topics import FleetTopics, PeripheralTopic
from nena_shared.mqtt import Inbound, LinkHooks, MqttLink, Outbound
from nena_shared.settings import MqttSettings, ShowVersion

JOBS_KEPT: Final = 1000
"""Number of jobs whose answers are kept."""


class SimulatedPeripheral:
    """A device that finishes every job ``seconds`` after it was asked."""

    def __init__(self, location: str, broker: MqttSettings, topics: FleetTopics, *, seconds: float) -> None:
        self.executed: list[str] = []
        """The operations that it has executed, in order."""
        self._location = location
        self._topics = topics
        self._seconds = seconds
        self._answers: OrderedDict[str, DeviceAnswer] = OrderedDict()
        self._running: dict[str, asyncio.TimerHandle] = {}
        client_id = f"nena-peripheral-{location}"
        self.link = MqttLink(broker, client_id=client_id, hooks=LinkHooks(self._will, self._greeting))
        self.link.subscribe(topics.peripheral(location, PeripheralTopic.JOB), self._accept_job)
        self.link.subscribe(topics.peripheral(location, PeripheralTopic.CANCEL), self._cancel_job)

    def _accept_job(self, message: Inbound) -> None:
        request = DeviceRequest.model_validate_json(message.payload)
        if known := self._answers.get(request.job_id):
            self._publish_body(PeripheralTopic.JOB_STATE, known)
            return
        self._answer_job(request.job_id, DeviceJobState.ACKNOWLEDGED)
        loop = asyncio.get_running_loop()
        self._running[request.job_id] = loop.call_later(self._seconds, self._finish_job, request)
        self._report_state()

    def _finish_job(self, request: DeviceRequest) -> None:
        del self._running[request.job_id]
        self.executed.append(request.operation)
        self._answer_job(request.job_id, DeviceJobState.FINISHED)
        self._report_state()

    def _cancel_job(self, message: Inbound) -> None:
        job_id = DeviceCancellation.model_validate_json(message.payload).job_id
        if timer := self._running.pop(job_id, None):
            timer.cancel()
            self._answer_job(job_id, DeviceJobState.FAILED, "cancelled")
            self._report_state()

    def _answer_job(self, job_id: str, state: DeviceJobState, reason: str = "") -> None:
        answer = self._answers[job_id] = DeviceAnswer(job_id=job_id, state=state, reason=reason)
        if len(self._answers) > JOBS_KEPT:
            self._answers.popitem(last=False)
        self._publish_body(PeripheralTopic.JOB_STATE, answer)

    def _report_state(self) -> None:
        self.link.publish(self._state_message())

    def _state_message(self) -> Outbound:
        state = PeripheralState.EXECUTING if self._running else PeripheralState.IDLE
        return self._message_of(PeripheralTopic.STATE, DeviceReport(state=state), retain=True)

    def _will(self) -> Outbound:
        return self._message_of(
            PeripheralTopic.STATE, DeviceReport(state=PeripheralState.UNAVAILABLE), retain=True
        )

    def _greeting(self) -> tuple[Outbound, ...]:
        return (self._state_message(),)

    def _publish_body(self, topic: PeripheralTopic, body: BaseModel) -> None:
        self.link.publish(self._message_of(topic, body))

    def _message_of(self, topic: PeripheralTopic, body: BaseModel, *, retain: bool = False) -> Outbound:
        payload = body.model_dump_json(by_alias=True).encode()
        return Outbound(self._topics.peripheral(self._location, topic), payload, retain=retain)


async def _simulate_devices(options: argparse.Namespace) -> None:
    broker, topics = MqttSettings(host=options.host, port=options.port), FleetTopics(options.prefix)
    devices = [
        SimulatedPeripheral(location, broker, topics, seconds=options.seconds)
        for location in options.locations
    ]
    await asyncio.gather(*(device.link.run() for device in devices))


def main() -> None:
    """Simulate peripheral devices until interrupted."""
    parser = argparse.ArgumentParser(
        prog="nena-demo-peripheral", description="Simulate peripheral devices, such as doors, over MQTT."
    )
    parser.add_argument("-V", "--version", action=ShowVersion, program=parser.prog, distribution="nena-demo")
    parser.add_argument("locations", nargs="+", metavar="LOCATION", help="Location of a device.")
    parser.add_argument("--host", default="127.0.0.1", help="Address of the MQTT broker.")
    parser.add_argument("--port", type=int, default=1883, help="Port of the MQTT broker.")
    parser.add_argument("--prefix", default="nena/v1", help="topic_prefix of the order service.")
    parser.add_argument("--seconds", type=float, default=5.0, help="Duration of an operation, seconds.")
    try:
        asyncio.run(_simulate_devices(parser.parse_args()))
    except KeyboardInterrupt:
        return
