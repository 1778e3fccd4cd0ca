"""Readers of what comes from outside, each with what it takes and how it may refuse all else."""
