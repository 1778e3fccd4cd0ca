"""Actions that a robot does besides driving, as plug-ins behind one small interface."""
