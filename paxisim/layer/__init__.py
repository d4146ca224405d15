"""The soft layer of a pad: its elastic response, and its contact with rigid objects."""
