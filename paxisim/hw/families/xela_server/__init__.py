"""XELA's server."""
