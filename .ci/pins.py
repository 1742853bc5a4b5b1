"""Writes constraints.txt again, with the newest versions of its names that go together; `make pins` runs it."""

import json
import re
import subprocess
import sys
from pathlib import Path

FILE = Path(__file__).with_name("constraints.txt")
#: The oldest Python that the project supports, so that one file serves all.
PYTHON = "3.11"


def newest(names: list[str]) -> dict[str, str]:
    """The version of each package, by its normalised name, that pip would install; it installs nothing."""
    options = "--quiet --disable-pip-version-check --dry-run --ignore-installed --report - --only-binary :all: --target nowhere"
    command = [sys.executable, "-m", "pip", "install", *options.split(), "--python-version", PYTHON, *names]
    report = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    packages = [each["metadata"] for each in report["install"]]
    return {re.sub(r"[-_.]+", "-", each["name"]).lower(): each["version"] for each in packages}


def main() -> None:
    """Rewrite the file; comments and order stay."""
    text = FILE.read_text(encoding="utf-8")
    pin = re.compile(r"^([\w.-]+)==.*$", re.MULTILINE)
    versions = newest(pin.findall(text))
    FILE.write_text(pin.sub(lambda line: f"{line[1]}=={versions[line[1]]}", text), encoding="utf-8")


if __name__ == "__main__":
    main()
