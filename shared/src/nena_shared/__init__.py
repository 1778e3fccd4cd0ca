"""Code shared by NeNa's services: VDA 5050 messages, MQTT link, plant model, settings, logging."""
