"""What is known of a step: stability, derivatives, dynamics."""
