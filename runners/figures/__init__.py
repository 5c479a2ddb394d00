"""Everything that is drawn: pure functions of records, or of episodes told again."""
