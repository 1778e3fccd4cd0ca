"""The MQTT API: hosts publish requests and receive answers on their own topics.

A request either creates a transport order or is a command for an operation of the table. Retained requests
are refused, because the broker would deliver them again at each connect.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Coroutine, Mapping
from functools import partial
from http import HTTPStatus
from typing import Any, Final, TypeVar, cast

from pydantic import BaseModel, Field, ValidationError, create_model
from pydantic_core import from_json

from nena_order_service.api.audit import Origin
from nena_order_service.api.operations import Call, ETag, HostOperations
from nena_order_service.api.problems import FORESEEN, problem_of
from nena_order_service.settings import HostSettings
from nena_shared.clock import Clock
from nena_shared.findings import FINDINGS_SHOWN
from nena_shared.fleet_api import operations as table
from nena_shared.fleet_api.audit import AuditInterface
from nena_shared.fleet_api.base import ObjectName, Request, Resource
from nena_shared.fleet_api.operations import Operation
from nena_shared.fleet_api.operations.vehicles import INSTANT_ACTION
from nena_shared.fleet_api.refusals import MalformedRequest
from nena_shared.fleet_api.requests import SOMEBODY
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.transport_order import CreationAnswer, Problem, TransportOrderRequest
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.rate_limit import RateLimit
from nena_shared.tasks import end
from nena_shared.vda5050.malformed import problems_of

log = get_logger(__name__)

M = TypeVar("M", bound=BaseModel)

REQUESTS_LIMIT = 1000
"""Maximum number of requests of each kind (creations, commands) in progress; more get 503."""

TEXT_LIMIT = 200
"""Maximum length of a requestId, name or idempotencyKey, characters."""


class Command(Request):
    """Fields of all commands."""

    request_id: str | None = Field(None, min_length=1, max_length=TEXT_LIMIT)
    """Repeated in the answer."""


def _command_model(operation: Operation[Any]) -> type[Command]:
    """Return the body of an operation's command: its request, and the name of its object."""
    fields: dict[str, Any] = {}
    if operation.subject:
        fields[operation.subject] = (ObjectName, ...)
    if operation.versioned and operation.method != "GET" and not operation.creates:
        fields["version"] = (
            int | None,
            Field(None, description="Only if the object still has this version."),
        )
    if operation.request_field:
        fields[operation.request_field] = (operation.request, ...)
    bases = (operation.request, Command) if operation.request and not operation.request_field else (Command,)
    name = f"{operation.name[0].upper()}{operation.name[1:]}Command"
    return cast("type[Command]", create_model(name, __base__=bases, __doc__=operation.summary, **fields))


COMMANDS: Final[Mapping[str, type[Command]]] = {
    name: _command_model(operation) for name, operation in table.COMMANDS.items()
}
"""Bodies of commands by command name."""


CREATIONS: Final = (table.CREATE_ORDERS, table.DISPATCH)
"""Commands that create orders, which tell who created them."""


class Answer(Resource):
    """Answer to a command: the operation's answer in its own field, or a problem."""

    status: int
    """Status code as over HTTP."""
    request_id: str | None = None
    problem: Problem | None = None


_RESULTS: Final[dict[str, Any]] = {
    command.result: (command.answer | None, None) for command in table.COMMANDS.values()
}

CommandAnswer: Final[type[Answer]] = create_model(
    "CommandAnswer", __base__=Answer, __doc__=Answer.__doc__, **_RESULTS
)


class MqttLimits:
    """Limits the rate of requests per host, and the number of requests in progress.

    A host is identified by its topic; the broker's access list keeps hosts from using each other's names.
    """

    def __init__(self, settings: HostSettings, clock: Clock) -> None:
        self._requests = RateLimit(settings.requests_per_second, settings.burst)
        self._clock = clock

    def refusal(self, host: str, in_work: int) -> Problem | None:
        """Count a request; return why it is refused while ``in_work`` are in progress, None if accepted."""
        if seconds := self._requests.wait(host, self._clock.monotonic()):
            detail = f"Too many requests. Retry in {seconds:.1f} s."
            return _too_many(HTTPStatus.TOO_MANY_REQUESTS, detail)
        if in_work >= REQUESTS_LIMIT:
            detail = f"{REQUESTS_LIMIT} requests are in progress. Retry when they are answered."
            return _too_many(HTTPStatus.SERVICE_UNAVAILABLE, detail)
        return None


