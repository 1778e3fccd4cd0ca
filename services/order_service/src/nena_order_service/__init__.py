"""NeNa order service: plant model, transport orders, routing and dispatch over REST and MQTT."""
