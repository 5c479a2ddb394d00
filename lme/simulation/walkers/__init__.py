"""People who walk to where they want to be, around walls, each other and the robot."""
