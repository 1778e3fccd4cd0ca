"""openTCS's web API, version 1, for orders and vehicles, so that its clients work with another URL."""
