# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of all kinds are read as the nodes would, or rejected in one sentence."""

from pathlib import Path
import sqlite3
import sys

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('mcap_ros2')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue  # noqa: E402
from geometry_msgs.msg import PointStamped  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from mcap.writer import Writer as McapWriter  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer  # noqa: E402
from rosbags.typesys import get_types_from_msg  # noqa: E402
from rrth_planner.cli.plot import main  # noqa: E402
from rrth_planner.execution.recording import commanded_stops  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.model.arm import ArmModel  # noqa: E402
from rrth_planner.model.errors import RecordError  # noqa: E402
from rrth_planner.model.trajectory import Trajectory  # noqa: E402
from rrth_planner.ros.client import recorder  # noqa: E402
from rrth_planner.ros.client.recorder import RecordingFile  # noqa: E402
from rrth_planner.ros.client.recording_reader import RecordingReader  # noqa: E402
from rrth_planner.ros.messages.definitions import definition_of, type_name  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_to_msg  # noqa: E402
from samples import array, box, FOLDED, joints, target, wearer  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402
import zstandard  # noqa: E402

ARM = load_arm()
BEGIN = 1_800_000_000
SECOND = 10**9
TYPES = {
    'body_boxes': MarkerArray,
    'target': PointStamped,
    'joint_states': JointState,
    'joint_trajectory': JointTrajectory,
    'diagnostics': DiagnosticArray,
}


def write(path, *items, space=''):
    """Write messages, each (topic, time since the begin [s], message or bytes), to a file."""
    with RecordingFile(path) as file:
        for topic, time, msg in items:
            name = f'/{topic}' if topic == 'diagnostics' else f'{space}/{topic}'
            if name not in file.counts:
                file.add_topic(name, TYPES[name.rsplit('/', 1)[-1]])
            when = BEGIN * SECOND + round(time * SECOND)
            data = msg if isinstance(msg, bytes) else serialize_message(msg)
            file.add(name, data, when, when + 1000)
    return path


def state(time, position=FOLDED, **fields):
    """Return joint positions with a stamp, [s] since the begin."""
    msg = joints(position, **fields)
    msg.header.stamp.sec, msg.header.stamp.nanosec = divmod(
        BEGIN * SECOND + round(time * SECOND), SECOND
    )
    return 'joint_states', time, msg


def commanded(time, speed=0.0, stamp=0.0):
    """Return a motion."""
    trajectory = Trajectory(
        times=[0.0, 1.0],
        positions=[FOLDED, np.array(FOLDED) + 0.2],
        velocities=[np.full(4, speed), np.zeros(4)],
        accelerations=np.zeros((2, 4)),
    )
    begin = BEGIN + stamp if stamp else 0.0
    return (
        'joint_trajectory',
        time,
        joint_trajectory_to_msg(trajectory, ARM.joint_names, '', begin),
    )


def said(time, state, name='rrth_planner'):
    """Return diagnostics."""
    status = DiagnosticStatus(name=f'{name}: planning', hardware_id='rrth_planner')
    status.values = [KeyValue(key='monitor', value=state)]
    return 'diagnostics', time, DiagnosticArray(status=[status])


STATES = [state(0.1 * k, velocity=[0.1 * k] * 4) for k in range(10)]


def read(path, **options):
    """Return a file's run."""
    return RecordingReader(path, ARM, 'torso', **options).recording()


def whole_run():
    """Return messages of each kind."""
    hat = box('hat')
    hat.lifetime.nanosec = SECOND // 4
    return [
        *STATES,
        ('body_boxes', 0.1, wearer()),
        ('body_boxes', 0.3, array(hat)),
        ('target', 0.15, target()),
        commanded(0.2),
        commanded(0.5, speed=0.3, stamp=0.45),
        said(0.2, 'monitoring'),
        said(0.5, 'stopping'),
        said(0.4, 'no motion', name='elsewhere/rrth_planner'),
    ]


