"""Parts of the order service that its core does not import; see docs/extensions.md."""
