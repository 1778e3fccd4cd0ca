"""The order service's API for hosts and status aggregator, the same over REST and MQTT.

Uses the terms of openTCS's web API, and adds priorities, coordinates and idempotency keys.
"""
