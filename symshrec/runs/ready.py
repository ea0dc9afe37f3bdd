"""A run of a method object that somebody made: its description, in the place of one in conf/method."""

import re

from omegaconf import DictConfig, OmegaConf, open_dict

from symshrec.methods.base import SymmetryMethod
from symshrec.methods.settings import plain_settings


def described(config: DictConfig, method: SymmetryMethod, named: bool = False) -> DictConfig:
    """A copy of `config` whose `method` holds the settings of a ready one.

    Args:
        named: whether `config` has a name and a title for the run already; otherwise it is called as the class.
    """
    kind = type(method)
    name = getattr(method, "name", None) or re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", kind.__name__).lower()
    config = config.copy()
    with open_dict(config):
        config.method = OmegaConf.create({**plain_settings(method.settings), "name": name})
    if not named:
        config.name, config.title = f"{name}_refine" if method.refine else name, kind.__name__
    return config
