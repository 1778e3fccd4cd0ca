"""The responses message of 3.0 (section 7.5)."""

from __future__ import annotations

from typing import Annotated

from pydantic import AliasChoices, Field

from nena_shared.vda5050.responses import GrantType, Response, Responses


class ResponseV30(Response):
    """The answer to one request; section 6.4.3 calls its field by another name."""

    grant_type: Annotated[GrantType, Field(validation_alias=AliasChoices("grantType", "responseType"))]


class ResponsesV30(Responses):
    """Answers to the requests in a robot's state."""

    responses: tuple[ResponseV30, ...]
