"""Rules: the constants that decide what a diagnosis says, with their meaning.

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
        tie: Share of a cause's gain by which a rival may be worse, and share of its effect that a part must exceed
            to be reported, because no form is known more precisely.
        near_miss: Share of the required gain above which a cause that is not named is mentioned.
        explains: Smallest share of the explainable error that the named causes together must explain if clear structure
            remains in the residual.
        half: Least share of an effect in each half of an episode that is split in the middle.
        in_sample: Weight of an in-sample gain in the ranking of candidates, as a single fold may be the only one to
            show an effect.
        single_starts: Most starts of a cause that are also ranked one at a time.
        gauge_step: Relative change of the gain for the effect of a gauge.
        gauge_tie: Relative difference up to which a gauge alone promises as much as its cause.
        afresh: Number of causes from which no fit is repeated from the causes' own starts.
        rounds: Most rounds of adding, exchanging and dropping.
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
    explains: float = 0.05
    half: float = 0.1
    in_sample: float = 0.5
    single_starts: int = 8
    gauge_step: float = 0.05
    gauge_tie: float = 0.01
    afresh: int = 2
    rounds: int = 6
    visible: float = 2.0


IN_SCENE = Rules(contest=8)
"""More candidates per place than by default, because the scene's causes join the sensor's."""


@dataclass(frozen=True)
class Checks:
    """Thresholds of the checks that read faults off the streams: dead, stuck and swapped taxels, and the layout.

    Attributes:
        certain: z-score of a response, of a missing one, or of the gain of a swap, that is certain.
        consistent: Smallest z-score of a faint response summed over episodes that counts as a response.
        quiet: Largest standard deviation, in units of the noise, of a channel that does not respond.
        responds: Smallest gain of a channel that works; its inverse is the largest.
        silent: Largest gain of a channel that does not respond.
        unusual: Level of a channel, in units of its usual level or noise, at which no working channel stays.
        unmoved: Largest drift of a stuck taxel, relative to that of the other taxels of its pad and axis.
        late: Time constant of a taxel that responds late, in seconds.
        samples: Fewest samples that decide anything.
        repeats: Fewest episodes that decide, because in a single one the contact may be misplaced.
        most: Share of the episodes that must agree.
        changes: Share of samples at rest in which a reading changes, above which its noise must show.
        missing_changes: Fewest changes that noise should have caused and that are missing.
        misfit: Largest misfit of the other taxels of a pad, relative to the simulated energy, where the contact is as
            simulated.
        force: Force that is larger than any dead band, in newtons.
        share: Force, as a share of the peak, that is larger than any offset hidden by clipping at 0.
        pressed: Force, as a share of the peak, from which a taxel should respond.
        on_taxel: Force, in units of its tolerated position error, from which the contact is on the taxel.
        count: Largest level at rest, in quantisation steps, that does not matter.
        counts: Force, in quantisation steps, whose response shows in spite of rounding.
        pair_load: Least energy of a swapped taxel, relative to the most loaded one; weak loads depend on placing.
        residual: Largest residual with a swapped taxel's force, relative to that with the taxel's own force.
        moved: Share of the moved taxels that must correlate at least as well at their new place.
        equal: Largest difference between correlations that count as equal.
        load: Least load on a taxel that counts in a layout, relative to the most loaded one.
        better: Least gain in correlation for a layout fault to be named.
    """

    certain: float = 8.0
    consistent: float = 1.6
    quiet: float = 1.8
    responds: float = 0.3
    silent: float = 0.12
    unusual: float = 4.0
    unmoved: float = 0.2
    late: float = 0.1
    samples: int = 8
    repeats: int = 2
    most: float = 0.8
    changes: float = 0.5
    missing_changes: int = 20
    misfit: float = 0.1
    force: float = 0.6
    share: float = 0.2
    pressed: float = 0.06
    on_taxel: float = 15.0
    count: float = 0.6
    counts: float = 2.0
    pair_load: float = 0.1
    residual: float = 0.5
    moved: float = 0.7
    equal: float = 0.02
    load: float = 0.05
    better: float = 0.05


CHECKS = Checks()


@dataclass(frozen=True)
class Structure:
    """Limits of the tests for structure in the residual.

    Attributes:
        contact: Variance under load, relative to that at rest.
        common: Variance of the mean of a pad, relative to that of independent taxels.
        burst: Energy of the worst 1 % of frames at rest, relative to the median.
        line: Power of a spectral line, relative to its surroundings.
        neighbour: Energy per frame of a taxel's residual that a neighbour explains, in units of the noise.
        held: Share of frames that repeat although the force changes.
        shape: Held-out energy per sample that a shape explains, in units of the noise.
        tolerated: Relative error of the force that a shape may have, such as a pose error beyond first order.
        agree: z-score over episodes that a shape must reach; a gain in a single episode has 1.
        form: Share of the explained energy that may remain because the form of a true cause differs slightly.
        clear: Statistic, relative to its limit, above which the structure is clear.
        silent: Share of channels that never change, above which the recording cannot speak for the sensor.
        doubt: Share of a replay in doubt above which no verdict says that the error is explained.
    """

    contact: float = 2.5
    common: float = 4.0
    burst: float = 20.0
    line: float = 6.0
    neighbour: float = 3.0
    held: float = 0.1
    shape: float = 0.003
    tolerated: float = 0.004
    agree: float = 1.2
    form: float = 0.04
    clear: float = 2.0
    silent: float = 0.1
    doubt: float = 0.5


STRUCTURE = Structure()


@dataclass(frozen=True)
class Streams:
    """Limits for a recording to be diagnosed, and for its two streams to show the same motion.

    Attributes:
        seconds: Shortest recording, in seconds.
        few_seconds: Duration below which a warning says that intervals will be wide.
        frames: Fewest samples.
        gap: Gap that interrupts an episode, in typical intervals.
        forces: Plausible range of the peak force on a taxel, in newtons.
        gain: Largest ratio of measured to simulated force that a gain may explain.
        scale: Largest such ratio that drift, a field or noise may explain.
        follows: Least correlation between measured and simulated force.
        clearly: Correlation above which a sensor, or a taxel, clearly follows the simulation.
        stopped: Largest share of the recording during which one stream may stand still while the other changes.
        offset: Largest offset between the clocks, in seconds.
        delay: Largest delay attributed to the sensor, in seconds.
        overlap: Least share of the longest stretch over which the shifted streams must overlap.
        correlation: Correlation of the activities below which the streams do not show the same motion.
        doubtful: The same if the clocks differ, or if the forces share less variance than `shared`.
        shared: Share of the variance of the forces that both streams have in common.
        left: Largest share of the uncorrelated part that may remain after a clock shift.
        misplaced: Distance to another episode, relative to its own, below which the other fits better.
        same_motion: Relative difference of two simulated forces up to which the motion is repeated.
        same_load: Relative difference in load up to which two presses repeat each other.
        repeats: Fewest repeated presses that show whether a sensor has settled.
        unsettled: Distance of an unsettled press, relative to the largest distance within the later half.
        speeds: Ratio of the fastest to the slowest loading rate below which there is a single speed.
    """

    seconds: float = 2.0
    few_seconds: float = 20.0
    frames: int = 40
    gap: float = 10.0
    forces: tuple[float, float] = (0.01, 1000.0)
    gain: float = 5.0
    scale: float = 50.0
    follows: float = 0.2
    clearly: float = 0.5
    stopped: float = 0.1
    offset: float = 15.0
    delay: float = 0.5
    overlap: float = 0.5
    correlation: float = 0.25
    doubtful: float = 0.5
    shared: float = 0.25
    left: float = 0.5
    misplaced: float = 0.7
    same_motion: float = 0.02
    same_load: float = 0.15
    repeats: int = 5
    unsettled: float = 2.0
    speeds: float = 2.0


STREAMS = Streams()


@dataclass(frozen=True)
class Fitting:
    """How precisely a set of causes is fitted.

    Attributes:
        values: Number of values that suffice for a fit; longer recordings are thinned.
        ranked_values: The same for a ranking.
        interval: Longest interval between fitted frames, in seconds.
        interpolation: Largest error of interpolating the simulation between fitted frames, in noise energies.
        step: Finite-difference step, relative to a parameter's scale.
        channel_step: Finite-difference step of the array of a `PerChannelCause`.
        steps: Most Gauss-Newton steps.
        dampings: Most damping values tried for a step.
        trusted: Actual decrease of the energy, relative to the predicted one, below which the Jacobian is recomputed.
        converged: Relative decrease of the energy below which the descent stops.
        refits: Most evaluations for a fold.
        unsettled: Predicted decrease per channel, in units of the noise, below which a fold's fit stops.
        zero_rounds: Most alternations between fitting the zero offset and the other parameters.
        settled: Relative decrease of the energy below which the alternation stops.
        zero_steps: Gauss-Newton steps for a zero offset that the sensor reads nonlinearly.
        chord: Interval for the slope of the mean reading, in units of the noise before rounding.
        chords: Its limits, in quantisation steps.
    """

    values: int = 100_000
    ranked_values: int = 60_000
    interval: float = 0.05
    interpolation: float = 0.01
    step: float = 0.05
    channel_step: float = 0.02
    steps: int = 15
    dampings: int = 5
    trusted: float = 0.5
    converged: float = 1e-4
    refits: int = 4
    unsettled: float = 0.02
    zero_rounds: int = 4
    settled: float = 2e-3
    zero_steps: int = 3
    chord: float = 1.5
    chords: tuple[float, float] = (0.05, 0.2)


FITTING = Fitting()


@dataclass(frozen=True)
class NoiseLimits:
    """Limits for the estimates of noise, rounding and the zero offset.

    Attributes:
        rest: Least share of samples at rest for estimating the zero offset from them alone.
        samples: Fewest samples of an episode that count.
        piece: Length of the pieces whose scatter gives the uncertainty of the zero offset, in seconds.
        nearly_step: Tolerance of a gap between readings, in quantisation steps.
        common: Least share of the gaps that are one step.
        shifted: Phase above which readings are not multiples of the step, in steps.
        coarse: Noise below which differences between readings are a poor estimate of it, in steps.
        smooth: Noise above which the standard deviation at rest determines it, in steps.
        steep: Noise below which the mean reading is a staircase, in steps.
        hidden: Noise that may be invisible at rest, in steps.
        unsure: Relative uncertainty of the force, from calibration and contact position, which smooths the steps.
        pressed: Force above which clipping at 0 does not affect the noise, as a share of the largest.
        held: Time of constant force after which a slow sensor has settled, in seconds.
        lag: Time between compared counts, long enough to include some slow noise, in seconds.
        held_change: Change of a held force in that time, in steps.
        moving_change: The same if too few samples are held.
        compared: Fewest compared counts.
        kept_variance: Share of the variance of the covariates that their principal components retain.
        directions: Most principal components.
        constant: Relative spread up to which a covariate is constant.
        free_spread: Least spread of a covariate without contact, relative to the whole; below it, force confounds the
            effect.
    """

    rest: float = 0.05
    samples: int = 4
    piece: float = 1.0
    nearly_step: float = 0.03
    common: float = 0.15
    shifted: float = 0.1
    coarse: float = 1.2
    smooth: float = 0.6
    steep: float = 0.25
    hidden: float = 0.15
    unsure: float = 0.02
    pressed: float = 0.2
    held: float = 0.3
    lag: float = 0.15
    held_change: float = 0.1
    moving_change: float = 0.2
    compared: int = 300
    kept_variance: float = 0.99
    directions: int = 6
    constant: float = 1e-9
    free_spread: float = 0.25


NOISE = NoiseLimits()
