"""`lme play`: a page on this machine in which the user draws worlds, watches systems think, and takes over."""
