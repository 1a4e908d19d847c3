"""The steps of the experiment, each a function of one unit of work, to be run anywhere and in any order."""