def require_whole_run(run):
    """Require what whole_run() says."""
    np.testing.assert_allclose(run.times, 0.1 * np.arange(10), atol=1e-5)
    np.testing.assert_array_equal(run.velocities[3], np.full(4, 0.1 * 3))
    assert [motion.begin for motion in run.commanded] == pytest.approx([0.2, 0.45], abs=1e-5)
    assert commanded_stops(run) == (run.commanded[1],)
    assert [state for _, state in run.monitor_states] == ['monitoring', 'stopping']
    # The hat is lost after a quarter of a second, and stays where it was.
    assert [time for time, _ in run.bodies] == pytest.approx([0.1, 0.3], abs=1e-5)
    assert [len(scene.boxes) for _, scene in run.bodies] == [2, 3]
    np.testing.assert_array_equal(run.targets[0][1], [1.5, 0.1, 0.3])


def test_a_run_is_read_on_one_clock(tmp_path):
    require_whole_run(read(write(tmp_path / 'run.mcap', *whole_run())))


def bag(path, storage=StoragePlugin.SQLITE3, compression=CompressionMode.NONE, version=9):
    """Write the whole run as the folder of a bag, by another library's writer."""
    writer = Writer(path, version=version, storage_plugin=storage)
    writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        topics = {}
        for topic, time, msg in whole_run():
            if topic not in topics:
                kind = TYPES[topic]
                topics[topic] = writer.add_connection(
                    f'/{topic}', type_name(kind), msgdef=definition_of(kind), rihs01='unknown'
                )
            when = BEGIN * SECOND + round(time * SECOND)
            writer.write(topics[topic], when, serialize_message(msg))
    return path


NO_COMPRESSION, BY_FILE = CompressionMode.NONE, CompressionMode.FILE
BY_MESSAGE, IN_STORAGE = CompressionMode.MESSAGE, CompressionMode.STORAGE


@pytest.mark.parametrize(
    ('storage', 'compression'),
    [
        *((StoragePlugin.SQLITE3, mode) for mode in (NO_COMPRESSION, BY_FILE, BY_MESSAGE)),
        *((StoragePlugin.MCAP, mode) for mode in (NO_COMPRESSION, BY_FILE, IN_STORAGE)),
    ],
)
def test_the_folder_of_a_bag_is_read(tmp_path, capsys, storage, compression):
    folder = bag(tmp_path / 'run', storage, compression)
    require_whole_run(read(folder))
    # So is one whose recorder was killed before it wrote its metadata, or a file alone.
    (folder / 'metadata.yaml').unlink()
    require_whole_run(read(folder))
    (file,) = folder.iterdir()
    require_whole_run(read(file))
    assert main(['recording', str(folder), '-o', str(tmp_path / 'run.png')]) == 0
    assert not capsys.readouterr().err


def metadata(folder, *names):
    """Write the metadata of a bag's files."""
    text = f'rosbag2_bagfile_information:\n  relative_file_paths: [{", ".join(names)}]\n'
    (folder / 'metadata.yaml').write_text(text)


def split_bag(folder):
    """Write the whole run as eleven files, of which the last one is not listed."""
    folder.mkdir()
    items = sorted(whole_run(), key=lambda item: item[1])
    parts = [items[2 * k : 2 * k + 2] for k in range(8)] + [[], [], items[16:]]
    for k, part in enumerate(parts):
        write(folder / f'run_{k}.mcap', ('joint_states', 0.1 * k, b''), *part)
    metadata(folder, *(f'run/run_{k}.mcap' for k in range(10)))
    return folder


