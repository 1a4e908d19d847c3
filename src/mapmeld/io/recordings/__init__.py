"""Maps out of recordings: rosbag1, rosbag2 (sqlite3 and MCAP) and bare MCAP files; extra "bags".

`map_topics` says what maps a recording holds, `map_states` gives their states in time order. Both read
the file as they go and decode nothing but maps.
"""

from mapmeld.io.recordings.messages import RecordingError
from mapmeld.io.recordings.opening import Damaged
from mapmeld.io.recordings.states import MapStates, map_states
from mapmeld.io.recordings.topics import MapTopic, RecordingInfo, map_topics, recording_info

__all__ = [
    "Damaged",
    "MapStates",
    "MapTopic",
    "RecordingError",
    "RecordingInfo",
    "map_states",
    "map_topics",
    "recording_info",
]
