"""Questions about a study: select a part, apply a condition, convert units, and return a table or labelled arrays."""
