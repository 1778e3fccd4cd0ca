"""The control panel: plain files in ``static``, served as they are."""
