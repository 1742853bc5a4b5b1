"""Benchmarks: ``compare`` times every language on the same work, ``kernels`` times every kernel of the core."""
