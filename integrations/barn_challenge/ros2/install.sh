#!/bin/bash
# Installs lme into /lme, for the container's own Python 3.12 and ROS 2 Jazzy, and drives one world over ROS 2.
# Run it while the container is built, where there is a network, after `source /opt/ros/jazzy/setup.bash`. LME_PREFIX
# names another folder, for a user who is not root.
set -eo pipefail
here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
export LME_PREFIX="${LME_PREFIX:-/lme}"

[ "$(id -u)" != 0 ] || apt-get install -y python3-venv
python3 -m venv --system-site-packages "$LME_PREFIX"
"$LME_PREFIX/bin/pip" install "$here/../../../lme[live]"
cp "$here/lme_node" "$LME_PREFIX/bin/"

# The container has no network and may be read-only when it runs: compile the kernels now. The node drives lme's own
# simulator with the challenge's topics, so a faulty installation stops the build.
export NUMBA_CACHE_DIR="$LME_PREFIX/numba" ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
mkdir -p "$NUMBA_CACHE_DIR"
cd "$(mktemp -d)"
challenge=(robot=jackal robot.control_rate=20 robot.footprint.length=0.458 robot.footprint.width=0.416 topics=jackal_ros2 topics.scan=front/scan)
"$LME_PREFIX/bin/lme" live ros2 "${challenge[@]}" live.use_sim_time=true system=lme_plus people=none &
trap "kill $!" EXIT
"$LME_PREFIX/bin/lme" live simulator --ros2 "${challenge[@]}" map=barn map.worlds=[0] map.time_limit=1200 live.goal=action |
    tee driven
grep --quiet success driven
