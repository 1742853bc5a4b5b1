"""Descriptions of models: systems, own equations, inputs, controls, surfaces, methods."""
