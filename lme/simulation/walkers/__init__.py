"""People who walk to their destinations, around walls, each other and the robot."""
