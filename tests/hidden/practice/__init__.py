"""The generator to build a diagnosis with: each effect has several forms, and a sensor is calibrated somewhere."""
