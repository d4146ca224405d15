"""Calibrate: readouts that let sensors whose channels are not in newtons be diagnosed.

`paxisim.calibrate_readout` fits a `paxisim.LinearCalibration` to a recording with a load cell beside the sensor.
"""
