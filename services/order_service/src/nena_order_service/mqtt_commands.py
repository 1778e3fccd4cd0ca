"""The MQTT door's commands: what hosts may ask for besides the creation of orders."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from typing import Any

from nena_order_service import vehicle_commands
from nena_order_service.api.problems import FORESEEN, problem_of
from nena_order_service.host_requests import ETag, HostServices
from nena_order_service.mqtt_command_bodies import (
    COMMANDS,
    AssignmentCommand,
    Command,
    CommandAnswer,
    CompleteSequenceCommand,
    CreateSequenceCommand,
    DeleteZoneSetCommand,
    DeliveryCommand,
    DispatchCommand,
    EnableZoneSetCommand,
    HoldCommand,
    InstantActionCommand,
    IntegrationLevelCommand,
    LockPathCommand,
    OrderTypesCommand,
    PutZoneSetCommand,
    RerouteCommand,
    ResumeCommand,
    SequenceCommand,
    SequencesCommand,
    WithdrawCommand,
)
from nena_order_service.mqtt_limits import MqttLimits
from nena_order_service.mqtt_requests import read_request, text_in
from nena_order_service.store.sequences import SequenceFilter
from nena_shared.fleet_api.requests import SOMEBODY, OrderSequencePage
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.transport_order import Problem
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.tasks import end

log = get_logger(__name__)


Verb = Callable[[Any], Awaitable[CommandAnswer]]
"""Does what a command asks for."""


class Verbs:
    """Does what commands ask for; each gives what REST would answer, and raises the same errors."""

    def __init__(self, hosts: HostServices) -> None:
        self._requests = hosts.requests
        self._sequences = hosts.sequences
        self._locks = hosts.locks
        self._zones = hosts.zones
        self.by_name: dict[str, Verb] = {
            "withdraw": self.withdraw,
            "hold": self.hold,
            "resume": self.resume,
            "delivery": self.delivery,
            "assignment": self.assignment,
            "dispatch": self.dispatch,
            "instantAction": self.instant_action,
            "lockPath": self.lock_path,
            "reroute": self.reroute,
            "putZoneSet": self.put_zone_set,
            "enableZoneSet": self.enable_zone_set,
            "deleteZoneSet": self.delete_zone_set,
            "integrationLevel": self.integration_level,
            "acceptableOrderTypes": self.order_types,
            "createOrderSequence": self.create_sequence,
            "orderSequence": self.sequence,
            "orderSequences": self.sequences,
            "completeOrderSequence": self.complete_sequence,
        }

    async def withdraw(self, command: WithdrawCommand) -> CommandAnswer:
        """Withdraw an order."""
        order = await self._requests.withdraw(
            command.transport_order,
            command.reason,
            seen=_seen(command.version),
            immediate=command.immediate,
        )
        return CommandAnswer(status=HTTPStatus.OK, transport_order=order)

    async def hold(self, command: HoldCommand) -> CommandAnswer:
        """Let an order wait."""
        order = await self._requests.hold(
            command.transport_order,
            command.by or SOMEBODY,
            command.reason,
            seen=_seen(command.version),
            immediate=command.immediate,
        )
        return CommandAnswer(status=HTTPStatus.OK, transport_order=order)

    async def resume(self, command: ResumeCommand) -> CommandAnswer:
        """Let a held order go on."""
        order = await self._requests.resume(
            command.transport_order, command.by or SOMEBODY, command.reason, seen=_seen(command.version)
        )
        return CommandAnswer(status=HTTPStatus.OK, transport_order=order)

    async def delivery(self, command: DeliveryCommand) -> CommandAnswer:
        """Tell the delivery of an order."""
        delivery = await self._requests.delivery(command.transport_order)
        return CommandAnswer(status=HTTPStatus.OK, delivery=delivery)

    async def assignment(self, command: AssignmentCommand) -> CommandAnswer:
        """Tell of each vehicle why it does not do an order."""
        assignment = await self._requests.assignment(command.transport_order)
        return CommandAnswer(status=HTTPStatus.OK, assignment=assignment)

    async def dispatch(self, command: DispatchCommand) -> CommandAnswer:
        """Send a vehicle somewhere."""
        order, new = await vehicle_commands.dispatch(self._requests, command.vehicle, command)
        status = HTTPStatus.CREATED if new else HTTPStatus.OK
        return CommandAnswer(status=status, transport_order=order)

    async def instant_action(self, command: InstantActionCommand) -> CommandAnswer:
        """Let a vehicle do something at once."""
        answer = await vehicle_commands.instant_action(self._requests, command.vehicle, command)
        status = HTTPStatus.ACCEPTED if answer.status == "PENDING" else HTTPStatus.OK
        return CommandAnswer(status=status, instant_action=answer)

    async def integration_level(self, command: IntegrationLevelCommand) -> CommandAnswer:
        """Let a vehicle count so much from now on."""
        vehicle = await self._requests.set_integration_level(command.vehicle, command.integration_level)
        return CommandAnswer(status=HTTPStatus.OK, vehicle=vehicle)

    async def order_types(self, command: OrderTypesCommand) -> CommandAnswer:
        """Let a vehicle accept orders of these types from now on."""
        vehicle = await self._requests.accept_order_types(command.vehicle, command.acceptable_order_types)
        return CommandAnswer(status=HTTPStatus.OK, vehicle=vehicle)

    async def reroute(self, command: RerouteCommand) -> CommandAnswer:
        """Plan the way of a vehicle's order anew."""
        done = await self._requests.reroute(command.vehicle, command.type)
        return CommandAnswer(status=HTTPStatus.OK, rerouting=done)

    async def put_zone_set(self, command: PutZoneSetCommand) -> CommandAnswer:
        """Put a zone set here."""
        return CommandAnswer(status=HTTPStatus.OK, zone_set=await self._zones.put(command.zone_set))

    async def enable_zone_set(self, command: EnableZoneSetCommand) -> CommandAnswer:
        """Have robots use a zone set."""
        return CommandAnswer(status=HTTPStatus.OK, zone_set=await self._zones.enable(command.zone_set_id))

    async def delete_zone_set(self, command: DeleteZoneSetCommand) -> CommandAnswer:
        """Have robots delete a zone set."""
        return CommandAnswer(status=HTTPStatus.OK, zone_set=await self._zones.delete(command.zone_set_id))

    async def lock_path(self, command: LockPathCommand) -> CommandAnswer:
        """Lock or unlock a path."""
        path = await self._locks.set(command.path, locked=command.locked)
        return CommandAnswer(status=HTTPStatus.OK, path=path)

    async def create_sequence(self, command: CreateSequenceCommand) -> CommandAnswer:
        """Make an order sequence."""
        sequence, new = await self._sequences.create(command)
        return CommandAnswer(status=HTTPStatus.CREATED if new else HTTPStatus.OK, order_sequence=sequence)

    async def sequence(self, command: SequenceCommand) -> CommandAnswer:
        """Tell how an order sequence stands."""
        sequence = await self._sequences.sequence(command.order_sequence)
        return CommandAnswer(status=HTTPStatus.OK, order_sequence=sequence)

    async def sequences(self, command: SequencesCommand) -> CommandAnswer:
        """List order sequences."""
        after = None if command.after is None else int(command.after)
        wanted = SequenceFilter(command.finished, before=after, limit=command.limit + 1)
        found = [(each.number, each.status) for each in await self._sequences.sequences(wanted)]
        page = OrderSequencePage.of(found, command.limit)
        return CommandAnswer(status=HTTPStatus.OK, order_sequences=page)

    async def complete_sequence(self, command: CompleteSequenceCommand) -> CommandAnswer:
        """Let no more orders be added to a sequence."""
        seen = None if command.version is None else ETag.of(command.version)
        sequence = await self._sequences.complete(command.order_sequence, seen=seen)
        return CommandAnswer(status=HTTPStatus.OK, order_sequence=sequence)


