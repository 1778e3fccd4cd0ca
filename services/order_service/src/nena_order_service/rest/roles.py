"""What each request takes: to read, a viewer; to command, an operator; to change the plant, an admin."""

from __future__ import annotations

from nena_shared.web.users import Role

OPEN = frozenset({"/healthz", "/readyz"})
READING = frozenset({"GET", "HEAD", "OPTIONS"})
PLANT = ("/v1/plantModel", "/v1/zoneSets")


def role_needed(method: str, path: str) -> Role | None:
    """Tell what a request takes; None: it is for everybody."""
    if path in OPEN:
        return None
    if method in READING:
        return Role.VIEWER
    return Role.ADMIN if path.startswith(PLANT) else Role.OPERATOR
