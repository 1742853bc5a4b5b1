"""Benchmarks: ``compare`` times every language on the same work, ``gate`` notices within a minute what has become slower."""
