"""What each request takes: data a viewer, commands an operator; the page's own files are for everybody."""

from __future__ import annotations

from nena_shared.web.access import RoleNeeded
from nena_shared.web.settings import HttpSettings
from nena_shared.web.users import Role

API = "/api/"
METRICS = "/metrics"
SESSION = "/api/v1/session"
SIGN_IN = f"{SESSION}/oidc"
"""Below it is what a browser needs before anybody is known."""


def make_rule(settings: HttpSettings) -> RoleNeeded:
    """Make the rule of this service."""

    def needed(method: str, path: str) -> Role | None:
        if path == METRICS:
            return None if settings.open_metrics else Role.VIEWER
        if not path.startswith(API):
            return None
        if path == SESSION:  # to log out takes nothing
            return None if method == "DELETE" else Role.VIEWER
        if path == SIGN_IN or path.startswith(f"{SIGN_IN}/"):
            return None
        return Role.VIEWER if method in ("GET", "HEAD") else Role.OPERATOR

    return needed
