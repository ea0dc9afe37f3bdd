"""Configurations of conf/, composed apart from whatever else uses Hydra in the same process."""

import copy
import os
import re
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import Enum
from importlib.resources import files
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra import version
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra._internal.config_repository import ConfigRepository
from hydra._internal.utils import create_config_search_path
from hydra.core.config_search_path import ConfigSearchPath, SearchPathQuery
from hydra.core.config_store import ConfigStore
from hydra.core.utils import setup_globals
from hydra.errors import HydraException, InstantiationException
from hydra.types import RunMode
from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException

from symshrec.benchmark.config import BenchmarkConfig
from symshrec.runs.schema import METHODS, Config

if TYPE_CHECKING:
    from symshrec.methods.base import SymmetryMethod  # Lightning, which takes seconds to import

VERSION_BASE, MAIN = "1.3", "config"  # of Hydra's behaviour; the primary file of conf/
_ONE_AT_A_TIME = threading.RLock()  # Hydra's parser, plugins and version base are shared by all threads
if hasattr(os, "register_at_fork"):  # a child never inherits it locked by a thread that it does not have
    os.register_at_fork(
        before=_ONE_AT_A_TIME.acquire,
        after_in_parent=_ONE_AT_A_TIME.release,
        after_in_child=_ONE_AT_A_TIME.release,
    )


def conf_folder() -> Path:
    """conf/ of this checkout, or its copy inside an installed wheel."""
    packaged = Path(str(files("symshrec"))) / "conf"
    return packaged if packaged.is_dir() else Path(str(files("symshrec"))).parent / "conf"


def register(store: ConfigStore | None = None) -> None:
    """Make the schema known to a store, Hydra's own unless another is given, and `${when:condition,text}` to all: the
    text where the condition holds, or nothing."""
    OmegaConf.register_new_resolver("when", lambda condition, text: text if condition else "", replace=True)
    store = ConfigStore.instance() if store is None else store
    store.store(name="schema", node=Config)
    for name, node in METHODS.items():
        store.store(group="method", name=f"{name}_schema", node=node)


def load(overrides: Sequence[str] | None = None, folders: Sequence[str | Path] = (), name: str = MAIN) -> DictConfig:
    """The configuration that these command-line overrides give.

    It is composed apart: a Hydra application that calls this keeps its own configuration, and threads wait for each
    other.

    Args:
        overrides: as on the command line, `hydra.searchpath=[file://…]` among them.
        folders: searched after conf/, as the command line's --config-dir is.
        name: of the primary file, without `.yaml`.

    Raises:
        ValueError: for an unknown key or a value of the wrong kind, naming it and the valid ones.
    """
    overrides = list(overrides or [])
    try:
        return _composed(overrides, folders, name)
    except (HydraException, OmegaConfBaseException) as error:
        raise ValueError(_explain(error, overrides, folders, name)) from error


