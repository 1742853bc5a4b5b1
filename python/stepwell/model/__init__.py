"""What a user describes: systems, own equations, inputs, controls, surfaces, methods."""
