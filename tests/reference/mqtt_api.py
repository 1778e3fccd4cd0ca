"""Writes docs/mqtt-api.md: the topics of the order service, as its AsyncAPI document describes them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from nena_deploy.identities import Identity, Kind, SiteTopics, access_list, device_name
from nena_order_service.api.asyncapi import Channel, channels
from nena_shared.fleet_api.topics import FleetTopics
from support.markdown import row

_HERE: Final = Path(__file__).parent
DOCUMENT: Final = _HERE.parents[1] / "docs" / "mqtt-api.md"
ANSWER: Final = "Answer"
ALLOWED: Final = """
A host and a device need no more than this, here as the access list of Mosquitto that `nena-deploy` writes
([security.md](security.md#broker-robots-and-services-of-a-site)). A host may send only `create` and
`delivery`, because the other commands affect orders of other hosts, or robots: send those by REST, or add
`topic write nena/v1/hosts/HOST/commands/COMMAND` for each, or `.../commands/+` for all, to a list of your
own. Mosquitto acknowledges a request that it refuses and drops it: the host gets no answer.
"""


def document() -> str:
    """Return the whole text."""
    described = channels(FleetTopics())
    answers = {each.name: each for each in described if each.name.endswith(ANSWER)}
    requests = [each for each in described if each.name + ANSWER in answers]
    others = [each for each in described if each not in requests and each.name not in answers]
    names = ((Kind.HOST, "HOST"), (Kind.DEVICE, device_name("LOCATION")))
    clients = [Identity(kind=kind, name=name, certificate=1) for kind, name in names]
    allowed = access_list(clients, SiteTopics()).partition("\n\n")[2]
    sections = (
        ("What the broker must allow", (ALLOWED.lstrip(), "```", allowed.rstrip(), "```")),
        ("Requests of hosts", _requests(requests)),
        ("Statuses", _messages(each for each in others if "device" not in each.name)),
        ("Peripheral devices", _messages(each for each in others if "device" in each.name)),
    )
    text = [(_HERE / "mqtt_api_introduction.md").read_text(encoding="utf-8").rstrip()]
    for title, table in sections:
        text += ["", f"## {title}", "", *table]
    return "\n".join([*text, ""])


def _requests(requests: Iterable[Channel]) -> Iterator[str]:
    """Yield the table of the requests; each is answered at the same topic with ``/answer``."""
    yield "The answer arrives at the topic of the request followed by `/answer`, that of `create` at"
    yield "`hosts/HOST/transportOrders/answer`."
    yield ""
    yield from _head("request", "topic", "effect", "body", "refused with")
    for each in requests:
        kinds = ", ".join(kind.uri.rpartition("/")[2] for kind in each.refusals)
        yield row((f"`{each.name}`", _topic(each), each.summary, _fields(each), kinds))


def _messages(messages: Iterable[Channel]) -> Iterator[str]:
    yield from _head("message", "topic", "direction", "content", "body")
    for each in messages:
        direction = "from the order service" if each.action == "send" else "to the order service"
        retained = ", retained" if each.retained else ""
        yield row((f"`{each.name}`", _topic(each), direction + retained, each.summary, _fields(each)))


def _head(*cells: str) -> Iterator[str]:
    yield row(cells)
    yield row("---" for _ in cells)


def _topic(channel: Channel) -> str:
    """Return the topic without the prefix; names in it are in capitals."""
    text = channel.address.removeprefix(f"{FleetTopics().prefix}/")
    for name in channel.parameters:
        text = text.replace(f"{{{name}}}", name.upper())
    return f"`{text}`"


def _fields(channel: Channel) -> str:
    if channel.body is None:
        return "the plant model ([NeNa JSON](plant-models.md))"
    fields = channel.body.model_fields.items()
    return ", ".join(f"`{each.alias or name}`" + ("" if each.is_required() else "?") for name, each in fields)


if __name__ == "__main__":
    DOCUMENT.write_text(document(), encoding="utf-8")
