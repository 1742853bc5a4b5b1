"""What compiled libraries of Linux, macOS and Windows say of themselves, read without any tool of these systems."""

from __future__ import annotations

import hashlib
import re
import struct
from dataclasses import dataclass
from itertools import count, takewhile


@dataclass(frozen=True)
class Library:
    """A compiled library."""

    system: str  #: "linux", "macos" or "windows"
    machine: str  #: "x86_64" or "arm64"
    exports: frozenset[str]  #: the symbols that others may use
    needs: frozenset[str]  #: the libraries that it loads
    minimum: tuple[int, ...] = ()  #: the oldest glibc, or macOS, that has what it needs


def read(data: bytes) -> Library:
    """Reads an ELF, Mach-O or PE file."""
    for begin, reader in ((b"\x7fELF", elf), (b"\xcf\xfa\xed\xfe", mach_o), (b"MZ", pe)):
        if data.startswith(begin):
            return reader(data)
    raise ValueError(f"no library of a known system; it begins with {data[:4]!r}")


def text(data: bytes, at: int) -> str:
    """The characters from there to the next zero."""
    return data[at : data.index(b"\0", at)].decode("ascii")


def elf(data: bytes) -> Library:
    """A library of Linux, of 64 bits."""
    (machine,) = struct.unpack_from("<H", data, 18)
    (table,) = struct.unpack_from("<Q", data, 40)
    size, number = struct.unpack_from("<HH", data, 58)
    # Each section: its type, its place, its length, and that of the strings it refers to.
    sections = [struct.unpack_from("<IIQQQQI", data, table + i * size)[1:] for i in range(number)]
    exports, needs, versions = set(), set(), {(0,)}
    for kind, _, _, place, length, link in sections:
        strings = sections[link][3] if link < number else 0
        if kind == 11:  # the symbols of the dynamic linker
            for at in range(place, place + length, 24):
                name, info, _, section = struct.unpack_from("<IBBH", data, at)
                if section and info >> 4 in (1, 2):  # defined here, global or weak
                    exports.add(text(data, strings + name))
        elif kind == 6:  # what the dynamic linker is to do; 1 names a library
            entries = struct.iter_unpack("<qQ", data[place : place + length])
            needs |= {text(data, strings + value) for tag, value in entries if tag == 1}
        elif kind == 0x6FFFFFFE:  # versions of symbols that it needs; their names are in a list of strings
            names = data[strings : strings + sections[link][4]].split(b"\0")
            versions |= {tuple(map(int, name[6:].split(b"."))) for name in names if re.fullmatch(rb"GLIBC_[\d.]+", name)}
    return Library("linux", {62: "x86_64", 183: "arm64"}[machine], frozenset(exports), frozenset(needs), max(versions))


def mach_o(data: bytes) -> Library:
    """A library of macOS, of 64 bits; fails if its signature is not that of its bytes, for then no Apple Silicon loads it."""
    machine, commands = struct.unpack_from("<4xI8xI", data)
    exports, needs, minimum = set(), set(), 0
    is_signed, at = False, 32
    for _ in range(commands):
        command, size = struct.unpack_from("<II", data, at)
        if command in (0xC, 0x80000018, 0x8000001F):  # loads a library: needed, weak, of which symbols are passed on
            needs.add(text(data, at + struct.unpack_from("<I", data, at + 8)[0]))
        elif command == 0x2:  # its symbols
            symbols, number, strings = struct.unpack_from("<III", data, at + 8)
            for i in range(number):
                name, kind = struct.unpack_from("<IB", data, symbols + 16 * i)
                if (
                    kind & 0x01 and kind & 0x0E and not kind & 0xF0
                ):  # for others, defined here, no note of a debugger or a private one
                    exports.add(text(data, strings + name).removeprefix("_"))
        elif command == 0x24 or command == 0x32:  # the oldest system, as it was and as it is said
            (minimum,) = struct.unpack_from("<I", data, at + (8 if command == 0x24 else 12))
        elif command == 0x1D:
            check_signature(data, *struct.unpack_from("<II", data, at + 8))
            is_signed = True
        at += size
    name = {0x01000007: "x86_64", 0x0100000C: "arm64"}[machine]
    if name == "arm64" and not is_signed:
        raise ValueError("no signature, without which no Apple Silicon loads it")
    return Library("macos", name, frozenset(exports), frozenset(needs), (minimum >> 16, minimum >> 8 & 0xFF))


def check_signature(data: bytes, place: int, length: int) -> None:
    """Fails unless the hash of every page is that in the signature's directory."""
    signature = data[place : place + length]
    (blobs,) = struct.unpack_from(">I", signature, 8)
    for i in range(blobs):
        kind, at = struct.unpack_from(">II", signature, 12 + 8 * i)
        if kind:  # no directory
            continue
        hashes, _, _, number, limit, size, _, _, page = struct.unpack_from(">IIIIIBBBB", signature, at + 16)
        for k in range(number):
            part = data[k << page : min(k + 1 << page, limit)]
            if hashlib.sha256(part).digest() != signature[at + hashes + size * k :][:size]:
                raise ValueError(f"the signature is not that of page {k}")
        return
    raise ValueError("the signature has no directory")


def pe(data: bytes) -> Library:
    """A library of Windows, of 64 bits."""
    (head,) = struct.unpack_from("<I", data, 60)
    machine, number, size = struct.unpack_from("<4xHH12xH", data, head)
    sections = [struct.unpack_from("<8xIIII", data, head + 24 + size + 40 * i) for i in range(number)]

    def place(address: int) -> int:
        return next(
            at + address - begin for length, begin, stored, at in sections if begin <= address < begin + max(length, stored)
        )

    directories = [struct.unpack_from("<II", data, head + 24 + 112 + 8 * i)[0] for i in range(14)]
    exports = set()
    if directories[0]:
        number, table = struct.unpack_from("<I4xI", data, place(directories[0]) + 24)
        names = struct.unpack_from(f"<{number}I", data, place(table))
        exports = {text(data, place(name)) for name in names}
    # Tables that end with a row of zeros: what is loaded at once, and what is loaded when it is used.
    needs = set()
    for directory, width, column in ((1, 20, 12), (13, 32, 4)):
        if directories[directory]:
            table = place(directories[directory])
            names_at = (struct.unpack_from("<I", data, table + width * i + column)[0] for i in count())
            needs |= {text(data, place(name)).lower() for name in takewhile(bool, names_at)}
    return Library("windows", {0x8664: "x86_64", 0xAA64: "arm64"}[machine], frozenset(exports), frozenset(needs))
