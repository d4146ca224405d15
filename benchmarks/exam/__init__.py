"""An examination of `paxisim.diagnose`, made apart from it: see `benchmarks/unseen.py`.

Way of a case: `motion` (what is done) -> `contact` (the true forces) -> `effects` (what the sensor does to them) ->
`sensor` (noise, counts, nuisance) -> `cases` (the recording with its truth) -> `judge` (right or wrong).
"""
