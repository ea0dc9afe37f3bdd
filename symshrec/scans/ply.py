"""The points of a binary ply without faces, as scanners write them: read at once, without waiting for trimesh."""

import numpy as np

ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}


def bare_vertices(content: bytes) -> np.ndarray | None:
    """The vertices (V, 3) float64 of a binary ply that holds nothing else but their properties; None for any other."""
    end = content.find(b"\n", content.find(b"end_header"))
    words = [line.split() for line in content[:end].decode("ascii", errors="replace").splitlines()]
    order = next((ORDERS.get(line[1]) for line in words if line[:1] == ["format"] and len(line) == 3), None)
    elements = [line for line in words if line[:1] == ["element"]]
    if order is None or len(elements) != 1 or elements[0][1:2] != ["vertex"] or not elements[0][-1].isdecimal():
        return None
    properties = [line for line in words if line[:1] == ["property"]]
    if any(len(line) != 3 or line[1] not in TYPES for line in properties):
        return None
    names, count = [line[2] for line in properties], int(elements[0][-1])
    if not set("xyz") <= set(names) or len(set(names)) < len(names):
        return None
    row = np.dtype([(name, order + TYPES[kind]) for _, kind, name in properties])
    if len(content) - end - 1 != count * row.itemsize:
        return None
    rows = np.frombuffer(content, row, count, end + 1)
    return np.stack([rows[axis] for axis in "xyz"], axis=1, dtype=np.float64)
