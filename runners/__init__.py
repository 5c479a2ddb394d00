"""The experiment layer: command line, configs to objects, fan-out, tracking, tables and figures."""
