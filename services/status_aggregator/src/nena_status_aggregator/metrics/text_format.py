"""Prometheus's text format, version 0.0.4, as far as plain gauges and counters need it."""

from __future__ import annotations

ESCAPES = str.maketrans({"\\": r"\\", '"': r"\"", "\n": r"\n"})


def labels_text(**labels: str) -> str:
    """Write labels, without the braces around them."""
    return ",".join(f'{name}="{value.translate(ESCAPES)}"' for name, value in labels.items())


def head(name: str, kind: str, text: str) -> str:
    """Write what stands before the samples of a family; ``name`` as the samples have it."""
    return f"# HELP {name} {text}\n# TYPE {name} {kind}\n"
