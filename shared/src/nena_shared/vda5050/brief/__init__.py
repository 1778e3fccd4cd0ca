"""States and visualizations as watchers need them, read several times as fast as by the codecs.

Decision 0017 says why there are two ways to read a state, and what keeps them together.
"""
