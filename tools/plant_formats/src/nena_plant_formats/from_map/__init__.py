"""Propose a plant model from a robot's map; needs the extra ``maps``."""
