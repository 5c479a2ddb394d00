"""Gymnasium's ids of the environments, registered without importing Gymnasium, whichever of the two comes first."""

from __future__ import annotations

from lme.after_import import after_import
from lme.inputs.resources import resource_dir

NAMESPACE = "lme"

# Robot that drives in a map set unless another is chosen, where that is not a Jackal.
_ROBOTS = {
    "env1": "stage",
    "env2": "stage",
    "traps": "stage",
    "file": "stage",
    "indoor": "turtlebot2",
    "building": "turtlebot2",
    "real1": "turtlebot2",
    "real1_dynamic": "turtlebot2",
    "real2": "turtlebot2",
    "real3": "turtlebot2",
    "real4": "turtlebot2",
    "go2_a": "go2",
    "go2_b": "go2",
}


def register_with_gymnasium() -> None:
    """Register the environments now if Gymnasium has been imported, else as soon as it is.

    `gym.make("lme:lme/Barn-v0")` imports `lme`, but does not run it again if it has been imported before.
    """
    after_import("gymnasium", lambda _: _register())


def _register() -> None:
    """Give each map set of `conf/map/` an id: `lme/Real1Dynamic-v0` is real1_dynamic."""
    from gymnasium.envs.registration import register, registry

    for path in sorted((resource_dir("conf") / "map").glob("[!_]*.yaml")):
        name = "".join(part.capitalize() for part in path.stem.split("_"))
        env_id = f"{NAMESPACE}/{name}-v0"
        if env_id not in registry:
            register(
                env_id,
                entry_point="lme.gym.envs:NavigationEnv",
                vector_entry_point="lme.gym.envs:vector_env",
                kwargs={"map": path.stem, "robot": _ROBOTS.get(path.stem, "jackal")},
            )
