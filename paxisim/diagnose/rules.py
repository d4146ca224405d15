"""Rules: the constants that decide which causes are named, with their meaning.

`benchmarks/rule_sensitivity.py` halves and doubles each of them and prints what changes.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rules:
    """Thresholds and limits of the search.

    Attributes:
        material: Materiality: the gain on held-out episodes, as a share of the noise energy, below which a cause does
            not matter to a user. A cause's `price` multiplies it.
        replayed: Share of the energy of tolerated replay errors that is added to the required gain if the scene is
            given. Unlike noise, these errors persist, so that many causes absorb a little of them.
        consistency: Smallest z-score of a cause's gain over held-out episodes: the sum of the gains divided by the root
            of their sum of squares. A gain in a single episode has 1, and losses in others lower it.
        folds: Largest number of held-out folds; with at most this many units, each unit is a fold.
        few_episodes: Recordings with fewer episodes are split into blocks.
        lone: Share of a cause's excitation in one episode above which that episode is split into two blocks.
        gap: Seconds between the blocks of an episode, so that they share no noise.
        contest: Number of candidates that are fitted for one addition, ranked by their linearised held-out gain.
        pairs: Number of pairs of candidates that are fitted for a joint addition.
        delivered: Share of its promised gain that a candidate must reach when fitted. Below it, the fit may be in a
            local minimum and is repeated from the causes' own starts.
        promise: Smallest linearised gain for which a candidate is fitted, as a share of the materiality threshold.
        most: Largest number of causes.
        tie: Share of a cause's gain by which a rival may be worse, because no form is known more precisely.
        near_miss: Share of the required gain above which a cause that is not named is mentioned.
        explains: Smallest share of the explainable error that the named causes together must explain if clear structure
            remains in the residual.
        visible: Factor on `material`: energy by which a cause at its starts must change the reading to be testable.
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


IN_SCENE = Rules(contest=8)
"""More candidates per place than by default, because the scene's causes join the sensor's."""
