"""Readers of external input, each with valid input and its errors for everything else."""
