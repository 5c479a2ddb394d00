"""How well people are tracked from the scan alone, by CLEAR-MOT: simulated worlds and real recordings."""