def _too_many(status: HTTPStatus, detail: str) -> Problem:
    return Problem(title="Too many requests", status=status, detail=detail)


class HostTurns:
    """Executes the requests of each host in the order of their arrival, different hosts side by side."""

    def __init__(self) -> None:
        self._last: dict[str, asyncio.Task[None]] = {}
        """What the next request of each host waits for; only hosts with requests in progress."""

    def start(
        self, host: str, work: Callable[[], Coroutine[Any, Any, None]], name: str, *, keeps_turn: bool = True
    ) -> asyncio.Task[None]:
        """Start ``work`` as a task, which begins when the earlier requests of ``host`` have ended.

        Without ``keeps_turn``, it holds up no later ones.
        """
        earlier = self._last.get(host)

        async def execute_in_turn() -> None:
            if earlier:
                await asyncio.wait([earlier])
            await work()

        task = asyncio.create_task(execute_in_turn(), name=name)
        if keeps_turn:
            self._last[host] = task
            task.add_done_callback(lambda _: self._end_turn(host, task))
        return task

    def _end_turn(self, host: str, task: asyncio.Task[None]) -> None:
        if self._last.get(host) is task:
            del self._last[host]


class MqttApi:
    """Subscribes to the requests of hosts and publishes the answers."""

    def __init__(
        self,
        mqtt: MqttLink,
        topics: FleetTopics,
        operations: HostOperations,
        limits: MqttLimits,
        *,
        max_body: int,
    ) -> None:
        self._mqtt = mqtt
        self._topics = topics
        self._operations = operations
        self._limits = limits
        self._max_body = max_body
        self._turns = HostTurns()
        self._creations: set[asyncio.Task[None]] = set()
        self._commands: set[asyncio.Task[None]] = set()
        self.answers: Counter[int] = Counter()
        """Number of answered requests by status."""
        mqtt.subscribe(topics.creation_requests, self._on_creation)
        mqtt.subscribe(topics.commands, self._on_command)

    async def close(self) -> None:
        """Cancel the requests that are being processed."""
        await end(*self._creations, *self._commands)

    def _on_creation(self, message: Inbound) -> None:
        if not message.payload:
            return  # another client clears a retained request
        host = self._topics.host_of(message.topic)

        def answer(problem: Problem) -> None:
            refused = CreationAnswer(
                status=problem.status,
                name=text_in(message, "name", max_body=self._max_body),
                idempotency_key=text_in(message, "idempotencyKey", max_body=self._max_body),
                problem=problem,
            )
            self._publish_answer(self._topics.creation_answer(host), refused)

        if problem := self._limits.refusal(host, len(self._creations)):
            answer(problem)
            return
        request = read_request(message, TransportOrderRequest, max_body=self._max_body)
        if isinstance(request, Problem):
            log.warning("creation request refused", host=host, reason=request.detail, errors=request.errors)
            answer(request)
        else:
            work = partial(self._create_order, host, request, answer)
            task = self._turns.start(host, work, f"creation for {host}")
            self._creations.add(task)
            task.add_done_callback(self._creations.discard)

    async def _create_order(
        self, host: str, request: TransportOrderRequest, refuse: Callable[[Problem], None]
    ) -> None:
        try:
            call = Call("", request, host, origin=Origin(AuditInterface.MQTT, host))
            reply = await self._operations.execute(table.CREATE_ORDER, call)
        except Exception as error:
            if not isinstance(error, FORESEEN):
                log.exception("creation request failed", host=host)
            refuse(problem_of(error))
            return
        order: Any = reply.body
        answer = CreationAnswer(
            status=reply.status,
            name=order.name,
            idempotency_key=request.idempotency_key,
            transport_order=order,
        )
        self._publish_answer(self._topics.creation_answer(host), answer)

    def _on_command(self, message: Inbound) -> None:
        if not message.payload:
            return  # another client clears a retained command
        host, name = self._topics.host_of(message.topic), message.topic.rsplit("/", 1)[-1]
        operation = table.COMMANDS.get(name)
        if problem := self._limits.refusal(host, len(self._commands)):
            self._refuse_message(host, name, message, problem)
            return
        if operation is None:
            detail = f"Unknown command {name!r}. Use one of {', '.join(COMMANDS)}."
            problem = Problem(title="Unknown command", status=HTTPStatus.NOT_FOUND, detail=detail)
            self._refuse_message(host, name, message, problem)
            return
        command = read_request(message, COMMANDS[name], max_body=self._max_body)
        if isinstance(command, Problem):
            log.warning("command refused", host=host, command=name, reason=command.detail)
            self._refuse_message(host, name, message, command)
        else:
            work = partial(self._run_command, host, operation, command)
            # An instant action waits for the robot, perhaps for minutes.
            keeps_turn = operation is not INSTANT_ACTION
            task = self._turns.start(host, work, f"{name} for {host}", keeps_turn=keeps_turn)
            self._commands.add(task)
            task.add_done_callback(self._commands.discard)

    async def _run_command(self, host: str, operation: Operation[Any], command: Command) -> None:
        topic = self._topics.command_answer(host, operation.name)
        try:
            reply = await self._operations.execute(operation, _make_call(operation, command, host))
        except Exception as error:
            if not isinstance(error, FORESEEN):
                log.exception("command failed", host=host, command=operation.name)
            problem = problem_of(error)
            fields: dict[str, Any] = {"status": problem.status, "problem": problem}
        else:
            fields = {"status": reply.status, operation.result: reply.body}
        answer = CommandAnswer(request_id=command.request_id, **fields)
        self._publish_answer(topic, answer)

    def _refuse_message(self, host: str, name: str, message: Inbound, problem: Problem) -> None:
        request_id = text_in(message, "requestId", max_body=self._max_body)
        answer = CommandAnswer(status=problem.status, request_id=request_id, problem=problem)
        self._publish_answer(self._topics.command_answer(host, name), answer)

    def _publish_answer(self, topic: str, answer: CreationAnswer | Answer) -> None:
        self.answers[answer.status] += 1
        self._mqtt.publish(Outbound(topic, answer.model_dump_json(by_alias=True, exclude_none=True).encode()))


