"""Rules: the constants that decide what is named, each with what it stands for.

`benchmarks/rule_sensitivity.py` halves and doubles each of them and prints what changes.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rules:
    """What decides.

    Attributes:
        material: Materiality: the share of the noise's energy that a cause must gain on held-out episodes. A smaller
            gain does not matter to a user. A cause's `price` multiplies it.
        replayed: Share of the energy of the errors that a replay may have, which a cause must gain besides, where the
            scene is given. Those errors last, unlike noise, so that many causes take up a little of them.
        consistency: The least z-score of a cause's gain over held-out episodes, their sum over the root of the sum of
            their squares. One episode that alone shows the cause has 1, and others that speak against it less.
        folds: Held-out folds at most: leave one out up to so many units.
        few_episodes: Recordings of fewer episodes are split into blocks.
        lone: Share of a cause's excitation that one episode may hold before it is split into two blocks.
        gap: Seconds between blocks of one episode, so that the two share no noise.
        contest: Candidates that are fitted for one place, after ranking by their linearised held-out gain.
        pairs: Pairs of candidates that are fitted for two places.
        delivered: Share of its promise that a candidate must gain once it is fitted; below it the fit is repeated from
            the causes' own starts, as it may have ended in a local minimum.
        promise: Share of the required gain that a candidate must promise, linearised, to be fitted.
        most: Causes at most.
        tie: Share of a cause's gain by which a rival may be worse and still be one: no form is known better than that.
        near_miss: Share of the required gain from which on a cause that is not named is mentioned.
        explains: Least share of the explainable error that the named causes must explain together where clear
            structure is left over.
        visible: Times `material` that a cause must change the reading by, at its starts, to be testable.
    """

    material: float = 0.003
    replayed: float = 0.15
    consistency: float = 0.95
    folds: int = 8
    few_episodes: int = 4
    lone: float = 0.6
    gap: float = 0.5
    contest: int = 4
    pairs: int = 2
    delivered: float = 0.5
    promise: float = 0.3
    most: int = 4
    tie: float = 0.01
    near_miss: float = 0.6
    explains: float = 0.2
    visible: float = 2.0
