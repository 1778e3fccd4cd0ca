from __future__ import annotations

import pytest

from nena_shared.web.settings import OidcSettings
from support.oidc_issuer import AUDIENCE, OidcIssuer


@pytest.fixture
def settings(issuer: OidcIssuer) -> OidcSettings:
    return OidcSettings(issuer=issuer.address, audience=AUDIENCE)
