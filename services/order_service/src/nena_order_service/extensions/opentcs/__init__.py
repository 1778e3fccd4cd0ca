"""openTCS's web API, for hosts that were written for openTCS."""
