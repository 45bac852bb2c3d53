"""PNG files whose bytes do not depend on the zlib that Python was built with: their data is stored, not compressed."""

import struct
import zlib

_STORED_BLOCK_MAX = 65535  # bytes, RFC 1951 section 3.2.4


def _stored(data):
    """A zlib stream (RFC 1950) of stored blocks."""
    blocks = [data[k : k + _STORED_BLOCK_MAX] for k in range(0, len(data), _STORED_BLOCK_MAX)]
    stream = b"\x78\x01"
    for k, block in enumerate(blocks):
        stream += struct.pack("<BHH", k + 1 == len(blocks), len(block), len(block) ^ 0xFFFF) + block
    return stream + struct.pack(">I", zlib.adler32(data))


def _chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def picture(rows):
    """PNG of rows of (r, g, b) or (r, g, b, a) bytes, sRGB."""
    channels = len(rows[0][0])
    header = struct.pack(">IIBBBBB", len(rows[0]), len(rows), 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    lines = b"".join(b"\0" + bytes(value for pixel in row for value in pixel) for row in rows)
    return b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", header) + _chunk(b"IDAT", _stored(lines)) + _chunk(b"IEND", b"")