def test_a_bag_of_several_files_is_one_run(tmp_path):
    folder = split_bag(tmp_path / 'run')
    require_whole_run(read(folder))
    # Compressed in the middle of the run, and the file that was being compressed is kept.
    whole = (folder / 'run_3.mcap').read_bytes()
    packed = zstandard.ZstdCompressor().compress(whole)
    (folder / 'run_3.mcap.zstd').write_bytes(packed[: len(packed) // 2])
    require_whole_run(read(folder))
    (folder / 'run_3.mcap').unlink()
    (folder / 'run_3.mcap.zstd').write_bytes(packed)
    require_whole_run(read(folder))


def test_a_bag_whose_last_file_is_cut_off_is_read_as_far_as_it_goes(tmp_path):
    folder = tmp_path / 'run'
    folder.mkdir()
    for k in range(3):
        write(folder / f'run_{k}.mcap', *(state(k + 0.01 * i) for i in range(100)))
    last = folder / 'run_2.mcap'
    last.write_bytes(last.read_bytes()[:1000])
    metadata(folder, 'run_0.mcap', 'run_1.mcap')
    assert len(read(folder).times) == 200


@pytest.mark.parametrize('journal', ['delete', 'wal'])
def test_a_bag_without_definitions_has_the_installed_types(tmp_path, journal):
    folder = tmp_path / 'run'
    folder.mkdir()
    database = sqlite3.connect(folder / 'run_0.db3')
    database.execute(f'PRAGMA journal_mode = {journal}')
    # The tables of ROS 2 Humble.
    database.execute('CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT)')
    database.execute(
        'CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, '
        'serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)'
    )
    database.execute(
        'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, '
        'timestamp INTEGER NOT NULL, data BLOB NOT NULL)'
    )
    numbers = {topic: k for k, topic in enumerate(TYPES, 1)}
    for topic, number in numbers.items():
        row = (number, f'/{topic}', type_name(TYPES[topic]), 'cdr', '')
        database.execute('INSERT INTO topics VALUES (?, ?, ?, ?, ?)', row)
    for topic, time, msg in whole_run():
        row = (numbers[topic], BEGIN * SECOND + round(time * SECOND), serialize_message(msg))
        database.execute('INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)', row)
    database.commit()
    # A recorder that was killed leaves the log, which an open file has.
    assert (folder / 'run_0.db3-wal').exists() == (journal == 'wal')
    require_whole_run(read(folder))
    database.close()
    require_whole_run(read(folder))


def definition_in_idl(kind, *, is_first_named):
    """Return the definition of a type as the installed files .idl have it."""
    parts = []
    for name in get_types_from_msg(definition_of(kind), type_name(kind)):
        package = name.split('/')[0]
        for folder in Path(sys.modules[package].__file__).parents:
            file = folder / 'share' / f'{name}.idl'
            if file.is_file():
                parts.append((name, file.read_text(encoding='utf-8')))
                break
    # The type itself comes first.
    parts.sort(key=lambda part: part[0] != type_name(kind))
    text = ''.join(f'{"=" * 80}\nIDL: {name}\n{part}' for name, part in parts)
    return text if is_first_named else text.split('\n', 2)[2]


def write_with_schemas(path, encoding, definition):
    """Write the whole run to an MCAP file with definitions of an encoding."""
    with path.open('wb') as file:
        writer = McapWriter(file)
        writer.start(profile='ros2')
        channels = {}
        for topic, time, msg in whole_run():
            if topic not in channels:
                kind = TYPES[topic]
                data = definition(kind).encode()
                schema = writer.register_schema(type_name(kind), encoding, data)
                channels[topic] = writer.register_channel(f'/{topic}', 'cdr', schema)
            when = BEGIN * SECOND + round(time * SECOND)
            writer.add_message(
                channels[topic], log_time=when, publish_time=when, data=serialize_message(msg)
            )
        writer.finish()
    return path


@pytest.mark.parametrize('is_first_named', [True, False])
def test_definitions_in_idl_are_read(tmp_path, is_first_named):
    path = write_with_schemas(
        tmp_path / 'run.mcap',
        'ros2idl',
        lambda kind: definition_in_idl(kind, is_first_named=is_first_named),
    )
    reader = RecordingReader(path, ARM, 'torso')
    require_whole_run(reader.recording())
    assert not reader.rejected


def test_a_file_without_definitions_has_the_installed_types(tmp_path):
    # As rosbag2 writes them where it finds none.
    require_whole_run(read(write_with_schemas(tmp_path / 'run.mcap', '', lambda kind: '')))


@pytest.mark.parametrize('encoding', ['ros2idl', 'ros2msg', 'protobuf'])
def test_a_definition_that_is_none_is_said_of_its_topic(tmp_path, encoding):
    path = write_with_schemas(
        tmp_path / 'run.mcap',
        encoding,
        lambda kind: 'no definition, but a letter',
    )
    reader = RecordingReader(path, ARM, 'torso')
    assert set(reader.rejected) == {f'/{topic}' for topic in TYPES}
    for sentence in reader.rejected.values():
        assert 'unreadable definition' in sentence
    with pytest.raises(RecordError, match='no joint_states'):
        reader.recording()


@pytest.mark.parametrize(
    ('content', 'words'),
    [
        ({}, 'no .mcap or .db3 in it, expected the folder of a ros2 bag'),
        (
            {'run_0.db3': b'no database, but a letter'},
            'messages, or a file of a ros2 bag',
        ),
        ({'run_0.mcap.zstd': b'not compressed, but a letter'}, 'expected an MCAP file'),
        ({'run_0.mcap': b'', 'metadata.yaml': b'7'}, 'expected that of a ros2 bag'),
        ({'run_0.mcap': b'', 'metadata.yaml': b'a: [}'}, 'metadata.yaml'),
        (
            {
                'run_0.mcap': b'',
                'metadata.yaml': b'rosbag2_bagfile_information:\n'
                b'  relative_file_paths: [run_0.mcap, run_1.mcap]\n',
            },
            'no file run_1.mcap, expected those of its metadata.yaml',
        ),
    ],
)
def test_a_bad_folder_is_rejected_in_one_sentence(tmp_path, capsys, content, words):
    for name, data in content.items():
        (tmp_path / name).write_bytes(data)
    output = tmp_path / 'bad.png'
    assert main(['recording', str(tmp_path), '-o', str(output)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith('plot: ')
    assert words in line
    assert not output.exists()


def test_without_velocities_the_change_of_the_positions_counts(tmp_path):
    nowhere = [float('nan')] * 4
    path = write(
        tmp_path / 'run.mcap',
        *(state(0.1 * k, np.array(FOLDED) + 0.05 * k, velocity=nowhere) for k in range(5)),
    )
    np.testing.assert_allclose(read(path).velocities, np.full((5, 4), 0.5), rtol=1e-3)


def test_what_the_nodes_would_reject_is_left_out_and_said(tmp_path, capsys):
    path = write(
        tmp_path / 'run.mcap',
        *STATES,
        state(2.0, FOLDED[:2]),
        ('body_boxes', 0.1, wearer()),
        ('body_boxes', 0.2, array(box('far', frame='map'))),
        ('target', 0.1, target(x=float('nan'))),
        ('joint_trajectory', 0.1, JointTrajectory(joint_names=['other'])),
    )
    reader = RecordingReader(path, ARM, 'torso')
    run = reader.recording()
    assert len(run.times) == 10
    assert len(run.bodies) == 1
    assert not run.targets
    assert not run.commanded
    assert set(reader.rejected) == {'/joint_states', '/body_boxes', '/target', '/joint_trajectory'}
    assert main(['recording', str(path), '-o', str(tmp_path / 'run.png')]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 4
    assert all('malformed messages skipped' in line for line in lines)


@pytest.mark.parametrize(
    'garbage', [b'', b'ab', b'nothing that a driver would say', b'\x00\x01\x00\x00' + b'\xff' * 40]
)
def test_a_message_that_cannot_be_read_costs_no_other(tmp_path, garbage):
    path = write(tmp_path / 'run.mcap', *STATES[:2], ('joint_states', 0.15, garbage), *STATES[2:])
    reader = RecordingReader(path, ARM, 'torso')
    assert len(reader.recording().times) == len(STATES)
    assert set(reader.rejected) == {'/joint_states'}
    (sentence,) = reader.rejected.values()
    assert sentence.startswith(f'{len(garbage)} bytes')
    assert sentence.endswith('expected a sensor_msgs/msg/JointState')


def test_a_file_that_was_never_finished_is_read_as_far_as_it_goes(tmp_path, monkeypatch):
    # As many chunks as a file of 5000 messages has.
    monkeypatch.setattr(recorder, 'CHUNK', recorder.CHUNK // 5)
    path = write(tmp_path / 'run.mcap', *(state(0.01 * k) for k in range(1000)))
    whole, cut = path.read_bytes(), tmp_path / 'cut.mcap'
    counts = []
    for share in np.linspace(0.4, 0.95, 24):
        cut.write_bytes(whole[: int(share * len(whole))])
        counts.append(len(read(cut).times))
    assert counts == sorted(counts)
    assert 100 < counts[0] < counts[-1] <= 1000


def test_of_several_runs_one_is_to_be_named(tmp_path):
    path = tmp_path / 'run.mcap'
    both = [(f'{side}/{t}', time, msg) for side in ('left', 'right') for t, time, msg in STATES]
    write(path, *both)
    with pytest.raises(RecordError, match='expected --namespace with one of /left, /right'):
        read(path)
    assert len(read(path, namespace='/left').times) == 10
    assert len(read(path, namespace='right').times) == 10
    with pytest.raises(RecordError, match='no joint_states'):
        read(path, namespace='middle')


def test_another_arm_is_not_found(tmp_path):
    other = ArmModel(
        joint_names=('a', 'b', 'c', 'd'),
        **{
            name: getattr(ARM, name)
            for name in ('is_prismatic', 'dh', 'bounds', 'radii', 'T_base_mount')
        },
    )
    path = write(tmp_path / 'run.mcap', *STATES)
    with pytest.raises(RecordError, match='expected a run of this arm'):
        RecordingReader(path, other, 'torso').recording()


def flipped(path):
    """Return the bytes of a good file with its chunk damaged."""
    data = bytearray(write(path, *STATES).read_bytes())
    middle = len(data) // 3
    data[middle : middle + 40] = bytes(b ^ 0xFF for b in data[middle : middle + 40])
    return bytes(data)


@pytest.mark.parametrize(
    ('content', 'words'),
    [
        (b'', 'expected an MCAP file of a run'),
        (b'these are no messages, but a letter to somebody else', 'expected an MCAP file'),
        (flipped, 'expected an MCAP file'),
        (None, 'No such file'),
    ],
)
def test_a_bad_file_is_rejected_in_one_sentence(tmp_path, capsys, content, words):
    path, output = tmp_path / 'bad.mcap', tmp_path / 'bad.png'
    if content is not None:
        path.write_bytes(content(tmp_path / 'good.mcap') if callable(content) else content)
    assert main(['recording', str(path), '-o', str(output)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f'plot: {path}: ')
    assert words in line
    assert not output.exists()


def test_a_section_outside_of_the_run_is_rejected(tmp_path, capsys):
    path = write(tmp_path / 'run.mcap', *STATES)
    assert main(['recording', str(path), '--begin', '7', '-o', str(tmp_path / 'run.png')]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert 'expected times between 0.00 and 0.90' in line


@pytest.mark.parametrize(
    ('arguments', 'expected'),
    [
        (['--begin', '-0.35'], (0.6, 0.9)),
        (['--begin=-0.35', '--end', '-0.05'], (0.6, 0.8)),
        (['--begin', '0.15', '--end', '-0.35'], (0.2, 0.5)),
        (['--begin', '-7'], (0.0, 0.9)),
    ],
)
def test_times_below_zero_count_from_the_end(tmp_path, monkeypatch, arguments, expected):
    drawn = []

    def figure(recording, *_):
        drawn.append(recording.times[[0, -1]])
        return Figure()

    monkeypatch.setattr('rrth_planner.visualization.recording_figure.recording_figure', figure)
    path = write(tmp_path / 'run.mcap', *STATES)
    assert main(['recording', str(path), *arguments, '-o', str(tmp_path / 'run.png')]) == 0
    np.testing.assert_allclose(drawn, [expected], atol=1e-5)
