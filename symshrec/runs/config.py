"""Configurations of conf/, and the entry point that names what may be written where a key or a value is wrong."""

import functools
import os
import re
import sys
from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import hydra
from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from symshrec.benchmark.config import BenchmarkConfig
from symshrec.methods.registry import BUILT_IN, DOTTED, method_class, method_names, settings_class
from symshrec.methods.settings import plain_settings
from symshrec.runs.schema import Config

if TYPE_CHECKING:
    from symshrec.methods.base import SymmetryMethod  # Lightning, which takes seconds to import


def conf_folder() -> Path:
    """conf/ of this checkout, or its copy inside an installed wheel."""
    packaged = Path(str(files("symshrec"))) / "conf"
    return packaged if packaged.is_dir() else Path(str(files("symshrec"))).parent / "conf"


def register() -> None:
    """Make the schema known to Hydra, and `${when:condition,text}`: the text where the condition holds, or nothing."""
    OmegaConf.register_new_resolver("when", lambda condition, text: text if condition else "", replace=True)
    OmegaConf.register_new_resolver("join", ",".join, replace=True)
    store = ConfigStore.instance()
    store.store(name="schema", node=_writable(OmegaConf.structured(Config)))
    for name in BUILT_IN:
        store.store(group="method", name=f"{name}_schema", node=_method_node(name))


def register_methods(overrides: Sequence[str]) -> None:
    """Let `method=NAME` choose a method of another package, by its entry point, or any class by its dotted path.

    Raises:
        ValueError: for one that cannot be imported or is no method.
    """
    values = (word.split("=", 1)[1] for word in overrides if word.startswith(("method=", "+method=")))
    store = ConfigStore.instance()
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


def load(overrides: list[str] | None = None) -> DictConfig:
    """The configuration that these command-line overrides give.

    Raises:
        ValueError: for an unknown key or a value of the wrong kind, naming it and the valid ones.
    """
    register()
    register_methods(overrides or [])
    try:
        if GlobalHydra.instance().is_initialized():
            return compose("config", overrides=overrides or [])
        with initialize_config_dir(str(conf_folder()), version_base="1.3"):
            return compose("config", overrides=overrides or [])
    except (HydraException, OmegaConfBaseException) as error:
        raise ValueError(_explain(error)) from error


def table_rows(config: DictConfig) -> list[str]:
    """Names of the tables' rows, in their order: the paper's, ours, the refined ones, the oracle last."""
    rows = config.rows
    return [*rows.published, *rows.ours, *(f"{name}_refine" for name in rows.refined), "oracle_refine"]


def so3_rows(config: DictConfig) -> list[str]:
    """Likewise of table_so3."""
    return [*config.rows.so3, *(f"{name}_refine" for name in config.rows.so3_refined)]


def benchmark_of(config: DictConfig) -> BenchmarkConfig:
    """The benchmark that `config.data` describes, as plain dataclasses."""
    return OmegaConf.to_object(config.data.benchmark)


def method_of(config: DictConfig) -> "SymmetryMethod":
    """The method that `config.method` describes.

    Raises:
        ValueError: for arguments that the method refuses, or weights that are not there.
    """
    try:
        settings = OmegaConf.to_object(config.method)
        method = method_class(config.method.name)(settings)
    except (ValueError, OmegaConfBaseException) as error:
        text = str(error.__cause__ or error).splitlines()[0]
        raise ValueError(text if text.startswith("method ") else f"method {config.method.name}: {text}") from error
    method.hparams.update(plain_settings(method.settings))
    return method


def _explain(error: Exception) -> str:
    text = f"{error}\n{error.__cause__ or ''}"
    unknown = re.search(r"Key '(\w+)' (?:is )?not in '?(?:struct|\w+)'?\s+full_key: (\S+)", text)
    if not unknown:
        return "\n".join(line for line in text.splitlines() if line.strip() and "full stack trace" not in line)
    key = unknown[2]
    whole = load()
    node = OmegaConf.select(whole, key.rpartition(".")[0]) if "." in key else whole
    valid = {str(each) for each in node} if isinstance(node, DictConfig) else set()
    if "." not in key:
        valid |= {folder.name for folder in conf_folder().iterdir() if folder.is_dir()}
    return f"unknown key '{key}'; valid here: {', '.join(sorted(valid)) or 'none'}"


def _check(arguments: list[str]) -> None:
    """Compose every single alternative of every override once, so that a sweep fails before its first job."""
    words = [word for word in arguments if not word.startswith("-") and "=" in word]
    with initialize_config_dir(str(conf_folder()), version_base="1.3"):
        loader = GlobalHydra.instance().config_loader()
        parsed = [
            each for each in OverridesParser.create(loader).parse_overrides(words) if not each.is_hydra_override()
        ]
        fixed = [each.input_line for each in parsed if not each.is_sweep_override()]
        choices = [
            [f"{each.get_key_element()}={value}" for value in each.sweep_string_iterator()]
            for each in parsed
            if each.is_sweep_override()
        ]
        if not all(choices):
            raise ValueError(f"a sweep in {' '.join(words)} matches nothing in {conf_folder()}")
        load([*fixed, *(alternatives[0] for alternatives in choices)])
        for number, alternatives in enumerate(choices):
            others = [each[0] for position, each in enumerate(choices) if position != number]
            for alternative in alternatives[1:]:
                load([*fixed, *others, alternative])


def entry(task: Callable[[DictConfig], None]) -> Callable[[], None]:
    """Make `task` a Hydra command over conf/config.yaml whose user errors are one line and exit status 2."""

    @functools.wraps(task)
    def guarded(config: DictConfig) -> None:
        with _one_line_errors():
            task(config)

    def command() -> None:
        register()
        with _one_line_errors():
            register_methods(sys.argv[1:])
        if not any(word in ("--help", "-h", "--hydra-help", "--info", "-i") for word in sys.argv[1:]):
            with _one_line_errors():
                _check(sys.argv[1:])
        hydra.main(version_base="1.3", config_path=str(conf_folder()), config_name="config")(guarded)()

    return command


class _one_line_errors:
    """Turns a user's mistake (ValueError, OSError) into its message and exit status 2."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind, error, traceback) -> None:
        if isinstance(error, ValueError | OSError) and not os.environ.get("HYDRA_FULL_ERROR"):
            print(f"error: {error}", file=sys.stderr)
            raise SystemExit(2) from None
