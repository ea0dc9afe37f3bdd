"""The source of a method from outside the package, in place of a version that it does not state."""

import ast
import hashlib
import inspect
from collections.abc import Iterator
from pathlib import Path

INSTALLED = ("site-packages", "dist-packages")


def source_digest(kind: type) -> str:
    """sha256 over the code of a class's module and of what that imports from the same package, down to the last import.

    Code is what the parser sees: comments, blank lines and layout do not count. A module that lies loose in a folder is
    taken together with what it imports from that folder.

    Raises:
        ValueError: where there is no source file, or one that cannot be read.
    """
    try:
        file = Path(inspect.getfile(kind)).resolve()
        return _digest(kind.__module__, file)
    except (OSError, TypeError, SyntaxError) as error:
        name = f"{kind.__module__}.{kind.__qualname__}"
        raise ValueError(
            f"the source of {name} cannot be read ({error}); state `version = 1` in the class, and count it up "
            "whenever its planes change"
        ) from error


def _digest(module: str, file: Path) -> str:
    if module == "__main__":
        module = file.stem
    home, top = file.parents[module.count(".") + (file.name == "__init__.py")], module.partition(".")[0]
    found, waiting = {}, [(module, file)]
    while waiting:
        name, path = waiting.pop()
        if path not in found:
            found[path], imported = _parsed(name, path)
            waiting += [(each, place) for each in imported if (place := _own_file(each, home, top))]
    code = sorted((path.relative_to(home).as_posix(), each) for path, each in found.items())
    return hashlib.sha256(repr(code).encode()).hexdigest()


def _parsed(module: str, path: Path) -> tuple[str, list[str]]:
    """A file's code, without comments, and the names of all it imports; a compiled file is taken as it is."""
    if path.suffix != ".py":
        return hashlib.sha256(path.read_bytes()).hexdigest(), []
    tree = ast.parse(path.read_bytes())
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    return ast.dump(tree), list(_imports(tree, package))


def _imports(tree: ast.Module, package: str) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from (alias.name.rsplit(".", drop)[0] for drop in range(alias.name.count(".") + 1))
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package.split(".")[: len(package.split(".")) - node.level + 1]) if node.level else ""
            base = ".".join(filter(None, (base, node.module)))
            yield from (base, *(f"{base}.{alias.name}".lstrip(".") for alias in node.names))


def _own_file(module: str, home: Path, top: str) -> Path | None:
    """The file of a module that belongs to the same package or, outside of installed packages, to the same folder."""
    own = module.partition(".")[0]
    if not own or (own != top and (own == "symshrec" or home.name in INSTALLED)):
        return None
    place = home.joinpath(*module.split("."))
    files = (place.with_suffix(".py"), place / "__init__.py", *home.glob(f"{module.replace('.', '/')}.*.so"))
    return next((file for file in files if file.is_file()), None)
