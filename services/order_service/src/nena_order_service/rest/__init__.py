"""The REST door: ``/v1`` over HTTP, described at ``/openapi.json``."""
