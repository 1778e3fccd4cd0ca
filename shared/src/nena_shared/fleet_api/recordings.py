"""Recordings in the API: files with the decisions of the last minutes."""

from __future__ import annotations

from nena_shared.fleet_api.base import Resource


class RecordingAnswer(Resource):
    """A recording that was requested."""

    robot: str
    """Under what the status aggregator lists it."""
    name: str
    """Name of the file."""
    sent: bool
    """Whether it is sent to the status aggregator; false: it stays in the order service's `upload.folder`."""
