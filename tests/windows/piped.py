"""Runs a program of Windows and passes on what it prints: ``python piped.py PROGRAM WORDS``.

Python does not start under Wine 8.0 where its output is a file, as in many a CI ("can't initialize sys standard streams: Invalid
handle"). A pipe it knows.
"""

from __future__ import annotations

import subprocess
import sys

with subprocess.Popen(
    ["wine", *sys.argv[1:]], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
) as process:
    assert process.stdout is not None
    for line in process.stdout:
        sys.stdout.buffer.write(line.replace(b"\r\n", b"\n"))
        sys.stdout.flush()
sys.exit(process.returncode)
