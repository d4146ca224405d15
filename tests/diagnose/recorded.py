"""A case of `tests/hidden`, which knows nothing of paxisim, as a user has it."""

from paxisim.recording import Recording


def recording_of(case):
    return Recording(case.time, case.measured, case.simulated, case.covariates, case.episode)
