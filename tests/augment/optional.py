"""torch, which the library runs without: None where it is missing, and the mark of the tests that need it."""

import pytest

try:
    import torch
except ImportError:
    torch = None

needs_torch = pytest.mark.skipif(torch is None, reason="needs torch")
