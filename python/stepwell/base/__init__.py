"""Foundations: checks of arguments, immutable values, memory, files, progress. Imports nothing but ``errors``."""