def as_overrides(settings: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Settings by key as command-line overrides; those in a dictionary below its key, those that are None left out
    at the top and null below.

    Raises:
        ValueError: for a value that an override cannot say.
    """
    words = []
    for key, value in settings.items():
        if isinstance(value, Mapping):
            words += as_overrides(value, f"{prefix}{key}.")
        elif value is not None or prefix:
            words.append(f"{prefix}{key}={_said(value, prefix + key)}")
    return words


def _said(value: Any, key: str) -> str:
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, str | PathLike):
        text = fspath(value)
        return text if re.fullmatch(r"[\w./-]+|\$\{[^{}]*\}", text) else "'" + text.replace("'", "\\'") + "'"
    if isinstance(value, Sequence):
        return f"[{','.join(_said(each, key) for each in value)}]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, int | float):
        return repr(value)
    raise ValueError(f"{key} is a {type(value).__name__}; a setting is text, a number, true or false, a list or None")


def loader(folders: Sequence[str | Path] = ()) -> ConfigLoaderImpl:
    """What finds files in conf/, then in `folders`, and composes them.

    Raises:
        ValueError: for a folder that is not there.
    """
    path = create_config_search_path(str(conf_folder()))
    for folder in folders:
        if not Path(folder).is_dir():
            raise ValueError(f"there is no folder {folder} to look for configurations in")
        path.prepend("command-line", f"file://{Path(folder).absolute()}", SearchPathQuery(provider="schema"))
    found = ConfigLoaderImpl(path)
    found.repository = _Apart(path)
    return found


class _Apart(ConfigRepository):
    """Sources of configurations whose stored ones are Hydra's and this package's: an application that stores some under
    the same names, `config` for one, keeps them and does not meet them here."""

    def initialize_sources(self, config_search_path: ConfigSearchPath) -> None:
        super().initialize_sources(config_search_path)
        shared = ConfigStore.instance()
        store = copy.copy(shared)
        store.repo = {name: node for name, node in shared.repo.items() if name.startswith(("hydra", "_dummy"))}
        register(store)
        for source in self.sources:
            if source.scheme() == "structured":
                source.store = store


@contextmanager
def hydra_apart() -> Iterator[None]:
    """Within, Hydra behaves as this package expects, for one thread at a time; afterwards as before."""
    with _ONE_AT_A_TIME:
        before = version.getbase()
        version.setbase(VERSION_BASE)
        setup_globals()  # ${now:…} and the like, which a file in the user's folders may use
        try:
            yield
        finally:
            version.VersionBase.instance().version_base = before  # which `setbase` refuses where none was set


def _composed(overrides: list[str], folders: Sequence[str | Path], name: str) -> DictConfig:
    with hydra_apart():
        config = loader(folders).load_configuration(name, overrides, RunMode.RUN, from_shell=False)
    with open_dict(config):
        if "changed" in config:  # known here, and to ${hydra:…} only while a command runs
            config.changed = config.hydra.job.override_dirname
        del config["hydra"]
    return config


def benchmark_of(config: DictConfig) -> BenchmarkConfig:
    """The benchmark that `config.data` describes, as plain dataclasses."""
    return OmegaConf.to_object(config.data.benchmark)


def method_of(config: DictConfig) -> "SymmetryMethod":
    """The method that `config.method` describes.

    Raises:
        ValueError: for arguments that the method refuses, or weights that are not there.
    """
    arguments = OmegaConf.masked_copy(config.method, [key for key in config.method if key != "name"])
    try:
        method = instantiate(arguments, _convert_="object")  # settings become the dataclasses they are, lists plain
    except InstantiationException as error:
        if isinstance(error.__cause__, ValueError):
            raise ValueError(f"method {config.method.name}: {error.__cause__}") from error
        raise
    method.hparams.update(OmegaConf.to_container(config.method, resolve=True, enum_to_str=True))
    return method


def _explain(error: Exception, overrides: list[str], folders: Sequence[str | Path], name: str) -> str:
    """What is wrong, without Hydra's hints at its inside; of an unknown key, the valid ones in its place."""
    text = f"{error}\n{error.__cause__ or ''}"
    unknown = re.search(r"Key '(\w+)' (?:is )?not in '?(?:struct|\w+)'?\s+full_key: (\S+)", text)
    if not unknown:
        return "\n".join(line for line in text.splitlines() if line.strip() and "full stack trace" not in line)
    key = unknown[2]
    try:
        whole = _composed([each for each in overrides if each.partition("=")[0].lstrip("+~") != key], folders, name)
    except (HydraException, OmegaConfBaseException):  # another mistake beside this one
        whole = _composed([], (), MAIN)
    node = OmegaConf.select(whole, key.rpartition(".")[0]) if "." in key else whole
    valid = {str(each) for each in node} if isinstance(node, DictConfig) else set()
    if "." not in key:
        valid |= {folder.name for folder in conf_folder().iterdir() if folder.is_dir()}
    more = f"; another argument of Lightning's Trainer needs a plus: +{key}=…" if key.startswith("trainer.") else ""
    return f"unknown key '{key}'; valid here: {', '.join(sorted(valid)) or 'none'}{more}"
