"""Reads an image with OpenImageIO: a line `width height channels`, then its values, row by row, as little-endian 64-bit floats.

    python read_image.py IMAGE

Integer images give 0..1 by their full scale; float images give their values as they stand.
"""

import sys

import OpenImageIO as oiio

FULL_SCALE = {oiio.UINT8: 255.0, oiio.UINT16: 65535.0}


def main(path):
    image = oiio.ImageInput.open(path)
    if image is None:
        sys.exit(f"{path}: {oiio.geterror()}")
    spec = image.spec()
    kind = spec.format.basetype
    values = image.read_image(format=kind if kind in FULL_SCALE else oiio.FLOAT)
    if values is None:
        sys.exit(f"{path}: {image.geterror()}")
    image.close()
    sys.stdout.buffer.write(f"{spec.width} {spec.height} {spec.nchannels}\n".encode())
    sys.stdout.buffer.write((values.astype("<f8") / FULL_SCALE.get(kind, 1.0)).tobytes())


main(sys.argv[1])
