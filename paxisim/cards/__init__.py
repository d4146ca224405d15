"""Sensor cards: the fitted model of one sensor as a file and a page to share, and its score on any recording."""