class MqttCommands:
    """Takes commands and answers each on the topic of its host."""

    def __init__(
        self, mqtt: MqttLink, topics: FleetTopics, verbs: Verbs, *, limits: MqttLimits, max_body: int
    ) -> None:
        self._mqtt = mqtt
        self._topics = topics
        self._verbs = verbs.by_name
        self._limits = limits
        self._max_body = max_body
        self._tasks: set[asyncio.Task[None]] = set()
        mqtt.subscribe(topics.commands, self._command_came)

    async def close(self) -> None:
        """End the work on commands."""
        await end(*self._tasks)

    def _command_came(self, message: Inbound) -> None:
        if not message.payload:
            return  # somebody clears a retained command
        host, name = self._topics.host_of(message.topic), message.topic.rsplit("/", 1)[-1]
        verb = self._verbs.get(name)
        if problem := self._limits.refusal(host, len(self._tasks)):
            self._refuse(host, name, message, problem)
        elif verb is None:
            self._refuse(host, name, message, _unknown(name))
        else:
            self._take_up(host, name, verb, message)

    def _take_up(self, host: str, name: str, verb: Verb, message: Inbound) -> None:
        command = read_request(message, COMMANDS[name], max_body=self._max_body)
        if isinstance(command, Problem):
            log.warning("command refused", host=host, command=name, reason=command.detail)
            self._refuse(host, name, message, command)
        else:
            task = asyncio.create_task(self._do(host, name, verb, command), name=f"{name} for {host}")
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _do(self, host: str, name: str, verb: Verb, command: Command) -> None:
        try:
            answer = await verb(command)
        except Exception as error:
            if not isinstance(error, FORESEEN):
                log.exception("command failed", host=host, command=name)
            problem = problem_of(error)
            answer = CommandAnswer(status=problem.status, problem=problem)
        self._answer(host, name, answer.model_copy(update={"request_id": command.request_id}))

    def _refuse(self, host: str, name: str, message: Inbound, problem: Problem) -> None:
        request_id = text_in(message, "requestId", max_body=self._max_body)
        self._answer(host, name, CommandAnswer(status=problem.status, request_id=request_id, problem=problem))

    def _answer(self, host: str, name: str, answer: CommandAnswer) -> None:
        body = answer.model_dump_json(by_alias=True, exclude_none=True).encode()
        self._mqtt.publish(Outbound(self._topics.command_answer(host, name), body))


def _seen(version: int | None) -> ETag | None:
    return None if version is None else ETag.of(version)


def _unknown(name: str) -> Problem:
    known = ", ".join(COMMANDS)
    detail = f"There is no command {name!r}. Take one of {known}."
    return Problem(title="Unknown command", status=HTTPStatus.NOT_FOUND, detail=detail)
