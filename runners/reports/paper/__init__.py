"""A folder for a paper: tables, figures, methods in words, the citation and the commands of recorded runs."""
