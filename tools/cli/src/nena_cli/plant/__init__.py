"""Plant models: check, import and export of openTCS XML and LIF."""
