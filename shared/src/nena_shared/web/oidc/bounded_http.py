"""Requests to the issuer: nothing that it does may take long, or much memory."""

from __future__ import annotations

import asyncio
import json
import ssl
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

import httpx

from nena_shared.settings import ConfigurationError
from nena_shared.web.oidc.errors import IssuerAwayError
from nena_shared.web.oidc.settings import OidcSettings

ANSWER_LIMIT = 512 * 1024
"""Bytes; a discovery document has some 5 KB, keys some more."""

Answer = tuple[int, dict[str, Any]]
"""Status and JSON object."""


class BoundedHttp:
    """Each request has a connection of its own: they are rare."""

    def __init__(self, settings: OidcSettings) -> None:
        """Prepare.

        Raises:
            ConfigurationError: the file of who vouches for the issuer cannot be used.

        """
        self._timeout = settings.timeout
        try:
            self._tls = ssl.create_default_context(cafile=settings.ca)
        except OSError as error:
            raise ConfigurationError([f"http.oidc.ca: {settings.ca}: {error}"]) from error

    async def get(self, url: str) -> dict[str, Any]:
        """Give the JSON object that is there.

        Raises:
            IssuerAwayError: there is none.

        """
        status, found = await self.ask("GET", url)
        if status != HTTPStatus.OK:
            message = f"{url} answered {status}"
            raise IssuerAwayError(message)
        return found

    async def ask(
        self,
        method: str,
        url: str,
        form: Mapping[str, str] | None = None,
        login: tuple[str, str] | None = None,
    ) -> Answer:
        """Send a request, with ``form`` as its body and ``login`` as user and password.

        Raises:
            IssuerAwayError: no JSON object came within the time.

        """
        try:
            async with (
                asyncio.timeout(self._timeout),
                httpx.AsyncClient(verify=self._tls, timeout=self._timeout, trust_env=False) as client,
                client.stream(method, url, data=form, auth=login, headers=HEADERS) as answer,
            ):
                found = json.loads(await _body(answer))
        except TimeoutError as error:
            message = f"{url} has not answered within {self._timeout:g} s"
            raise IssuerAwayError(message) from error
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            message = f"{url}: {str(error) or type(error).__name__}"
            raise IssuerAwayError(message) from error
        except (ValueError, RecursionError) as error:
            message = f"{url} answered {answer.status_code}, which is no JSON"
            raise IssuerAwayError(message) from error
        if not isinstance(found, dict):
            message = f"{url} answered with JSON that is no object"
            raise IssuerAwayError(message)
        return answer.status_code, found


HEADERS = {"accept": "application/json", "accept-encoding": "identity"}
"""Uncompressed, so that the limit is one of what comes and of what is kept."""


async def _body(answer: httpx.Response) -> bytes:
    body = bytearray()
    async for chunk in answer.aiter_raw():
        body += chunk
        if len(body) > ANSWER_LIMIT:
            message = f"{answer.url} answered with more than {ANSWER_LIMIT} bytes"
            raise IssuerAwayError(message)
    return bytes(body)
