"""InsertionEnv: the paper's blind insertion tasks as gymnasium environments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import mujoco
import numpy as np
from numpy.typing import NDArray

import paxisim

from .engines import make_scene
from .engines.scene import Grasp
from .methods import NOTHING_DRAWN, find_method
from .observations import PRIVILEGED as PRIVILEGED
from .observations import RAW as RAW
from .observations import make_spaces, observed_poses
from .reward import reward_terms, weighted
from .tasks import Parameters, find_task
from .transfer import Gap, StandIn

CONTROL_DT = 0.05


class InsertionEnv(gymnasium.Env[dict[str, NDArray[np.float32]], NDArray[np.float32]]):
    """One task, with the observations of one method.

    The action, in [-1, 1], times the task's action scale is the displacement of the fingertip's goal from the current
    fingertip position, along the axes that are not frozen. Rotation and the frozen axis keep their initial values.

    The observation has these entries:

    - ``"p"`` ``(6,)``: p_t, the fingertip's position (m) in the base's frame, and its rotation vector (rad)
      relative to pointing straight down. Zeros where the hole is hidden.
    - ``"tactile"``: the encoded history, see `paxisim.History`; absent for NT.
    - ``"raw"`` ``(pads, 3, rows, cols)``: for methods that randomise, the newest reading before the chain, in newtons.
      For the replay buffer only.
    - ``"privileged"`` ``(12,)``: position and rotation vector of the peg, then of the fingertip, in the base's frame.
      For the critic only.

    The episode is truncated after the task's number of steps. It continues after success because the paper's bonus is
    part of every step's reward: an episode that ended with success would earn less than one that hovers in the hole.
    ``info["is_success"]`` tells whether the insertion has succeeded in this episode; ``info["reward_terms"]`` holds the
    terms of the reward.

    Attributes:
        scene: The hand, the peg and its base.
        task: The task.
        method: The method.
        terminates: Whether the first success ends an episode.
        stand_in: The sensor that replaces the drawn one, or None; may be changed between episodes.
        has_gap: Whether the robot differs from the simulated one in each episode.
        layout: Taxel layout of each pad.
        history: The encoded history of readings that the policy sees.
        raw: ``(pads, 3, rows, cols)`` newtons: the newest reading, before the chain.
        reading: The newest reading after the chain and before the encoding.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012 - gymnasium's own name and type

    def __init__(
        self,
        task: str = "SX-2mm",
        method: str = "GCS",
        *,
        engine: str = "robosuite",
        gcs: paxisim.GCS | None = None,
        sensor: paxisim.Chain | Callable[[paxisim.TaxelLayout], StandIn] | None = None,
        parameters: Parameters | None = None,
        gap: bool = False,
        ranges: paxisim.SceneRanges | None = None,
        terminate_on_success: bool = False,
        render_mode: str | None = None,
    ) -> None:
        """Build the environment.

        Args:
            task: Name of a task.
            method: Name of a method.
            engine: Engine of the simulation: ``"robosuite"``, the reference, or ``"native"``, about four times as fast.
            gcs: Randomisation drawn for each episode, such as
                ``paxisim.GCS.around(diagnosis.model, diagnosis.intervals)``. Default: that of the method.
            sensor: A sensor in place of the simulated one: the simulator's readings pass through its chain instead of
                one drawn for each episode. With a chain alone the pads are flat; a function gets the pads' layout and
                returns the sensor with its surface and gel.
            parameters: Values that the paper does not specify.
            gap: Draw differences between the robot and the simulated one for each episode, see `Gap`.
            ranges: Ranges of the pads' friction, stiffness, mounts and surfaces, drawn for each episode that has
                neither a sensor nor a gap. Default: nothing is drawn.
            terminate_on_success: End the episode with the first success, as an evaluation does.
            render_mode: ``"rgb_array"`` or None.

        Raises:
            UnknownNameError: There is no such task, method or engine.
            MissingExtraError: The engine is robosuite's, and robosuite is not installed.
            UnsupportedError: The ranges belong to a scene with another number of pads.
            InvalidValueError: The render mode is not supported, or the chains do not fit the pads or need a covariate
                other than ``gripper_opening`` (m).
        """
        self.task, self.method = find_task(task), find_method(method)
        self.gcs = self.method.gcs if gcs is None else gcs
        if render_mode not in (None, "rgb_array"):
            raise paxisim.InvalidValueError(f"render_mode must be None or 'rgb_array', got {render_mode!r}")
        self.parameters = parameters or Parameters()
        self.render_mode, self.terminates = render_mode, terminate_on_success
        self.scene = make_scene(engine, self.task, self.parameters)
        self._tactile = self.scene.tactile
        self.layout, self._pads = self._tactile.pads.layout, len(self._tactile.pads)
        self._variation = self._tactile.vary(ranges or paxisim.SceneRanges())
        if isinstance(sensor, paxisim.Chain):
            self.stand_in: StandIn | None = StandIn(sensor)
        else:
            self.stand_in = None if sensor is None else sensor(self.layout)
        self.has_gap = gap
        self._gap: Gap | None = None
        self.history = self.method.history(self.task, self.layout)
        frame = (self._pads, 3, self.layout.rows, self.layout.cols)
        observations, actions = make_spaces(self.task, self.history, frame, raw=self.gcs is not None)
        self.observation_space: Any = observations
        self.action_space = actions
        self._axes = list(self.task.axes)
        self._chain: paxisim.Chain = paxisim.Chain([])
        self._state: Any = ()
        self._home = np.zeros(3)
        self._steps, self._succeeded = 0, False
        self.raw = self.reading = np.zeros(frame, dtype=np.float32)
        self._renderer: mujoco.Renderer | None = None
        self._check_chains()

    @property
    def _draw(self) -> paxisim.GCS:
        """Randomisation from which surfaces and chains are drawn."""
        return NOTHING_DRAWN if self.gcs is None or self.stand_in is not None else self.gcs

    def _check_chains(self) -> None:
        chain = self._draw.sample(np.random.default_rng(0), layout=self.layout, pads=self._pads)
        if self.stand_in is not None:
            chain = self.stand_in.chain
        force = np.zeros_like(self.raw)
        chain.step(force, chain.initial_state(force, self._covariates()), CONTROL_DT, self._covariates())

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
        """Begin an episode: draw its start, grasp, surface and chain, and close the fingers on the peg."""
        super().reset(seed=seed)
        self._chain = self.begin()
        self._steps, self._succeeded = 0, False
        self.history.reset()
        force = self._tactile.read()
        self._state = self._chain.initial_state(force, self._covariates())
        self._feel(force, 0.0)
        return self._observe(), {"is_success": False}

    def begin(self) -> paxisim.Chain:
        """Draw an episode's start, grasp, surface and chain, and close the fingers on the peg.

        Returns:
            The chain through which the readings of the episode pass.
        """
        rng = self.np_random
        bottom = rng.uniform(*self.parameters.start)
        grasp = Grasp.draw(rng, self.parameters)
        surface = self._draw.sample_surface(rng, layout=self.layout, pads=self._pads)
        stand_in = self.stand_in
        if stand_in is not None:
            chain = stand_in.chain
            surface = surface if stand_in.surface is None else stand_in.surface
            self._tactile.set_gel(stand_in.gel or self._tactile.gel)
        else:
            chain = self._draw.sample(rng, layout=self.layout, pads=self._pads)
            if not self.has_gap:
                surface = surface + self._variation.draw(rng).heights
        self.scene.place(bottom, grasp, surface)
        if self.has_gap:
            self._gap = Gap.draw(rng)
            self.scene.tune(self._gap.stiffness, self._gap.friction)
        self._home = self.scene.fingertip[0]
        return chain

    def step(
        self, action: NDArray[np.floating]
    ) -> tuple[dict[str, NDArray[np.float32]], float, bool, bool, dict[str, Any]]:
        """Apply an action for 50 ms."""
        action = np.clip(np.asarray(action, dtype=float), -1, 1)
        goal = self._home.copy()
        goal[self._axes] = self.scene.fingertip[0][self._axes] + self.task.action_scale * action
        self.scene.move(goal)
        self._steps += 1
        self._feel(self._tactile.read(), CONTROL_DT)
        state = self.scene.insertion
        self._succeeded |= bool(state.success)
        terms = {n: float(v) for n, v in reward_terms(state, action, self.parameters.epsilon).items()}
        info = {"is_success": self._succeeded, "reward_terms": terms}
        truncated = self._steps >= self.task.max_steps
        return self._observe(), weighted(terms), self.terminates and bool(state.success), truncated, info

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Return a picture ``(480, 640, 3)`` of the scene.

        Raises:
            UnsupportedError: MuJoCo cannot render here, for example without a display.
        """
        if self.render_mode is None:
            return None
        model, data = self.scene.model_and_data
        renderer = self._renderer
        if renderer is None:
            try:
                renderer = self._renderer = mujoco.Renderer(model, 480, 640)
            except Exception as error:  # each OpenGL backend raises its own
                raise paxisim.UnsupportedError(
                    f"cannot draw the scene ({error}): without a display, set MUJOCO_GL=egl or MUJOCO_GL=osmesa"
                ) from error
        camera, options = mujoco.MjvCamera(), mujoco.MjvOption()
        camera.lookat, camera.distance = self.scene.hole_top + [0, 0, 0.03], 0.4
        camera.azimuth, camera.elevation = 150, -20
        options.geomgroup[0], options.sitegroup[:] = 0, 0
        renderer.update_scene(data, camera, options)
        return renderer.render()

    def close(self) -> None:
        """Free the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _feel(self, force: NDArray[np.float32], dt: float) -> None:
        self.raw = np.asarray(force, dtype=np.float32)
        force, self._state = self._chain.step(force, self._state, dt, self._covariates())
        self.reading = np.asarray(force, dtype=np.float32)
        self.history.append(self.reading)

    def _covariates(self) -> dict[str, float]:
        return {"gripper_opening": self.scene.opening}

    def _observe(self) -> dict[str, NDArray[np.float32]]:
        observation = observed_poses(self.scene, *self.scene.fingertip, *self.scene.peg)
        if self._gap is not None and not self.task.hole_is_hidden:
            observation["p"] = self._gap.believed(observation["p"], self.np_random)
        if "tactile" in self.observation_space.spaces:
            observation["tactile"] = self.history.read()
        if RAW in self.observation_space.spaces:
            observation[RAW] = self.raw
        return observation
