"""Reading recordings: every format, topics by type, and one clear line for whatever is wrong with a file."""

import contextlib
import os
import sqlite3
from contextlib import suppress
from pathlib import Path

import pytest

pytest.importorskip("rosbags")

from rosbags.highlevel import AnyReader

from lme.errors import InputError
from lme.types import Pose
from runners.cli.commands.replay import main
from runners.recordings.bags import Bag
from runners.recordings.topics import BagTopicsConfig, choose, table
from tests.made_bags import BEGAN, SECOND, BagMaker, drive

FORMATS = (".bag", ".db3", ".mcap")


@pytest.fixture(params=FORMATS)
def path(request, tmp_path):
    return drive(request.param, steps=12).write(tmp_path)


def one_line(error):
    text = str(error.value)
    assert "\n" not in text
    return text


def test_every_format_reads_alike(path):
    with Bag(path) as bag:
        topics = {topic.name: topic for topic in bag.topics()}
        assert topics["/scan"].number == topics["/odom"].number == 12
        assert topics["/scan"].types == ("sensor_msgs/msg/LaserScan",)
        assert bag.duration_s == pytest.approx(1.1, abs=1e-6)
        messages = list(bag.messages(["/odom", "/cmd_vel"], start=BEGAN + SECOND // 2))
    assert len(messages) == 14
    assert [m.recorded for m in messages] == sorted(m.recorded for m in messages)
    assert {m.topic for m in messages} == {"/odom", "/cmd_vel"}


def test_the_folder_of_a_ros2_recording_will_do(tmp_path):
    path = drive(".mcap", steps=3).write(tmp_path)
    with Bag(path.parent) as bag:
        assert len(list(bag.messages(["/scan"]))) == 3


def test_a_pipe_in_the_folder_of_a_recording_is_not_waited_for(tmp_path, says):
    folder = drive(".mcap", steps=3).write(tmp_path).parent
    (folder / "metadata.yaml").touch()
    os.mkfifo(folder / "more.mcap")
    with says.raises(InputError):
        Bag(folder)


def test_messages_are_read_one_at_a_time(path, monkeypatch):
    """A recording larger than memory is never held: only what is asked for is decoded."""
    decoded, deserialize = [], AnyReader.deserialize
    monkeypatch.setattr(AnyReader, "deserialize", lambda *a: decoded.append(a) or deserialize(*a))
    with Bag(path) as bag:
        stream = bag.messages(["/scan"])
        next(stream)
        next(stream)
        assert len(decoded) == 2


@pytest.mark.parametrize("keep", [0.3, 0.6, 0.9])
def test_a_file_that_was_cut_off(path, tmp_path, keep):
    content = path.read_bytes()
    cut = tmp_path / f"short{path.suffix}"
    cut.write_bytes(content[: int(keep * len(content))])
    with pytest.raises(InputError, match=r"cut off|damaged") as error, Bag(cut) as bag:
        for _ in bag.messages(["/scan", "/odom", "/cmd_vel"]):
            pass
    one_line(error)


def test_damaged_bytes_within(path, tmp_path):
    content = bytearray(path.read_bytes())
    third = len(content) // 3
    content[third : third + 2000] = bytes(range(250)) * 8
    bad = tmp_path / f"bad{path.suffix}"
    bad.write_bytes(content)
    with suppress(InputError), Bag(bad) as bag:  # and nothing else may come out
        for _ in bag.messages(["/scan", "/odom", "/cmd_vel"]):
            pass


@pytest.mark.parametrize("topic", ["/tf_static", "/odom", "/scan"])
def test_a_topic_of_two_types_is_refused(tmp_path, topic, capsys, says):
    maker = drive(steps=12)
    maker.add(
        topic, "geometry_msgs/msg/PoseStamped", BEGAN, maker.pose_stamped(BEGAN, "odom", Pose(0.0, 0.0, 0.0))
    )
    assert main([str(maker.write(tmp_path)), "tracking=none", f"hydra.run.dir={tmp_path / 'run'}"]) == 2
    says(capsys.readouterr().err)


def test_commands_of_two_types_are_left_out_unless_they_are_asked_for(tmp_path, capsys, says):
    maker = drive(steps=12)
    twist = maker.make("geometry_msgs/msg/TwistStamped", maker.header(BEGAN, ""), maker.twist(0.1, 0.0))
    maker.add("/cmd_vel", "geometry_msgs/msg/TwistStamped", BEGAN, twist)
    path = maker.write(tmp_path)
    with Bag(path) as bag:
        with says.warns():
            topics = choose(bag, BagTopicsConfig(), None)
        assert topics.command is None
        list(bag.messages(topics.names))
    assert main([str(path), "list=true", "tracking=none"]) == 0
    assert "geometry_msgs/msg/Twist | geometry_msgs/msg/TwistStamped" in capsys.readouterr().out
    assert (
        main([str(path), "topics.command=/cmd_vel", "tracking=none", f"hydra.run.dir={tmp_path / 'run'}"])
        == 2
    )
    assert "/cmd_vel has several types" in capsys.readouterr().err


def test_a_type_or_a_topic_without_messages_does_not_count(tmp_path, says):
    """As where a node announced a topic and never wrote to it."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    maker = drive(steps=12, commands=False)
    with Writer(tmp_path / "announced", version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection("/odom", "geometry_msgs/msg/PoseStamped", typestore=maker.store)
        writer.add_connection("/front", "sensor_msgs/msg/LaserScan", typestore=maker.store)
        maker.fill(writer, sorted(maker.messages, key=lambda one: one[0]), maker.store.serialize_cdr)
    assert read(tmp_path / "announced") == 24
    with Bag(tmp_path / "announced") as bag:
        assert choose(bag, BagTopicsConfig(), None).scan.name == "/scan"
        with says.raises(InputError, match="scan.*/front"):
            choose(bag, BagTopicsConfig(scan="/front"), None)


def read(path):
    with Bag(path) as bag:
        return len(list(bag.messages(["/scan", "/odom"])))


def refused(path):
    with pytest.raises(InputError) as error:
        read(path)
    return one_line(error)


@pytest.mark.parametrize("suffix", [".db3", ".mcap"])
def test_messages_that_are_compressed_one_by_one_need_the_metadata(tmp_path, suffix):
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    maker, plugin = drive(steps=12), StoragePlugin.MCAP if suffix == ".mcap" else StoragePlugin.SQLITE3
    writer = Writer(tmp_path / "packed", version=8, storage_plugin=plugin)
    writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        maker.fill(writer, sorted(maker.messages, key=lambda one: one[0]), maker.store.serialize_cdr)
    assert read(tmp_path / "packed") == 24
    said = refused(tmp_path / "packed" / f"packed{suffix}")
    assert "compressed with zstd" in said
    assert "damaged" not in said


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("storage_identifier: sqlite3", "storage_identifier: ''"),
        ("storage_identifier: sqlite3", ""),
        (None, ""),
    ],
)
def test_a_folder_whose_metadata_names_no_storage_is_read_if_it_has_one_file(tmp_path, old, new):
    file = drive(".db3", steps=12).write(tmp_path)
    metadata = file.with_name("metadata.yaml")
    if old is None:
        metadata.unlink()
    else:
        metadata.write_text(metadata.read_text().replace(old, new))
    assert read(file.parent) == 24
    file.with_name("second.db3").write_bytes(file.read_bytes())
    assert "`ros2 bag reindex" in refused(file.parent)


def test_a_folder_of_ros_1_recordings(tmp_path):
    file = drive(".bag", steps=2).write(tmp_path)
    assert f"give one of them, such as {file}" in refused(file.parent)


def test_metadata_that_names_a_missing_file(tmp_path):
    file = drive(".db3", steps=2).write(tmp_path)
    metadata = file.with_name("metadata.yaml")
    metadata.write_text(metadata.read_text().replace(file.name, "gone.db3"))
    said = refused(file.parent)
    assert "gone.db3" in said
    assert "`ros2 bag reindex`" in said


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("a.bag.active", b"", b""),
        ("a.db3.zstd", b"", b""),
        ("a.bag", b"#ROSBAG V2.0", b"#ROSBAG V1.2"),
        ("a.bag", b"#ROSBAG V2.0", b"#ROSRECORD V1.1"),
        ("a.bag", b"compression=none", b"compression=best"),
    ],
)  # fmt: skip
def test_files_of_ros_1_that_need_a_tool_first(tmp_path, name, old, new, says):
    path = tmp_path / name
    path.write_bytes(drive(".bag", steps=2).write(tmp_path).read_bytes().replace(old, new, 1 if old else 0))
    says(refused(path))


def test_an_encrypted_bag_names_the_tool(tmp_path, says):
    """The header of the file says what encrypts the rest; padding takes up its length."""
    path = drive(".bag", steps=2).write(tmp_path)
    content = path.read_bytes()
    begin = content.index(b"\n") + 1
    end = begin + 4 + int.from_bytes(content[begin : begin + 4], "little")
    padding = int.from_bytes(content[end : end + 4], "little")
    name = b"encryptor=rosbag/AesCbcEncryptor"
    field = len(name).to_bytes(4, "little") + name
    lengths = [
        number.to_bytes(4, "little") for number in (end - begin - 4 + len(field), padding - len(field))
    ]
    header = lengths[0] + content[begin + 4 : end] + field + lengths[1]
    path.write_bytes(content[:begin] + header + content[end + 4 + len(field) :])
    says(refused(path))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"\x03\x00\x00\x00cdr", b"\x03\x00\x00\x00xml"),
        (b"\x07\x00\x00\x00ros2msg", b"\x07\x00\x00\x00ros1msg"),
    ],
)
def test_messages_in_another_encoding(tmp_path, old, new, says):
    path = drive(steps=2).write(tmp_path)
    path.write_bytes(path.read_bytes().replace(old, new))
    says(refused(path))


def test_an_index_that_names_another_topic(tmp_path, monkeypatch):
    every = AnyReader.messages
    monkeypatch.setattr(AnyReader, "messages", lambda reader, connections, **times: every(reader, **times))
    with (
        Bag(drive(".bag", steps=2).write(tmp_path)) as bag,
        pytest.raises(
            InputError, match=r"damaged .its index and its messages name different topics"
        ) as error,
    ):
        list(bag.messages(["/scan"]))
    one_line(error)


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize(
    "content",
    [b"", b"no recording at all" * 9],
)
def test_invalid_recordings_are_refused(tmp_path, suffix, content, says):
    path = tmp_path / f"drive{suffix}"
    path.write_bytes(content)
    with says.raises(InputError) as error:
        Bag(path)
    one_line(error)


def test_paths_that_are_not_recordings_are_refused(tmp_path):
    for path, message in (
        (tmp_path / "absent.bag", "no such file"),
        (tmp_path, "metadata.yaml"),
        (tmp_path / "picture.png", "must be a ROS recording"),
        (tmp_path / "DRIVE.BAG", r"must be in lower case: rename it to \.bag"),
    ):
        if path.suffix in (".png", ".BAG"):
            path.write_bytes(b"x")
        with pytest.raises(InputError, match=message) as error:
            Bag(path)
        one_line(error)


def test_a_recording_without_messages(tmp_path):
    with pytest.raises(InputError, match="has no messages"):
        Bag(BagMaker(".bag").write(tmp_path))


def test_an_assertion_within_rosbags_is_a_line_for_the_user(path, monkeypatch, says):
    def fails(self):
        raise AssertionError

    monkeypatch.setattr(AnyReader, "open", fails)
    with says.raises(InputError) as error:
        Bag(path)
    one_line(error)


# Topics


def chosen(maker, tmp_path, goal=None, **names):
    with Bag(maker.write(tmp_path)) as bag:
        return choose(bag, BagTopicsConfig(**names), goal)


def test_topics_are_found_by_type(tmp_path):
    topics = chosen(drive(steps=2), tmp_path)
    assert (topics.scan.name, topics.pose.name, topics.command.name) == ("/scan", "/odom", "/cmd_vel")
    assert topics.tf == ("/tf_static",)


def test_a_second_scanner_needs_no_choice_next_to_one_called_scan(tmp_path):
    maker = drive(steps=2)
    maker.add("/rear_scan", "sensor_msgs/msg/LaserScan", BEGAN, maker.scan(BEGAN, [1.0, 1.0], 0.0, 0.1))
    assert chosen(maker, tmp_path).scan.name == "/scan"
    assert chosen(maker, tmp_path / "other", scan="rear_scan").scan.name == "/rear_scan"


def test_two_scanners_of_unknown_names_require_a_choice(tmp_path, says):
    maker = drive(steps=2, scans="none")
    for name in ("/front", "/rear"):
        maker.add(name, "sensor_msgs/msg/LaserScan", BEGAN, maker.scan(BEGAN, [1.0, 1.0], 0.0, 0.1))
    with says.raises(InputError, match="scan.*null"):
        chosen(maker, tmp_path)


def test_the_only_imu_is_read_for_the_sake_of_clouds(tmp_path):
    tilted = {"steps": 2, "tilted": ("imu",)}
    assert chosen(drive(scans="cloud", **tilted), tmp_path / "a").imu.name == "/imu"
    assert chosen(drive(**tilted), tmp_path / "b").imu is None
    assert chosen(drive(**tilted), tmp_path / "c", imu="imu").imu.name == "/imu"
    two = drive(scans="cloud", **tilted)
    two.add("/livox/imu", "sensor_msgs/msg/Imu", BEGAN, two.imu(BEGAN))
    assert chosen(two, tmp_path / "d").imu is None
    assert chosen(two, tmp_path / "e", imu="/imu").names >= {"/points", "/odom", "/imu", "/tf_static"}


@pytest.mark.parametrize(
    "names",
    [
        {"scan": "/odom"},
        {"scan": "/skan"},
        {"command": "/scan"},
        {"imu": "/scan"},
        {"goal": "/odom"},
    ],
    ids=str,
)
def test_a_topic_that_does_not_fit(tmp_path, names, says):
    with pytest.raises(InputError) as error:
        chosen(drive(steps=2), tmp_path, **names)
    says(one_line(error))


def test_a_recording_without_scans_or_poses(tmp_path, says):
    with says.raises(InputError):
        chosen(drive(steps=2, scans="none"), tmp_path / "a")
    maker = BagMaker()
    maker.add("/scan", "sensor_msgs/msg/LaserScan", BEGAN, maker.scan(BEGAN, [1.0, 1.0], 0.0, 0.1))
    with pytest.raises(InputError, match="no poses"):
        chosen(maker, tmp_path / "b")


def test_a_goal_is_not_taken_for_the_robots_pose(tmp_path):
    maker = drive(steps=2, poses="motion capture")
    message = maker.pose_stamped(BEGAN, "world", Pose(1.0, 2.0, 0.0))
    maker.add("/target", "geometry_msgs/msg/PoseStamped", BEGAN, message)
    maker.messages = [m for m in maker.messages if m[1] != "/tf_static"]
    assert chosen(maker, tmp_path, goal="/target").pose.name == "/vrpn/robot/pose"


def test_the_list_says_what_a_topic_can_be(tmp_path, capsys):
    path = drive(steps=12, tilted=("imu",)).write(tmp_path)
    with Bag(path) as bag:
        rows = {line.split()[0]: line for line in table(bag)}
    assert rows["/scan"].endswith("scan")
    assert rows["/imu"].endswith("imu")
    assert rows["/odom"].endswith("pose")
    assert "12" in rows["/cmd_vel"]
    assert main([f"bag={path}", "list=true"]) == 0
    assert "/scan" in capsys.readouterr().out
    with pytest.raises(InputError, match="bag is null"):
        main(["list=true"])


@pytest.mark.parametrize("column", ["name", "type"])
def test_a_topic_without_a_name_or_a_type_is_refused(tmp_path, column, says):
    path = drive(".db3", steps=3).write(tmp_path)
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE damaged AS SELECT * FROM topics")
        database.execute(f"UPDATE damaged SET {column} = NULL WHERE name = '/odom'")
        database.execute("DROP TABLE topics")
        database.execute("ALTER TABLE damaged RENAME TO topics")
        database.commit()
    with says.raises(InputError) as error, Bag(path):
        pass
    one_line(error)


def test_a_message_that_is_defined_otherwise_is_refused(tmp_path, says):
    """A bit of a definition has flipped: every message would be read with another field."""
    path = drive(".mcap", steps=3).write(tmp_path)
    content = path.read_bytes()
    path.write_bytes(content.replace(b"Quaternion orientation", b"Quaternion orientatioo"))
    assert path.read_bytes() != content
    with pytest.raises(InputError) as error, Bag(path):
        pass
    says(one_line(error))


def test_a_message_whose_time_is_not_a_number_is_damage(tmp_path):
    path = drive(".db3", steps=6).write(tmp_path)
    with sqlite3.connect(path) as database:
        database.execute("UPDATE messages SET timestamp = 'x' WHERE id = 4")
    with pytest.raises(InputError) as error, Bag(path) as bag:
        list(bag.messages([topic.name for topic in bag.topics()]))
    assert "damaged" in one_line(error) or "not readable" in one_line(error)


def test_a_name_that_no_file_can_have_is_refused(says):
    with says.raises(InputError):
        Bag(Path("x" * 300))
