"""TemperatureDrift: gain and zero change with the temperature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from paxisim.augment.parameter_spec import parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class TemperatureDrift(Transform):
    """Gain and zero vary with the temperature: ``y = x (1 + gain (T - reference)) + offset (T - reference)``.

    The remanence of NdFeB magnets falls by 0.09 to 0.12 % per kelvin, and the readings with it. The zeros of the Hall
    sensors and the field of the unloaded magnets add an offset. The transform has no memory: a sensor whose temperature
    lags that of the thermometer needs a covariate that lags as well.

    Source: the gain is that of sintered NdFeB, from manufacturers' datasheets; the offset's range, a tenth of a count
    of 0.1 N per kelvin, is ours.

    Attributes:
        gain: ``(...)`` relative change of all readings (1/K).
        offset: ``(..., pads, 3, rows, cols)`` change of the zero (N/K); any of the four dimensions may be 1.
        reference: ``(...)`` temperature at which the sensor was calibrated and zeroed (degC).
        covariate: Name of the covariate that holds the temperature (degC).
    """

    gain: Any = parameter(0.0, unit="1/K", low=-0.01, high=0.01, typical=(-0.0012, -0.0009))
    offset: Any = parameter(((((0.0,),),),), "pkrc", unit="N/K", typical=(-0.01, 0.01))
    reference: Any = parameter(25.0, unit="degC", low=-273.15, typical=(20.0, 30.0))
    covariate: str = "temperature"

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        warmer = self.broadcast_covariate(self.covariate, covariates, x) - self.broadcast_parameter("reference", x)
        return x * (1 + self.broadcast_parameter("gain", x) * warmer) + self.broadcast_parameter("offset", x) * warmer
