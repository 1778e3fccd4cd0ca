"""The order service's API for hosts and the status aggregator, the same over REST and MQTT.

The terms are those of openTCS's web API, so that its users find them familiar; NeNa adds priorities,
coordinates and an idempotency key.
"""
