"""Connections with other programs: files, tables, SciPy's interface, arrays of other libraries."""
