"""Extensions of the order service, each in a folder of its own; see docs/extensions.md."""
