"""Tensors as bytes that depend on nothing but what they hold."""

import json
from collections.abc import Mapping

import numpy as np
from safetensors.numpy import save as _save


def save(tensors: Mapping[str, np.ndarray], metadata: Mapping[str, str] | None = None) -> bytes:
    """A safetensors file: the same tensors and strings give the same bytes, in every process.

    The safetensors library writes several metadata in an order that differs from process to process; here they are
    sorted.

    Args:
        tensors: arrays by name, of any shape and type that the format has.
        metadata: strings by name, kept with them.

    Raises:
        TypeError: for metadata that are not strings.
    """
    metadata = dict(metadata or {})
    for name, value in metadata.items():
        if not isinstance(name, str) or not isinstance(value, str):
            raise TypeError(f"metadata {name!r} is {type(value).__name__}, expected strings by name")
    data = _save({name: np.asarray(array, order="C") for name, array in tensors.items()}, metadata or None)
    size = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + size])
    if metadata:
        header["__metadata__"] = dict(sorted(metadata.items()))
    text = json.dumps(header, ensure_ascii=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)  # so that what follows stays aligned
    return len(text).to_bytes(8, "little") + text + data[8 + size :]
