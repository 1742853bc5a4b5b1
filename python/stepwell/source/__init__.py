"""A step as text: what it computes, and its export to other languages."""
