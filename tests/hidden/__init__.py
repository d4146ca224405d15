"""Recordings with an effect hidden in them, made by mathematics that the diagnosis does not know.

Imports numpy, scipy and the standard library, and nothing of paxisim: a test reads the imports.
"""
