"""Tries a plug-in for actions as the agent would use it."""
