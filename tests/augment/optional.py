"""Optional torch: `torch` is None where it is not installed, and `needs_torch` marks the tests that need it."""

import pytest

try:
    import torch
except ImportError:
    torch = None

needs_torch = pytest.mark.skipif(torch is None, reason="needs torch")
