"""Traffic: which vehicle may use which points, paths and blocks, and when (openTCS: scheduler)."""
