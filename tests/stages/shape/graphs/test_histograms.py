"""The histogram metric, on arrays of either kind."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from stages.shape.graphs.histograms import histogram_metric


@pytest.mark.parametrize("kind", [np.array, torch.tensor])
def test_metric_is_the_share_of_parts_that_differ(kind: type) -> None:
    one, others = kind([2, 2, 0]), kind([[2, 0, 4], [2, 2, 0], [0, 0, 1]])
    # strings §5.3: (0 + 2 + 4) / (4 + 6), and 1 where no part is shared
    np.testing.assert_allclose(histogram_metric(one, others), [0.6, 0.0, 1.0])
