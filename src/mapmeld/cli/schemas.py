"""Names of the schemas of ``--json`` (docs/json.md).

A schema's number grows when a field changes its meaning or goes away; fields may be added without.
"""

BAG_INFO_SCHEMA = "mapmeld.bag.info/1"
DIFF_SCHEMA = "mapmeld.diff/1"
FIND_SCHEMA = "mapmeld.find/1"
FOLLOW_SCHEMA = "mapmeld.follow/1"
GRAPH_SCHEMA = "mapmeld.graph/1"
MATCH_SCHEMA = "mapmeld.match/1"
MERGE_SCHEMA = "mapmeld.merge/1"
NAVIGABILITY_SCHEMA = "mapmeld.navigability/1"
REBASE_SCHEMA = "mapmeld.rebase/1"
STEP_SCHEMA = "mapmeld.follow.step/1"
TRANSFORM_POINTS_SCHEMA = "mapmeld.transform-points/1"
