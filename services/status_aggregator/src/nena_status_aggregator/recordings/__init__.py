"""Recordings of robots: received over MQTT chunk by chunk, kept in a folder within limits."""
