"""`sonarhw import` of ROS 1 and ROS 2 bags that rosbags writes, and of files that are none."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sonarhw_cli.app import run

from sonarhw.log import read_log
from sonarhw.readings import Reading

# in the extra `ros`; `make test` installs it
rosbag1 = pytest.importorskip("rosbags.rosbag1")
rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

RANGES = (1.0, 0.01, math.inf, 2.5, 9.0)  # m; limits 0.02 to 4
ECHOES = [1.0, None, None, 2.5, None]


def stamped(store: Any, seconds: int, ros1: bool) -> Any:
    header, time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    return header(seq=0, stamp=time(seconds, 0), frame_id="sonar") if ros1 else header(time(seconds, 0), "sonar")


def messages(store: Any, ros1: bool) -> list[tuple[str, str, Any]]:
    """Two sweeps, and a ping of each of two sonars: topic, type and message."""
    scan, sonar = store.types["sensor_msgs/msg/LaserScan"], store.types["sensor_msgs/msg/Range"]
    numbers = (-0.5, 0.5, 0.25, 0.0, 0.1, 0.02, 4.0)  # angles, times and limits
    sweep = scan(stamped(store, 1, ros1), *numbers, np.array(RANGES, np.float32), np.zeros(0, np.float32))
    extra = {"variance": 0.0} if "variance" in sonar.__dataclass_fields__ else {}
    limits = {"radiation_type": 0, "field_of_view": 0.5, "min_range": 0.02, "max_range": 4.0}
    pings = [sonar(header=stamped(store, 2, ros1), **limits, range=far, **extra) for far in (0.75, 5.0)]
    return [
        ("/scan", scan.__msgtype__, sweep),
        ("/scan", scan.__msgtype__, sweep),
        ("/sonar/left", sonar.__msgtype__, pings[0]),
        ("/sonar/right", sonar.__msgtype__, pings[1]),
    ]


def fill(writer: Any, store: Any, ros1: bool) -> None:
    connections: dict[str, Any] = {}
    for number, (topic, kind, message) in enumerate(messages(store, ros1)):
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, kind, typestore=store)
        data = store.serialize_ros1(message, kind) if ros1 else store.serialize_cdr(message, kind)
        writer.write(connections[topic], (number + 1) * 10**9, data)


def ros1_bag(folder: Path) -> Path:
    with rosbag1.Writer(folder / "a.bag") as writer:
        fill(writer, typesys.get_typestore(typesys.Stores.ROS1_NOETIC), ros1=True)
    return folder / "a.bag"


def ros2_bag(folder: Path, plugin: Any) -> Path:
    with rosbag2.Writer(folder / "bag", version=9, storage_plugin=plugin) as writer:
        fill(writer, typesys.get_typestore(typesys.Stores.ROS2_HUMBLE), ros1=False)
    return folder / "bag"


def imported(bag: Path, *options: str) -> tuple[Reading, ...]:
    out = bag.parent / "out.mcap"
    assert run(["import", str(bag), "--out", str(out), "--force", *options]) == 0
    return read_log(out).readings


@pytest.mark.parametrize("kind", ["ros1", rosbag2.StoragePlugin.SQLITE3, rosbag2.StoragePlugin.MCAP])
def test_scans_are_sweeps_and_sonars_are_a_step_apart(tmp_path: Path, kind: Any) -> None:
    bag = ros1_bag(tmp_path) if kind == "ros1" else ros2_bag(tmp_path, kind)
    readings = imported(bag, "--topic", "/scan")
    angles = [math.degrees(angle) for angle in (-0.5, -0.25, 0.0, 0.25, 0.5)]
    assert [math.degrees(one.angle) for one in readings] == pytest.approx(angles * 2, abs=1e-5)
    assert [one.range for one in readings] == [one and pytest.approx(one, abs=1e-6) for one in ECHOES * 2]
    assert [one.sweep for one in readings] == [0] * 5 + [1] * 5
    assert readings[5].time - readings[0].time == pytest.approx(1.0, abs=1e-5)
    left = imported(bag, "--topic", "/sonar/left", "--step", "90")
    right = imported(bag, "--topic", "/sonar/right", "--step", "90")
    assert [(math.degrees(one.angle), one.range) for one in (*left, *right)] == [
        (pytest.approx(90, abs=1e-5), pytest.approx(0.75, abs=1e-6)),
        (pytest.approx(180, abs=1e-5), None),
    ]
    assert len(imported(bag, "--step", "90")) == 12
    assert run(["import", str(bag), "--out", str(tmp_path / "all.mcap")]) == 2  # where the sensors point is unknown


def moving(store: Any, ros1: bool, framed: bool) -> list[tuple[str, str, Any]]:
    """Poses at 0 and 4 s around the messages above: of odometry, or of frames that are turned by 90° in the map."""
    kinds = store.types
    vector, quaternion = kinds["geometry_msgs/msg/Vector3"], kinds["geometry_msgs/msg/Quaternion"]

    def turned(yaw: float) -> Any:
        return quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))

    if framed:
        stamped_kind, transform = kinds["geometry_msgs/msg/TransformStamped"], kinds["geometry_msgs/msg/Transform"]

        def frame(parent: str, child: str, x: float, yaw: float) -> Any:
            header = stamped(store, 0, ros1)
            header.frame_id = parent
            return stamped_kind(header, child, transform(vector(x, 0.0, 0.0), turned(yaw)))

        many = kinds["tf2_msgs/msg/TFMessage"]
        return [
            (
                "/tf",
                many.__msgtype__,
                many([frame("map", "odom", 5.0, math.pi / 2), frame("odom", "base_link", x, yaw)]),
            )
            for x, yaw in ((0.0, 3.1), (2.0, 3.1 + 0.4))
        ]
    pose, point = kinds["geometry_msgs/msg/Pose"], kinds["geometry_msgs/msg/Point"]
    placed, moved = kinds["geometry_msgs/msg/PoseWithCovariance"], kinds["geometry_msgs/msg/TwistWithCovariance"]
    still = moved(kinds["geometry_msgs/msg/Twist"](vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0)), np.zeros(36))
    odometry = kinds["nav_msgs/msg/Odometry"]
    return [
        (
            "/odom",
            odometry.__msgtype__,
            odometry(
                stamped(store, 0, ros1), "base", placed(pose(point(x, 0.0, 0.0), turned(yaw)), np.zeros(36)), still
            ),
        )
        for x, yaw in ((0.0, 3.1), (2.0, 3.1 + 0.4))
    ]


@pytest.mark.parametrize("ros1", [True, False], ids=["ROS 1", "ROS 2"])
@pytest.mark.parametrize("framed", [True, False], ids=["frames", "odometry"])
def test_each_reading_has_the_pose_at_its_time(tmp_path: Path, ros1: bool, framed: bool) -> None:
    """Messages are 1 s apart: a quarter of the way from the first pose to the second, then a half of it."""
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC if ros1 else typesys.Stores.ROS2_HUMBLE)
    if ros1:
        text = "geometry_msgs/TransformStamped[] transforms"
        store.register(typesys.get_types_from_msg(text, "tf2_msgs/msg/TFMessage"))
    writer = rosbag1.Writer(tmp_path / "a.bag") if ros1 else None
    bag = writer or rosbag2.Writer(tmp_path / "bag", version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
    scans, poses = messages(store, ros1)[:2], moving(store, ros1, framed)
    with bag as opened:
        connections: dict[str, Any] = {}
        for seconds, (topic, kind, message) in zip((0, 1, 2, 4), (poses[0], *scans, poses[1]), strict=True):
            if topic not in connections:
                connections[topic] = opened.add_connection(topic, kind, typestore=store)
            data = store.serialize_ros1(message, kind) if ros1 else store.serialize_cdr(message, kind)
            opened.write(connections[topic], (100 + seconds) * 10**9, data)
    readings = imported(tmp_path / ("a.bag" if ros1 else "bag"))
    for reading, share in zip(readings, [0.25] * 5 + [0.5] * 5, strict=True):
        x, yaw = 2 * share, 3.1 + 0.4 * share
        expected = (5.0, x, yaw + math.pi / 2) if framed else (x, 0.0, yaw)
        assert reading.pose[:2] == pytest.approx(expected[:2], abs=1e-6)
        assert math.remainder(reading.pose[2] - expected[2], math.tau) == pytest.approx(0, abs=1e-6)


def damaged(folder: Path, kind: str) -> Path:
    match kind:
        case "empty":
            (folder / "a.bag").write_bytes(b"")
            return folder / "a.bag"
        case "torn":
            content = ros1_bag(folder).read_bytes()
            (folder / "a.bag").write_bytes(content[: len(content) // 2])
            return folder / "a.bag"
        case "database":
            bag = ros2_bag(folder, rosbag2.StoragePlugin.SQLITE3)
            next(bag.glob("*.db3")).write_bytes(b"SQLite format 3\0" + b"\7" * 4000)
        case _:
            bag = ros2_bag(folder, rosbag2.StoragePlugin.MCAP)
            next(bag.glob("*.mcap")).write_bytes(b"no")
    return folder / "bag"


@pytest.mark.parametrize("kind", ["empty", "torn", "database", "mcap"])
def test_a_damaged_bag_is_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str) -> None:
    bag = damaged(tmp_path, kind)
    assert run(["import", str(bag), "--out", str(tmp_path / "out.mcap")]) == 2
    error = capsys.readouterr().err
    assert f"{bag}: is not a complete ROS bag: " in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out.mcap").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--topic", "/map"], "no topic '/map'; topics with ranges: /scan, /sonar/left, /sonar/right"),
        (["--range", "m"], "--range m: only for text"),
        (["--threshold", "0.5"], "--threshold 0.5: only for formats with traces"),
    ],
)
def test_options_that_do_not_fit_a_bag_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    assert run(["import", str(ros1_bag(tmp_path)), "--out", str(tmp_path / "out.mcap"), *options]) == 2
    assert message in capsys.readouterr().err
