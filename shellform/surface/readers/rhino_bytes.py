"""What a Rhino file tells of when and where it was written, taken out of its bytes (openNURBS archive,
version 7).

After 32 bytes of heading a file is a row of chunks: a code (4 bytes), the length of what follows (8), that.
The table of properties holds such chunks too: the path that was written to, and a history with who made and
last edited the file, and the two dates (each eight whole numbers: second, minute, hour, day, month, year
since 1900, weekday, day of the year), closed by a check sum. The file's last chunk states its length.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

_HEADING = 32  # bytes, before the first chunk
# codes of chunks
_PROPERTIES, _PATH, _HISTORY, _END = 0x10000014, 0x20008027, 0x20008021, 0x7FFF
_SHORT = 0x80000000  # of codes: the number after it is a value, nothing follows
_DATE = struct.Struct("<8i")
_EPOCH = _DATE.pack(0, 0, 0, 1, 0, 70, 4, 0)


def without_date_and_path(content: bytes) -> bytes:
    """The same file, dated 1970 and without the path that it was written to. Raises ValueError for another
    layout."""
    parts = [content[:_HEADING]]
    for code, number, inside in _chunks(content, _HEADING):
        if code == _PROPERTIES:
            inside = b"".join(
                _packed(own, value, _dated(rest) if own == _HISTORY else rest)
                for own, value, rest in _chunks(inside, 0)
                if own != _PATH
            )
        if code == _END:
            inside = struct.pack("<q", sum(map(len, parts)) + 12 + 8)
        parts.append(_packed(code, number, inside))
    return b"".join(parts)


def _chunks(content: bytes, begin: int) -> Iterator[tuple[int, int, bytes]]:
    """Code, number and inside of each chunk."""
    place = begin
    while place < len(content):
        if place + 12 > len(content):
            raise ValueError("a chunk is cut off")
        code, number = struct.unpack_from("<Iq", content, place)
        place += 12
        length = 0 if code & _SHORT else number
        if not 0 <= length <= len(content) - place:
            raise ValueError("a chunk is longer than its file")
        yield code, number, content[place : place + length]
        place += length


def _packed(code: int, number: int, inside: bytes) -> bytes:
    return struct.pack("<Iq", code, number if code & _SHORT else len(inside)) + inside


def _dated(history: bytes) -> bytes:
    """A history of 1970."""
    body, place = bytearray(history[:-4]), 1
    for _ in range(2):
        (letters,) = struct.unpack_from("<I", body, place)
        place += 4 + 2 * letters
        body[place : place + _DATE.size] = _EPOCH
        place += _DATE.size
    if len(body) + 4 != len(history):
        raise ValueError("a history is cut off")
    return bytes(body) + struct.pack("<I", zlib.crc32(body))
