"""When Pydantic builds the models of the API and of plants."""

deferred = False
"""Whether each is built at its first use, for a command that needs few of them; set it before importing them.

Services build them all at their start: FastAPI warns of deferred ones.
"""
