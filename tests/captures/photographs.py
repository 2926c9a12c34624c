"""Small photographs with the metadata a camera or a drone writes."""

import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

MakePhoto = Callable[..., Path]


def texture(seed: int, width: int = 120, height: int = 90) -> Image.Image:
    """A picture of its own for each seed, with detail at several scales."""
    rng = np.random.default_rng(seed)
    coarse = Image.fromarray(rng.integers(40, 216, (9, 12, 3), dtype=np.uint8)).resize((width, height))
    fine = rng.integers(-25, 26, (height, width, 3))
    return Image.fromarray(np.clip(np.asarray(coarse, dtype=int) + fine, 0, 255).astype(np.uint8))


def exif_block(
    *, base: dict[int, Any] | None = None, detail: dict[int, Any] | None = None, gps: dict[int, Any] | None = None
) -> Image.Exif:
    """An EXIF block of Pillow's from its three directories."""
    exif = Image.Exif()
    exif.update(base or {})
    if detail:
        exif.get_ifd(0x8769).update(detail)
    if gps:
        exif.get_ifd(0x8825).update(gps)
    return exif


def gps_tags(
    latitude: float, longitude: float, altitude: float | None = None, reference: int | None = 0
) -> dict[int, Any]:
    """GPS tags of a position, in degrees, minutes and seconds."""

    def sexagesimal(value: float) -> tuple[float, float, float]:
        minutes = abs(value) * 60
        return float(int(minutes // 60)), float(int(minutes % 60)), round(minutes % 1 * 60, 6)

    tags: dict[int, Any] = {
        1: "S" if latitude < 0 else "N",
        2: sexagesimal(latitude),
        3: "W" if longitude < 0 else "E",
        4: sexagesimal(longitude),
    }
    if altitude is not None:
        tags[6] = altitude
        if reference is not None:
            tags[5] = bytes([reference])
    return tags


def dji_xmp(attributes: bool = True, prefix: str = "drone-dji", **fields: str) -> bytes:
    """An XMP packet as DJI writes it, with the fields as attributes or as elements."""
    if attributes:
        body = " ".join(f'{prefix}:{name}="{value}"' for name, value in fields.items()) + "/>"
    else:
        elements = "".join(f"<{prefix}:{name}>{value}</{prefix}:{name}>" for name, value in fields.items())
        body = f">{elements}</rdf:Description>"
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>\n'
        '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description rdf:about="" xmlns:{prefix}="http://www.dji.com/drone-dji/1.0/" {body}'
        '</rdf:RDF></x:xmpmeta>\n<?xpacket end="w"?>'
    ).encode()


def bomb_png(path: Path, width: int = 30000, height: int = 30000) -> Path:
    """A PNG of a few hundred kilobytes that announces width × height pixels, and has them."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    packer = zlib.compressobj(9)
    row = bytes(1 + (width + 7) // 8)
    pixels = b"".join(packer.compress(row) for _ in range(height)) + packer.flush()
    header = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", pixels) + chunk(b"IEND", b""))
    return path
