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
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException

from symshrec.benchmark.config import BenchmarkConfig
from symshrec.methods.registry import BUILT_IN, DOTTED, method_class, method_names, settings_class
from symshrec.methods.settings import plain_settings
from symshrec.runs.schema import Config

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


def register(store: ConfigStore | None = None, overrides: Sequence[str] = ()) -> None:
    """Make the schema known to a store, Hydra's own unless another is given, and `resolvers` to all. Methods of other
    packages are those that `overrides` name."""
    resolvers()
    store = ConfigStore.instance() if store is None else store
    store.store(name="schema", node=_writable(OmegaConf.structured(Config)))
    for name in BUILT_IN:
        store.store(group="method", name=f"{name}_schema", node=_method_node(name))
    register_methods(overrides, store)


def resolvers() -> None:
    """Make `${when:condition,text}` known, the text where the condition holds or nothing, and `${join:list}`."""
    OmegaConf.register_new_resolver("when", lambda condition, text: text if condition else "", replace=True)
    OmegaConf.register_new_resolver("join", ",".join, replace=True)


def register_methods(overrides: Sequence[str], store: ConfigStore) -> None:
    """Let `method=NAME` choose a method of another package, by its entry point, or any class by its dotted path.

    Raises:
        ValueError: for one that cannot be imported or is no method.
    """
    values = (word.split("=", 1)[1] for word in overrides if word.startswith(("method=", "+method=")))
    for name in (each.strip("'\" ") for value in values for each in value.split(",")):
        if not (conf_folder() / "run" / f"{name}.yaml").exists():  # a run of its own, called as the method is
            store.store(group="run", name=name, node={}, package="_global_")
        if (conf_folder() / "method" / f"{name}.yaml").exists():
            continue
        if name in method_names() or DOTTED.fullmatch(name):
            store.store(group="method", name=name, node=_method_node(name))


def _method_node(name: str) -> DictConfig:
    """The settings of a method as a node of the schema, `name` being what chooses it."""
    node = _writable(OmegaConf.structured(settings_class(name)))
    node.name = name
    return node


def _writable(node: DictConfig) -> DictConfig:
    """Frozen dataclasses make read-only nodes; settings are frozen, configurations are there to be overridden."""
    OmegaConf.set_readonly(node, None)
    for key in node:
        child = node._get_node(key)
        if isinstance(child, DictConfig) and not child._is_none() and not child._is_missing():
            _writable(child)
    return node


def load(
    overrides: Sequence[str] | None = None, folders: Sequence[str | PathLike] = (), name: str = MAIN
) -> DictConfig:
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


def loader(folders: Sequence[str | PathLike] = (), overrides: Sequence[str] = ()) -> ConfigLoaderImpl:
    """What finds files in conf/, then in `folders`, and the methods that overrides name, and composes them.

    Raises:
        ValueError: for a folder that is not there.
    """
    path = create_config_search_path(str(conf_folder()))
    for folder in folders:
        if not Path(folder).is_dir():
            raise ValueError(f"there is no folder {folder} to look for configurations in")
        path.prepend("command-line", f"file://{Path(folder).absolute()}", SearchPathQuery(provider="schema"))
    found = ConfigLoaderImpl(path)
    found.repository = _Apart(path, overrides)
    return found


class _Apart(ConfigRepository):
    """Sources of configurations whose stored ones are Hydra's and this package's: an application that stores some under
    the same names, `config` for one, keeps them and does not meet them here."""

    def __init__(self, config_search_path: ConfigSearchPath, overrides: Sequence[str] = ()):
        self.overrides = tuple(overrides)
        super().__init__(config_search_path)

    def initialize_sources(self, config_search_path: ConfigSearchPath) -> None:
        super().initialize_sources(config_search_path)
        shared = ConfigStore.instance()
        store = copy.copy(shared)
        store.repo = {name: node for name, node in shared.repo.items() if name.startswith(("hydra", "_dummy"))}
        register(store, self.overrides)
        for source in self.sources:
            if source.scheme() == "structured":
                source.store = store  # type: ignore[attr-defined]  # of the structured source alone


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


def _composed(overrides: list[str], folders: Sequence[str | PathLike], name: str) -> DictConfig:
    with hydra_apart():
        config = loader(folders, overrides).load_configuration(name, overrides, RunMode.RUN, from_shell=False)
    with open_dict(config):
        if "changed" in config:  # known here, and to ${hydra:…} only while a command runs
            config.changed = config.hydra.job.override_dirname
        del config["hydra"]
    return config


def table_rows(config: DictConfig) -> list[str]:
    """Names of the tables' rows, in their order: the paper's, ours, the refined ones, the oracle last."""
    return [*config.rows.published, *config.rows.ours, *refined_rows(config)]


def refined_rows(config: DictConfig) -> list[str]:
    """Those of them that refine, and the oracle's, which does: run only where `rows.all` asks for them."""
    return [*(f"{name}_refine" for name in config.rows.refined), "oracle_refine"]


def so3_rows(config: DictConfig) -> list[str]:
    """Likewise of table_so3."""
    return [*config.rows.so3, *(f"{name}_refine" for name in config.rows.so3_refined)]


def settings_of(node: DictConfig) -> Any:
    """A part of the configuration as the dataclass that is its schema."""
    return OmegaConf.to_object(node)


def benchmark_of(config: DictConfig) -> BenchmarkConfig:
    """The benchmark that `config.data` describes, as plain dataclasses."""
    return settings_of(config.data.benchmark)


def method_of(config: DictConfig) -> "SymmetryMethod":
    """The method that `config.method` describes.

    Raises:
        ValueError: for arguments that the method refuses, or weights that are not there.
    """
    try:
        settings = settings_of(config.method)
        method = method_class(config.method.name)(settings)
    except (ValueError, OmegaConfBaseException) as error:
        text = str(error.__cause__ or error).splitlines()[0]
        raise ValueError(text if text.startswith("method ") else f"method {config.method.name}: {text}") from error
    method.hparams.update(plain_settings(method.settings))
    return method


def _explain(error: Exception, overrides: list[str], folders: Sequence[str | PathLike], name: str) -> str:
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
