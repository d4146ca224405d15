"""Recordings on disk: file formats, and the alignment of streams with different sampling rates."""
