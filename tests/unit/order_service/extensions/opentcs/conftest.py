from __future__ import annotations

import pytest

from nena_order_service.settings import OrderServiceSettings


@pytest.fixture
def settings(settings: OrderServiceSettings) -> OrderServiceSettings:
    return settings.model_copy(update={"opentcs_prefix": "/opentcs"})
