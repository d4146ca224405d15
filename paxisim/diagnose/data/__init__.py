"""Data: a recording on one clock, with its noise, its baseline and its samples."""
