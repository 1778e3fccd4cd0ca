"""HTTP: REST resources, event stream, commands, sign-in, health, metrics and the panel's files."""
