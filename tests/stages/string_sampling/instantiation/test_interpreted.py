"""The solver runs without compilation, on a toy kit: every line of its kernels is plain Python."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[4]
SCRIPT = """
import ctypes

import numba
import numpy as np

from stages.shape.geometry.contact_oracle import ContactOracle
from stages.string_sampling.instantiation import solver
from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import STANDARD_METHOD, graph_tables
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, chain, kit_of, ring

assert numba.config.DISABLE_JIT
# the oracle is a C function of two int64, which only compiled code calls by its address
callback = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)
solver.call_oracle = lambda address, a, b: callback(address)(a, b)
np.seterr(over="ignore")
for meshes, exemplars in ((CHAIN, [chain(2), chain(3)]), (ROAD, [ring(1, 1)])):
    kit = kit_of(meshes, exemplars)
    instantiator = Instantiator(ContactOracle(kit))
    graph = kit.labelled(kit.exemplars[0].assembly)
    for method in (STANDARD_METHOD, STANDARD_METHOD._replace(whole=False), STANDARD_METHOD._replace(closes=False)):
        result = instantiator.instantiate(graph.types, graph.edges, np.random.default_rng(0), method)
        assert result.assembly is not None, result.reason
        assert sorted(map(tuple, result.assembly.edges.tolist())) == sorted(map(tuple, graph.edges.tolist()))
        state = instantiator._s
        length = int(state.counts[solver.TRAIL_LENGTH])
        solver._undo(graph_tables(graph.types, graph.edges), state, 0)
        assert length > 0
        assert (state.assigned[: len(graph)] == -1).all(), "undoing the whole trail removes every part"
        assert not state.neighbours[: len(graph)].any()
"""


def test_solver_without_compilation_solves_and_undoes() -> None:
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", SCRIPT], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
