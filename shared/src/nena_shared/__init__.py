"""What two or more NeNa services need: VDA 5050 messages, MQTT link, plant model, settings, logging."""
