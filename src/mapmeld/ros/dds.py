"""A participant of ROS's DDS domain by `cyclonedds`, for messages whose types have no wheel (`dds_types`).

Where a ROS installation provides tf2_msgs and map_msgs nothing of this is used.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from mapmeld.extras import MissingExtraError, required

# Other middleware's descriptions of types are complained of on stderr, though they do no harm: not said.
_QUIET = "<Tracing><Verbosity>none</Verbosity></Tracing>"
# As rmw_cyclonedds does for ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST: the loopback, and no multicast.
LOOPBACK = """<General><AllowMulticast>false</AllowMulticast><Interfaces>
<NetworkInterface name="lo" multicast="false" presence_required="true"/></Interfaces></General><Discovery>
<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
<Peers><Peer Address="127.0.0.1"/></Peers></Discovery>"""

_domains: dict[int, Any] = {}


def stays_on_this_machine() -> bool:
    """Whether the environment asks that nothing leaves this machine."""
    reach = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper()
    return reach in ("LOCALHOST", "OFF") or os.environ.get("ROS_LOCALHOST_ONLY", "") == "1"


def participant(domain_id: int) -> Any:
    """Return a participant of a DDS domain.

    Raises
    ------
    MissingExtraError
        There is no cyclonedds.
    """
    domain = required("cyclonedds.domain", "ros")
    if "CYCLONEDDS_URI" not in os.environ and domain_id not in _domains:
        settings = _QUIET + (LOOPBACK if stays_on_this_machine() else "")
        text = f'<CycloneDDS><Domain Id="any">{settings}</Domain></CycloneDDS>'
        _domains[domain_id] = domain.Domain(domain_id, text)  # lives as long as its participants
    return domain.DomainParticipant(domain_id)


def quality(*, latched: bool, reliable: bool = True) -> Any:
    """Return the quality of service of a topic."""
    core, util = required("cyclonedds.core", "ros"), required("cyclonedds.util", "ros")
    policy = core.Policy
    reliability = policy.Reliability.Reliable(util.duration(seconds=1))
    return core.Qos(
        reliability if reliable else policy.Reliability.BestEffort,
        policy.Durability.TransientLocal if latched else policy.Durability.Volatile,
        policy.History.KeepLast(1 if latched else 100),
    )


def prepare_fastdds() -> None:
    """Let Fast DDS not ask for descriptions of types, before its first participant.

    A profile that the user has is left as it is.
    """
    if "FASTDDS_DEFAULT_PROFILES_FILE" not in os.environ:
        profile = Path(__file__).with_name("fastdds_profile.xml")
        os.environ["FASTDDS_DEFAULT_PROFILES_FILE"] = str(profile)


def available() -> bool:
    """Whether there is cyclonedds."""
    try:
        required("cyclonedds.domain", "ros")
    except MissingExtraError:
        return False
    return True
