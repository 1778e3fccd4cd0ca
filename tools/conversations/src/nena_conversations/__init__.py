"""Conversations between VDA 5050 robots and their fleet control: record, replay, show, check."""
