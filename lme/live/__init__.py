"""Driving a real robot: from the messages of its sensors to observations, and from decisions to safe commands.

Nothing here imports ROS. Messages are any objects with the fields of their ROS type.
"""
