"""Plant models as files: openTCS's XML, LIF, NeNa's JSON, and route graphs of Nav2."""
