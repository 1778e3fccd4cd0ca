"""Parts of the aggregator that its core does not import; see docs/extensions.md."""
