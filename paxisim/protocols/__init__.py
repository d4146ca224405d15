"""Protocols: motions that a robot or a stage follows while its sensor is recorded."""
