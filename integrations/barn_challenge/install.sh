#!/bin/bash
# Installs lme into /lme, next to the container's own Python and ROS: Python 3.11 and ROS Noetic's rospy from RoboStack.
# Run it as root while the container is built, where there is a network.
set -euo pipefail
here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
prefix="${LME_PREFIX:-/lme}"
unset PYTHONPATH LD_LIBRARY_PATH

apt-get install -y curl bzip2
curl -L https://micro.mamba.pm/api/micromamba/linux-64/latest | tar -xj -C /tmp bin/micromamba
/tmp/bin/micromamba create -y -p "$prefix" -c robostack-noetic -c conda-forge python=3.11 \
    ros-noetic-{rospy,std-msgs,sensor-msgs,nav-msgs,geometry-msgs,tf2-msgs,rosgraph-msgs} \
    ros-noetic-{actionlib,move-base-msgs,visualization-msgs,diagnostic-msgs}
"$prefix/bin/pip" install "$here/../.."

# The container has no network and may be read-only when it runs: compile the kernels now.
export NUMBA_CACHE_DIR="$prefix/numba" PATH="$prefix/bin:$PATH"
cd /tmp && lme eval map=barn map.worlds=[0] runs=1 tracking=none hydra.run.dir=/tmp/compiled
