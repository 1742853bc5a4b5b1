"""Views for people: charts, the explorer, the paper's statements, the command line."""
