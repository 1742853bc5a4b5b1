"""Appendix E: the aircraft."""
