"""Every language on the same work, in one run on this machine, each speed beside its error.

A workload is one file in ``workloads/``, a peer one file in ``peers/``; both folders are listed when the run begins.
"""
