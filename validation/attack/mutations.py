"""Damage to the bytes of a valid file, from a seeded generator."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

Generator = np.random.Generator

_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_HEAD = 4096
"""Bytes at the start in which most formats state their sizes."""

_WORDS = b"-1 0 1 7 255 65536 2147483647 4294967296 20000000000 1e30 -1e300 nan inf x".split()
_VALUES = (0, 1, 0xFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 0x7FFFFFFFFFFFFFFF, 0xFFFFFFFFFFFFFFFF)


def mutated(content: bytes, random: Generator) -> bytes:
    """The content with one kind of damage, sometimes with two or three."""
    for _ in range(min(random.geometric(0.6), 3)):
        damage = _DAMAGES[random.integers(len(_DAMAGES))]
        content = damage(content, random) if content else b""
    return content


def _span(content: bytes, random: Generator) -> tuple[int, int]:
    """Start and end of a block; short ones are as likely as long ones."""
    start = int(random.integers(len(content)))
    length = int(np.exp(random.uniform(0.0, np.log(len(content) + 1.0))))
    return start, min(start + length, len(content))


def _flip(content: bytes, random: Generator) -> bytes:
    changed = np.frombuffer(content, dtype=np.uint8).copy()
    places = random.integers(len(content), size=random.integers(1, 9))
    changed[places] = random.integers(256, size=len(places))
    return changed.tobytes()


def _cut_short(content: bytes, random: Generator) -> bytes:
    return content[: random.integers(len(content))]


def _remove(content: bytes, random: Generator) -> bytes:
    start, end = _span(content, random)
    return content[:start] + content[end:]


def _repeat(content: bytes, random: Generator) -> bytes:
    start, end = _span(content, random)
    return content[:end] + content[start:end] + content[end:]


def _blank(content: bytes, random: Generator) -> bytes:
    start, end = _span(content, random)
    return content[:start] + bytes([random.choice((0, 32, 255))]) * (end - start) + content[end:]


def _move(content: bytes, random: Generator) -> bytes:
    start, end = _span(content, random)
    rest = content[:start] + content[end:]
    place = int(random.integers(len(rest) + 1))
    return rest[:place] + content[start:end] + rest[place:]


def _number(content: bytes, random: Generator) -> bytes:
    """Another number in the text, in the head of the file as often as anywhere."""
    reach = _HEAD if random.random() < 0.5 else len(content)
    found = list(_NUMBER.finditer(content, 0, min(reach, len(content))))
    if not found:
        return _flip(content, random)
    one = found[random.integers(len(found))]
    return content[: one.start()] + _WORDS[random.integers(len(_WORDS))] + content[one.end() :]


def _integer(content: bytes, random: Generator) -> bytes:
    """Another whole number in binary, at a place of its own size."""
    size = int(random.choice((1, 2, 4, 8)))
    value = _VALUES[random.integers(len(_VALUES))] & (256**size - 1)
    start = int(random.integers(len(content))) // size * size
    written = value.to_bytes(size, "big" if random.random() < 0.2 else "little")
    return content[:start] + written + content[start + size :]


_DAMAGES: tuple[Callable[[bytes, Generator], bytes], ...] = (
    _flip,
    _cut_short,
    _remove,
    _repeat,
    _blank,
    _move,
    _number,
    _number,
    _integer,
    _integer,
)
"""Numbers in text and in binary have twice the weight, because readers rely on them."""
