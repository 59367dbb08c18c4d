"""Labels of parts that a config names."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pipeline.config import nearest_word
from pipeline.errors import ConfigError
from stages.shape.arrays import BoolArray
from stages.shape.kit import Kit


def named_labels(kit: Kit, names: Iterable[str], key: str) -> BoolArray:
    """Return which labels of a kit are among the `names` that a config has at `key`, bool (labels,).

    Raise ConfigError for a name that no part has.
    """
    names = list(names)
    for name in names:
        if name not in kit.labels:
            close = nearest_word(name, kit.labels)
            hint = f"did you mean {close}?" if close else f"it has {', '.join(kit.labels)}"
            raise ConfigError(f"{key}: kit {kit.name} has no parts called {name}; {hint}")
    is_named: BoolArray = np.isin(kit.labels, names)
    return is_named
