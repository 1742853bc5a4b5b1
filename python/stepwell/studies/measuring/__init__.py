"""What methods cost and how wrong they are: work-precision data, and peers."""
