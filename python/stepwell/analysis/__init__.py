"""Analysis of steps: stability, derivatives, dynamics."""
