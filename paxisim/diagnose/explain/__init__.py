"""Explain: from the causes found to the figures, intervals and caveats of a result."""
