"""The costs and errors of methods: work-precision data, and peers."""
