"""The paper's success rates, in the order of the tasks: its Table II and its ablation."""

TABLE_2_SIM = {
    "NT": (0.94, 0.82, 0.6, 0.56, 0.42, 0.2),
    "TF": (1.0, 0.98, 0.8, 0.0, 1.0, 0.74),
    "TB": (1.0, 0.82, 0.62, 0.36, 0.84, 0.1),
    "TD": (1.0, 0.86, 0.9, 0.88, 0.88, 0.80),
    "DT": (1.0, 0.96, 0.84, 0.94, 0.96, 0.84),
    "GCS": (1.0, 0.9, 0.84, 0.98, 0.98, 0.76),
}
"""The paper's success rates in simulation, in the order of the tasks."""

TABLE_2_REAL = {
    "NT": (0.4, 0.4, 0.0, 0.1, 0.0, 0.0),
    "TF": (0.4, 0.3, 0.3, 0.0, 0.4, 0.1),
    "TB": (0.5, 0.3, 0.4, 0.1, 0.5, 0.2),
    "TD": (0.1, 0.4, 0.0, 0.2, 0.2, 0.2),
    "DT": (0.6, 0.2, 0.1, 0.3, 0.4, 0.1),
    "GCS": (0.9, 0.8, 0.9, 0.6, 0.9, 0.7),
}
"""The paper's success rates on the real robot."""

ABLATION_REAL = {
    "GCS": (None, None, 0.9, None, 0.9, 0.7),
    "GCS w/o G": (None, None, 0.9, None, 0.4, 0.0),
    "GCS w/o S": (None, None, 0.8, None, 0.3, 0.6),
    "GCS w/o C": (None, None, 0.6, None, 0.3, 0.2),
}
"""The paper's ablation on the real robot."""

REAL = {**ABLATION_REAL, **TABLE_2_REAL}
"""The paper's success rates on the real robot, of all methods."""

UNKNOWN = (None,) * 6
"""Success rates of a method that the paper does not have."""
