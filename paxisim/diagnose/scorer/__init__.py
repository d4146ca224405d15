"""Scorer: the fit, the held-out error and the evidence of a set of causes."""
