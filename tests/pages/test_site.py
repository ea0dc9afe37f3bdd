"""The pages build as a site without a warning, and fetch nothing."""

import os
import re
import subprocess
import sys

from tests.pages.reading import DOCS, ROOT


def test_the_site_builds_strictly_and_fetches_nothing(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", tmp_path]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    pages = {str(path.relative_to(tmp_path)): path.read_text() for path in tmp_path.rglob("*.html")}
    assert len(pages) > len(DOCS)
    for name, text in pages.items():
        fetched = re.findall(r"<(?:script|img|link|iframe)\b[^>]*?\b(?:src|href)=\"?(https?://[^\" >]+)", text)
        assert not fetched, f"{name} fetches {fetched[0]}"
    assert pages["methods/m4.html"].count("<math") > 20
    assert not [name for name, text in pages.items() if "arithmatex" in text]
