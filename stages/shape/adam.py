"""Adam as PyTorch has it, without the import of PyTorch's compiler."""

from __future__ import annotations

import torch


class Adam(torch.optim.Adam):
    """Adam whose methods lack the guards against a compiler: these import it, which takes seconds in each process."""

    step = torch.no_grad()(torch.optim.Adam.step.__wrapped__)  # type: ignore[attr-defined]
    zero_grad = torch.optim.Adam.zero_grad.__wrapped__  # type: ignore[attr-defined]
    add_param_group = torch.optim.Adam.add_param_group.__wrapped__  # type: ignore[attr-defined]
    state_dict = torch.optim.Adam.state_dict.__wrapped__  # type: ignore[attr-defined]
    load_state_dict = torch.optim.Adam.load_state_dict.__wrapped__  # type: ignore[attr-defined]