def _make_call(operation: Operation[Any], command: Command, host: str) -> Call[Any]:
    request = getattr(command, operation.request_field) if operation.request_field else command
    version = getattr(command, "version", None)
    return Call(
        getattr(command, operation.subject) if operation.subject else "",
        request,
        host if operation in CREATIONS else SOMEBODY,  # otherwise ``by`` is for the host to give
        None if version is None else ETag.of(version),
        Origin(AuditInterface.MQTT, host),
    )


def read_request(message: Inbound, model: type[M], *, max_body: int) -> M | Problem:
    """Return the request, or the problem with it."""
    if message.retained:
        detail = (
            "The request is retained, so it would be delivered again. Publish it without the retain flag."
        )
        return Problem(title="Retained request", status=HTTPStatus.BAD_REQUEST, detail=detail)
    if len(message.payload) > max_body:
        detail = f"The request is longer than {max_body} bytes. Send a shorter one."
        return Problem(title="Too long", status=HTTPStatus.REQUEST_ENTITY_TOO_LARGE, detail=detail)
    try:
        return model.model_validate_json(message.payload, by_alias=True, by_name=False)
    except ValidationError as error:
        problems = problems_of(error, FINDINGS_SHOWN)
        no_json = error.error_count() == 1 and error.errors()[0]["type"] == "json_invalid"
        kind = MalformedRequest.NOT_JSON if no_json else MalformedRequest.INVALID_REQUEST
        return Problem(
            type=kind.uri,
            title="Not JSON" if no_json else "Request does not fit",
            status=kind.status,
            detail="The request is malformed. Fix the problems listed in errors.",
            errors=tuple(problems),
        )


def text_in(message: Inbound, key: str, *, max_body: int) -> str | None:
    """Return a string in a refused request, by which its host can identify it; None if it is missing."""
    if len(message.payload) > max_body:
        return None
    try:
        body = from_json(message.payload)
    except ValueError:
        return None
    text = body.get(key) if isinstance(body, dict) else None
    return text if isinstance(text, str) and 0 < len(text) <= TEXT_LIMIT else None
