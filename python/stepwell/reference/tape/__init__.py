"""Lists of operations: what they are, their values over arrays, and their derivatives."""
