"""Many runs: sweeps, advice, measuring."""
