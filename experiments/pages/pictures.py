"""The methods' pictures in docs/figures/, which are those of notebooks/02_methods.ipynb, finer: run it after a change.

python experiments/pages/pictures.py
"""

import tempfile
from base64 import b64decode
from io import BytesIO
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from PIL import Image

ROOT = Path(__file__).parents[2]
NAMES = ("m1", "m2", "m3", "m4", "m4_scan")
FINER = 'plt.rcParams["figure.dpi"] = 96'
COLOURS = 96  # of a picture's palette, which makes it a third of the size


def main() -> None:
    notebook = nbformat.read(ROOT / "notebooks" / "02_methods.ipynb", as_version=4)
    notebook.cells.insert(2, nbformat.v4.new_code_cell(FINER))
    with tempfile.TemporaryDirectory() as folder:
        where = Path(folder, "notebooks")
        where.mkdir()
        NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(where)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    pictures = [output.data["image/png"] for output in outputs if "image/png" in output.get("data", {})]
    for name, picture in zip(NAMES, pictures, strict=True):
        image = Image.open(BytesIO(b64decode(picture))).convert("RGB").quantize(COLOURS)
        image.save(ROOT / "docs" / "figures" / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
