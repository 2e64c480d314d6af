"""What a bag holds, to compare it with another one."""

from pathlib import Path

from c3_station.bag import BagReader
from msgs_json.topics import MISSION_EVENTS


def recorded(bag: Path) -> dict[str, list[tuple[int, bytes]]]:
    """
    Return time and bytes of every message, by topic.

    Within one tick different nodes may log in any order; there is no order between publishers in
    ROS. So the log is sorted; every other topic has one publisher and is returned as recorded.
    """
    topics: dict[str, list[tuple[int, bytes]]] = {}
    with BagReader(bag) as reader:
        for message in reader.messages():
            topics.setdefault(message.topic, []).append((message.log_time_ns, message.cdr))
    topics[MISSION_EVENTS.name].sort()
    return topics
