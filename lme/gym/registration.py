"""Gymnasium's ids of the environments. Importing this module registers them.

`lme.gym.discovery` imports it as soon as `lme` and Gymnasium are both imported.
"""

from gymnasium.envs.registration import register, registry

NAMESPACE = "lme"

MAPS = {  # name in the id: map set, and the robot that drives there unless another is chosen
    "Barn": ("barn", "jackal"),
    "DynaBarn": ("dynabarn", "jackal"),
    "Social": ("social", "jackal"),
    "Env1": ("env1", "stage"),
    "Env2": ("env2", "stage"),
    "Traps": ("traps", "stage"),
    "Indoor": ("indoor", "turtlebot2"),
    "Real1": ("real1", "turtlebot2"),
    "Real1Dynamic": ("real1_dynamic", "turtlebot2"),
    "Real2": ("real2", "turtlebot2"),
    "Real3": ("real3", "turtlebot2"),
    "Real4": ("real4", "turtlebot2"),
    "Go2A": ("go2_a", "go2"),
    "Go2B": ("go2_b", "go2"),
    "Empty": ("empty", "jackal"),
    "File": ("file", "stage"),  # needs map_config={"path": …}
    "Tracks": ("tracks", "jackal"),  # needs map_config={"path": …}
    "Building": ("building", "turtlebot2"),  # needs map_config={"paths": […]}
}


def _register() -> None:
    for name, (map_set, robot) in MAPS.items():
        env_id = f"{NAMESPACE}/{name}-v0"
        if env_id not in registry:
            register(
                env_id,
                entry_point="lme.gym.single:NavigationEnv",
                vector_entry_point="lme.gym.vector:NavigationVectorEnv",
                kwargs={"map": map_set, "robot": robot},
            )


_register()
