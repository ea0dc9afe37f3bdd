"""The numbers of glTF: accessors, which say how they lie in views of its buffers."""

from pathlib import Path
from typing import Any

import numpy as np

from symshrec.files.foreign import is_whole
from symshrec.scans.cloud import CloudFileError

TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC3": 3}


class Accessors:
    """Read as the specification of glTF 2.0 has it (§3.6.2): strided, sparse and normalised ones too."""

    def __init__(self, tree: Any, buffers: list[bytes], path: Path):
        self.items, self.views = tree.get("accessors", []), tree.get("bufferViews", [])
        self.buffers, self.path = buffers, path

    def values(self, place: int, kind: str, room: int) -> np.ndarray:
        """(N, 3) float64 of a VEC3, (N, 1) of a SCALAR.

        Raises:
            CloudFileError: for one that is not there, of another kind, or beyond its buffer; and where it would take
                more than `room` bytes.
        """
        if not is_whole(place, most=len(self.items) - 1):
            raise self._error(place, "is not there")
        item = self.items[place]
        count, width, dtype = item.get("count"), WIDTHS[kind], np.dtype(TYPES[item["componentType"]])
        if item.get("type") != kind or not is_whole(count):
            raise self._error(place, f"is {str(item.get('type'))[:20]} of {str(count)[:20]}, but should be {kind}")
        if count * width * 8 > room:
            raise self._error(place, f"claims {count:,} values, which no file of this size holds")
        if "bufferView" in item:
            values = self._read(place, item, count, width, dtype).astype(np.float64)
        else:
            values = np.zeros((count, width))
        if sparse := item.get("sparse"):
            changed = sparse["count"]
            if not is_whole(changed, most=count):
                raise self._error(place, f"changes {str(changed)[:20]} of {count} values")
            index, kinds = sparse["indices"], np.dtype(TYPES[sparse["indices"]["componentType"]])
            rows = self._read(place, index, changed, 1, kinds)[:, 0].astype(np.int64)
            if changed and not 0 <= rows.min() <= rows.max() < count:
                raise self._error(place, "changes values that it has not")
            values[rows] = self._read(place, sparse["values"], changed, width, dtype)
        if item.get("normalized") and dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(dtype).max, -1)
        return values

    def _read(self, place: int, item: dict, count: int, width: int, dtype: np.dtype) -> np.ndarray:
        view_place, offset = item["bufferView"], item.get("byteOffset", 0)
        if not is_whole(view_place, most=len(self.views) - 1) or not is_whole(offset):
            raise self._error(place, "names a bufferView that is not there")
        view, row = self.views[view_place], width * dtype.itemsize
        start, length, stride = view.get("byteOffset", 0), view["byteLength"], view.get("byteStride", row)
        if not all(map(is_whole, (start, length, stride))) or not is_whole(view["buffer"], most=len(self.buffers) - 1):
            raise self._error(place, "lies in a bufferView that is none")
        buffer = self.buffers[view["buffer"]]
        needed = offset + (count - 1) * stride + row if count else 0
        if stride < row or needed > length or start + length > len(buffer):
            raise self._error(place, f"needs {needed} bytes of a view of {length} at {start} in {len(buffer)} bytes")
        block = np.frombuffer(buffer, np.uint8, needed - offset if count else 0, start + offset)
        if not count:
            return np.zeros((0, width), dtype)
        rows = np.lib.stride_tricks.as_strided(block, (count, row), (stride, 1), writeable=False)
        return np.ascontiguousarray(rows).view(dtype)

    def _error(self, place, problem: str) -> CloudFileError:
        return CloudFileError(
            f"{self.path}: its accessor {str(place)[:20]} {problem}; it may be cut short: export or copy it again"
        )
