"""Runs a program of Windows and passes on what it prints: ``python piped.py PROGRAM WORDS``.

Python does not start under Wine 8.0 where its output is a file, as in many a CI ("can't initialize sys standard streams: Invalid
handle"). A pipe it knows. And once in some hundred starts Wine's server goes away under a program ("wine client error"): that
says nothing of the program, which is then started once more.
"""

from __future__ import annotations

import subprocess
import sys

SERVER_WENT = b"wine client error"


def run() -> tuple[int, bool]:
    """What the program returns, and whether Wine's server went away."""
    went = False
    with subprocess.Popen(
        ["wine", *sys.argv[1:]], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            went |= line.startswith(SERVER_WENT)
            sys.stdout.buffer.write(line.replace(b"\r\n", b"\n"))
            sys.stdout.flush()
    return process.returncode, went


code, went = run()
if code != 0 and went:
    print("piped.py: Wine's server went away; once more", flush=True)
    code, _ = run()
sys.exit(code)
