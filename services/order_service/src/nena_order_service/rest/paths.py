"""Paths at ``/v1/paths``: hosts lock and unlock them."""

from __future__ import annotations

from fastapi import APIRouter, Response

from nena_order_service.path_locks import PathLocks
from nena_order_service.rest.responses import as_json
from nena_shared.fleet_api.plant import PathStatus
from nena_shared.fleet_api.requests import PathList, PathLockRequest


def make_router(locks: PathLocks) -> APIRouter:
    """Make the routes over the locks of paths; names of paths may hold any character."""
    router = APIRouter(prefix="/v1/paths", tags=["paths"])

    @router.get("", response_model=PathList)
    async def list_paths() -> Response:
        """List the paths, and which of them are locked."""
        return as_json(PathList(paths=locks.all()))

    @router.put("/{name:path}/lock", response_model=PathStatus)
    async def lock(name: str, request: PathLockRequest) -> Response:
        """Lock or unlock a path: new routes keep off it, also those of vehicles under way."""
        return as_json(await locks.set(name, locked=request.locked))

    @router.get("/{name:path}", response_model=PathStatus)
    async def show(name: str) -> Response:
        """Show a path."""
        return as_json(locks.get(name))

    return router
