"""Writes THIRD-PARTY.txt, the licences of the crates that a wheel contains, by Cargo.lock: `make licences` runs it."""

from __future__ import annotations

import json
import re
import subprocess
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FILE = ROOT / "THIRD-PARTY.txt"
HEAD = """Besides stepwell, whose licence is in LICENSE, the compiled core of a wheel contains these crates and the standard
library of Rust. Each licence is printed once, after the names and copyrights that it stands for. `make licences` writes this.
"""
#: The order in which a crate's files are looked for: of several licences the shortest is taken.
NAMES = ("LICENSE-MIT", "LICENSE-MIT.md", "LICENSE-MIT.txt", "LICENSE", "LICENSE.txt")
#: What no crate says: the standard library is MIT OR Apache-2.0, and zig's and LLVM's support for compiled code has no demands.
RUST = ("The Rust standard library", "Copyright (c) The Rust Project Contributors")


def crates() -> list[tuple[str, str]]:
    """Name and version of each crate that is linked, on any system; macros and build scripts are not."""
    edges = ["--edges=normal,no-proc-macro", "--target=all", "--package=stepwell-py"]
    tree = ["cargo", "tree", "--locked", *edges, "--prefix=none", "--format={p}"]
    lines = subprocess.run(tree, cwd=ROOT, check=True, capture_output=True, text=True).stdout.splitlines()
    words = {tuple(line.split()[:2]) for line in lines if not line.startswith("stepwell-")}
    return sorted((name, version.removeprefix("v")) for name, version in words)


def licence(folder: Path) -> tuple[str, str]:
    """The copyrights of a crate, and the rest of its licence."""
    text = next(folder / name for name in NAMES if (folder / name).exists()).read_text(encoding="utf-8")
    paragraphs = re.split(r"\n\s*\n", text.replace("\r\n", "\n").strip("\n "))
    # Apache's text has such a line in its appendix, as an example.
    if "Apache License" in text:
        return "", "\n\n".join(paragraphs)
    is_copyright = [
        bool(re.match(r"\s*(?:The )?(?:MIT Licen[sc]e|BSD|Copyright)|\s*All rights reserved", each)) for each in paragraphs
    ]
    lines = "\n".join(each for each, is_one in zip(paragraphs, is_copyright, strict=True) if is_one).splitlines()
    copyrights = [line.strip() for line in lines if "opyright" in line]
    return "\n".join(copyrights), "\n\n".join(each for each, is_one in zip(paragraphs, is_copyright, strict=True) if not is_one)


def main() -> None:
    """Write the file."""
    metadata = ["cargo", "metadata", "--locked", "--format-version", "1"]
    packages = json.loads(subprocess.run(metadata, cwd=ROOT, check=True, capture_output=True, text=True).stdout)["packages"]
    folders = {(each["name"], each["version"]): Path(each["manifest_path"]).parent for each in packages}
    # By its words: some files only wrap their lines elsewhere.
    holders: dict[str, list[str]] = defaultdict(list)
    texts: dict[str, str] = {}
    for name, version in crates():
        copyrights, text = licence(folders[name, version])
        key = re.sub(r"[^a-z]", "", text.lower())
        texts.setdefault(key, text)
        holders[key].append("\n    ".join([f"{name} {version}", *copyrights.splitlines()]))
    mit = next(key for key, text in texts.items() if text.startswith("Permission is hereby granted"))
    holders[mit].append("\n    ".join(RUST))
    parts = ["\n".join(holders[key]) + "\n\n" + texts[key] for key in texts]
    FILE.write_text("\n\n".join([HEAD, ("\n\n" + "-" * 80 + "\n\n").join(parts)]) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
