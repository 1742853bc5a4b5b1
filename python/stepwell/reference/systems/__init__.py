"""The systems, one file each, scaled to the step."""
