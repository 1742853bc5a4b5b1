"""What people see: charts, the explorer, the paper's statements, the command line."""
