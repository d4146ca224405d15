"""Calibration: readouts that turn channels that are not in newtons into forces.

`paxisim.calibrate_readout` fits a `paxisim.LinearCalibration` to a recording with a load cell beside the sensor.
"""
