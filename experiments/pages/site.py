"""What MkDocs does not do by itself for these pages: formulas as MathML, and pages and pictures from outside of docs/.

`mkdocs.yml` names it as a hook. A page may link to any file of the repository as it does on a code host, by its
relative path: files that pages link to come along under `repository/`, Markdown as pages of their own.
"""

import posixpath
import re
from html import unescape
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

ROOT = Path(__file__).parents[2]
ABROAD = "repository"
LINK = re.compile(r"(\]\()([^)\s]+)(\))")
CODE = re.compile(r"^```.*?^```|`[^`\n]+`", re.MULTILINE | re.DOTALL)
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
WITHOUT = {"README.md"}  # its links lead here; the site has an index of its own


def on_files(files, config):
    """Take along what pages link to outside of docs/, and what that links to."""
    waiting = [place_of(file.src_uri) for file in files.documentation_pages()]
    while waiting:
        page = waiting.pop()
        for target in linked((ROOT / page).read_text(encoding="utf-8"), page):
            uri = uri_of(target)
            if (ROOT / target).is_file() and files.get_file_from_path(uri) is None:
                files.append(File.generated(config, uri, abs_src_path=str(ROOT / target)))
                waiting += [target] if target.endswith(".md") else []
    return files


def on_page_markdown(markdown, page, config, files):
    """Point links at where their targets lie in the site; a folder, which no page shows, becomes its name alone."""
    here = place_of(page.file.src_uri)

    def pointed(match: re.Match) -> str:
        path, mark, anchor = match[2].partition("#")
        if not path or "://" in path:
            return match[0]
        target = posixpath.normpath(posixpath.join(posixpath.dirname(here), path))
        if (ROOT / target).is_dir():
            return match[0].replace(match[2], "#")
        way = posixpath.relpath(uri_of(target), posixpath.dirname(page.file.src_uri))
        return f"{match[1]}{way}{mark}{anchor}{match[3]}"

    return outside_code(markdown, lambda text: LINK.sub(pointed, text))


def on_page_content(html, page, config, files):
    """Every formula as MathML, which browsers draw without a script."""

    def drawn(match: re.Match) -> str:
        formula, block = unescape(match[2]).strip(), match[1] == "div"
        try:
            return convert(formula, display="block" if block else "inline")
        except Exception as error:  # of many kinds
            raise PluginError(f"{page.file.src_uri}: no formula: {formula}: {error}") from error

    return FORMULA.sub(drawn, html)


def place_of(uri: str) -> str:
    """The file of the repository that a page or file of the site is."""
    return uri.removeprefix(f"{ABROAD}/") if uri.startswith(f"{ABROAD}/") else f"docs/{uri}"


def uri_of(place: str) -> str:
    """Where a file of the repository lies in the site."""
    if place in WITHOUT:
        return "index.md"
    return place.removeprefix("docs/") if place.startswith("docs/") else f"{ABROAD}/{place}"


def linked(markdown: str, place: str) -> list[str]:
    """The files that a page's links lead to, by their places in the repository."""
    paths = [match[2].partition("#")[0] for match in LINK.finditer(CODE.sub("", markdown))]
    folder = posixpath.dirname(place)
    return [posixpath.normpath(posixpath.join(folder, path)) for path in paths if path and "://" not in path]


def outside_code(markdown: str, change) -> str:
    """The text with `change` made to all of it but code."""
    parts, end = [], 0
    for match in CODE.finditer(markdown):
        parts += [change(markdown[end : match.start()]), match[0]]
        end = match.end()
    return "".join([*parts, change(markdown[end:])])
