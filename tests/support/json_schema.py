"""JSON Schema of the messages as they are sent here, per version.

They have the content of the official schemas, with errors corrected, and this implementation's limits. They
do not include the graph rules of section 6.1.1, which a schema cannot express.
"""

from __future__ import annotations

from typing import Any, Final

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import codec_for

DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"


class _AsSent(GenerateJsonSchema):
    """What is not there is left out on the wire, never null; so nothing has null or a default."""

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        return self.generate_inner(schema["schema"])

    def field_title_should_be_set(self, schema: CoreSchema) -> bool:
        del schema
        return False


def json_schema(version: str, topic: Topic) -> dict[str, Any]:
    """Return the JSON Schema (Draft 2020-12) of the message on ``topic``.

    Raises:
        UnknownVersionError: the version is not supported.
        MalformedMessageError: the version has no such message.

    """
    codec = codec_for(version)
    if topic not in codec.kinds:
        raise MalformedMessageError(topic, [f"{version} has no such message"])
    form = codec.forms[codec.kinds[topic]]
    schema = form.model_json_schema(by_alias=True, mode="serialization", schema_generator=_AsSent)
    return {"$schema": DIALECT, **schema, "title": f"VDA 5050 {version} {topic}"}
