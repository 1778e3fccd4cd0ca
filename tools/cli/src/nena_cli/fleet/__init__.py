"""Orders and vehicles of a running order service, over its REST API."""
