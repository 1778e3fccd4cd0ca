from __future__ import annotations

from collections.abc import Iterator

import pytest

from nena_shared.web.settings import OidcSettings
from support.oidc_issuer import AUDIENCE, OidcIssuer, oidc_issuer


@pytest.fixture
def issuer() -> Iterator[OidcIssuer]:
    with oidc_issuer() as made:
        yield made


@pytest.fixture
def settings(issuer: OidcIssuer) -> OidcSettings:
    return OidcSettings(issuer=issuer.address, audience=AUDIENCE)
