"""Campaigns against faults: fuzzed calls, memory, threads, processes, disks. See docs/developing/reliability.md."""
