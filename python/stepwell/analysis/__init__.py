"""What follows from a step: stability, derivatives, dynamics."""
