"""The NumPy reference that ships with stepwell: whole-array operations, step by step."""

from __future__ import annotations

from . import Contestant, stepwell_peer

CONTESTANTS = [Contestant("NumPy reference", stepwell_peer.kernels("shared_cluster_leapfrog", backend="numpy"), slow="steps")]
