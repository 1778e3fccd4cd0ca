"""``nena-edge-agent doctor``: finds which link between fleet control and Nav2 is missing, and what to do."""
