"""What the order service says to hosts and to the status aggregator, over REST and MQTT alike.

The words are those of openTCS's web API, so that its users feel at home; NeNa adds priorities, coordinates
and an idempotency key.
"""
