"""A value that a setting cannot have is refused in one line, which names the key."""

import re

import pytest
import yaml

from lme.config.presets import load_settings
from lme.errors import InputError

WRONG = {  # settings of each option, each alone
    "guide/lme": """candidates.number=0 candidates.max_range=0.0 candidates.max_range=.inf candidates.distribution=disc
        blocking=ray surmount=all history_length=0 history_min_distance=-0.1 history_min_distance=.nan""",
    "guide/lme_plus": "reach=0 margin=-1 travel.comfort=0 travel.slowdown=-1",
    "guide/learned_subgoal": "period=0.0 margin=-1.0",
    "guide/navfn": "map_yaw=4.0",
    "guide/tangent_bug": "margin=0.0 keep=-1.0 leave_gain=.nan",
    "planner/apf": "attraction=0.0 repulsion=-1.0 spread=4.0",
    "planner/dclp": "lookahead=0.0 goal_within=0.0 reported_limits.front=-1.0",
    "planner/drl_vo": """fov=7.0 no_return=40.0 lookahead=0.0 v_free=-1.0 trained_outline=[0.1]
        trained_outline=[-0.1,0.2]""",
    "planner/dwa": """heading=-0.1 clearance=-0.1 velocity=-0.1 margin=-0.1 margin_time=-0.1 clear_way=0.0
        heading_time=0.0 v_samples=1 omega_samples=1 omega_samples=20""",
    "planner/eband": """horizon=0.0 spacing=-1.0 max_radius=.nan min_radius=1.5 overlap=1.1 external_gain=-0.1
        iterations=0 recursion=-1 v_max=0.0 v_min=-0.1 v_min=0.8 rotation_threshold=.inf margin=-0.01""",
    "planner/lics": "los=0.0",
    "planner/maer_nav": "sectors=0 fov=7.0 v_min=0.1",
    "planner/min_time": "margin=-1 brake=-1 latency=-0.1",
    "planner/motion_tubes": """long_length=0.0 near_length=1.0 short_length=2.1 heading_max=2.0 heading_step=0.0
        goal_bins=-1 free_high=0.1 side_margin=-0.1 turn_margin=-0.1 back_speed=0.0 acceleration=.nan""",
    "planner/mppi": "time_steps=5 batch_size=0 temperature=0.0 vx_min=0.2",
    "planner/onnx": """inputs=[scam] inputs=[] inputs=[scan,scan] scan.clip=0.0 scan.scaled=[1.0] target.form=round
        twist.v=-1.0 action.v=[1.0,1.0]""",
    "planner/orca": "horizon=0.0 share=0.0 share=1.1 clearance=-0.1",
    "planner/ros_dwa": """sim_time=0.0 vx_samples=1 min_vel_x=0.6 escape_vel=0.1 planner_patience=-1.0
        yaw_goal_tolerance=0.0 costmap.cell_size=-1.0 costmap.size=-1.0 costmap.obstacle_range=-1.0
        costmap.update_rate=-1.0""",
    "planner/ros_eband": """eband_min_relative_overlap=0.0 costmap_weight=0.0 num_iterations_eband_optimization=0
        eband_equilibrium_approx_max_recursion_depth=0 max_vel_lin=0.0 min_vel_lin=-0.1 min_vel_lin=1.1 k_prop=0.0
        plan_yaw=4.0 planner_patience=-1.0 acc_lim_theta=0.0 costmap.size=-1.0""",
    "planner/s3_fisvfh": "window=0.0 depth=0 smoothing=0.0 turn=1.1 turn_span=4.0 sector=0.0",
    "planner/simple": """heading_tolerance=-0.1 heading_tolerance=.nan pd_below=-0.1 pd_below=.inf kp=-0.1 kp=.nan
        kd=-0.1 kd=.inf alpha_v=0.0 alpha_v=-0.1 alpha_v=.nan alpha_omega=0.0 alpha_omega=-0.1 alpha_omega=.inf""",
    "planner/teb": """dt_ref=0.0 min_samples=1 max_samples=2 no_inner_iterations=0 weight_obstacle=-1.0
        divergence_detection_max_chi_squared=0.0""",
    "planner/tube_vote": """speeds=[] speeds=[1.0] radius_min=0.0 radius_max=0.01 radii=1 sampling=0.0
        side_margin=-0.1 cost_max=0.0 acceleration=0.0 hold_time=-1.0 fast=-1.0""",
    "planner/vfh_plus": "window=0.0 cell_size=0.00001 peak=0.5 density_low=7.0 sector_angle=2.0",
    "filter/stopping": "margin=-1.0 latency=-1.0 lag=-1.0",
    "sim/fast": "max_step=0.0 max_step=-0.01 max_step=.nan max_step=.inf",
    "sim/physics": "substep=0.0 substep=.nan grip=0.0 grip=-1.0",
    "sim/skid": "friction=ice yaw_noise=-1.0 scan_rate=0.0 check_time=0.0 latency=-1.0",
}


@pytest.mark.parametrize("option", WRONG)
def test_a_wrong_value_is_named_with_what_would_be_right(option, says):
    said = []
    for word in WRONG[option].split():
        key, _, text = word.partition("=")
        settings = yaml.safe_load(text)
        for part in reversed(key.split(".")):
            settings = {part: settings}
        with pytest.raises(InputError, match=re.escape(f"{option.partition('/')[0]}.{key}")) as error:
            load_settings(option, **settings)
        said.append(str(error.value))
    assert not any("\n" in line for line in said)
    says("\n".join(said))
