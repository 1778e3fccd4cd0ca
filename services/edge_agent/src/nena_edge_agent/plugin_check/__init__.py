"""Checks an action plug-in by using it as the agent would."""
