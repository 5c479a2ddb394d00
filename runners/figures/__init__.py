"""Everything that is drawn: pure functions of records, or of traces of episodes."""
