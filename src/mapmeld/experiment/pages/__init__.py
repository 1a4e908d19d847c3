"""The report of an experiment: pictures of maps, charts, and one page with all of it."""
