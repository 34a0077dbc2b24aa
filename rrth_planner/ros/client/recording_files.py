# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The messages of a recording as stored: an MCAP file, or the folder of a `ros2 bag`."""

from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
import re
import sqlite3
import struct
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import get_types_from_idl, get_typestore, Stores
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.errors import RecordError
from rrth_planner.ros.messages.definitions import definition_of, type_of_name
import zstandard

# Of a bag: file names may end in .zstd, too, where the recorder compresses whole files.
BAG_FILES = ('.mcap', '.db3')
COMPRESSED = '.zstd'
# The first bytes of what zstd compressed; a message begins with a byte 0.
ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
# Between the definitions of a schema in IDL.
IDL_HEADER = re.compile(r'^(?:=+\r?\n)?IDL: .*$', re.MULTILINE)
# Lines that rosbags does not read: #include, of definitions that the schema has.
DIRECTIVE = re.compile(r'^\s*#.*$', re.MULTILINE)


class StoredMessage(NamedTuple):
    """The bytes of a message, its type, and the times of sending and reception [ns]."""

    topic: str
    schema: Schema
    data: bytes
    sent: int
    received: int


def stored_messages(path: Path) -> Iterator[StoredMessage]:
    """
    Return the messages of a file or of a bag's folder, file by file, front to back.

    Files that are cut off count as far as they go, and so do those of a bag that its recorder had
    no time to list. Raises RecordError where one cannot be read.
    """
    for file in _bag_files(path) if path.is_dir() else [path]:
        try:
            yield from _messages_of(file)
        except OSError as problem:
            raise RecordError(f'{file}: {problem.strerror}, expected a recording') from problem
        except (EndOfFile, struct.error):
            # The file is cut off: what is there counts.
            pass
        except Exception as problem:
            # The file may hold anything.
            raise RecordError(
                f'{file}: {problem or type(problem).__name__}, expected an MCAP file of ROS 2 '
                'messages, or a file of a ros2 bag'
            ) from problem


def decoder_of(schema: Schema) -> Callable[[bytes], Any]:
    """
    Return a function that decodes messages, by the definition in the file, in .msg or IDL.

    Where the file has none, that of the installed type counts. What is no definition may raise
    any error, and so may the function.
    """
    text = ''
    if schema.encoding == 'ros2idl':
        # rosbags translates them only: it rejects the bytes that Fast CDR may append.
        store = get_typestore(Stores.EMPTY)
        for part in filter(str.strip, IDL_HEADER.split(schema.data.decode())):
            store.register(get_types_from_idl(DIRECTIVE.sub('', part)))
        text, _ = store.generate_msgdef(schema.name, ros_version=2)
    elif not schema.data:
        text = definition_of(type_of_name(schema.name))
    if text:
        schema = Schema(schema.id, text.encode(), 'ros2msg', schema.name)
    decode = DecoderFactory().decoder_for('cdr', schema)
    if decode is None:
        raise ValueError(f'a schema of encoding "{schema.encoding}"')
    return decode


def _bag_files(folder: Path) -> list[Path]:
    """Return the files of a bag in the order of recording, or raise RecordError."""
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir(), key=lambda path: path.suffix == COMPRESSED):
        name = path.name.removesuffix(COMPRESSED)
        if name.endswith(BAG_FILES) and path.is_file():
            # A recorder that was killed may leave half of the compressed file beside the file.
            found.setdefault(name, path)
    for name in _listed(folder / 'metadata.yaml'):
        if name.removesuffix(COMPRESSED) not in found:
            raise RecordError(f'{folder}: no file {name}, expected those of its metadata.yaml')
    if not found:
        raise RecordError(
            f'{folder}: no {" or ".join(BAG_FILES)} in it, expected the folder of a ros2 bag'
        )
    return [found[name] for name in sorted(found, key=lambda name: (len(name), name))]


def _listed(file: Path) -> list[str]:
    """Return the names of a bag's files by its metadata; a recorder writes these at its end."""
    if not file.is_file():
        return []
    data = load_yaml(file)
    try:
        names = data['rosbag2_bagfile_information']['relative_file_paths']
        # Old recorders begin each with the name of the folder.
        return [Path(name).name for name in names]
    except (KeyError, TypeError) as problem:
        raise RecordError(
            f'{file}: no rosbag2_bagfile_information with relative_file_paths, expected that of '
            'a ros2 bag'
        ) from problem


def _messages_of(file: Path) -> Iterator[StoredMessage]:
    if file.suffix == COMPRESSED:
        with TemporaryDirectory() as folder:
            whole = Path(folder, file.stem)
            with file.open('rb') as packed, whole.open('wb') as unpacked:
                zstandard.ZstdDecompressor().copy_stream(packed, unpacked)
            yield from _messages_of(whole)
    elif file.suffix == '.db3':
        for stored in _rows(file):
            if stored.data.startswith(ZSTD_MAGIC):
                data = zstandard.ZstdDecompressor().decompressobj().decompress(stored.data)
                stored = stored._replace(data=data)
            yield stored
    else:
        with file.open('rb') as stream:
            # From front to back, since a recorder that was killed has written no index.
            for schema, channel, message in NonSeekingReader(stream).iter_messages(
                log_time_order=False
            ):
                if schema is not None and channel.message_encoding == 'cdr':
                    times = message.publish_time, message.log_time
                    yield StoredMessage(channel.topic, schema, message.data, *times)


def _rows(file: Path) -> Iterator[StoredMessage]:
    """Return the messages of an SQLite file, which has one time of each: that of reception."""
    # Nothing is written, unless a recorder was killed and left a log of what is to be merged.
    has_log = file.with_name(f'{file.name}-wal').exists()
    address = f'{file.absolute().as_uri()}?{"mode=ro" if has_log else "immutable=1"}'
    with closing(sqlite3.connect(address, uri=True)) as database:
        definitions = {}
        # Recorders before ROS 2 Iron store no definitions.
        if database.execute("PRAGMA table_info('message_definitions')").fetchall():
            query = 'SELECT topic_type, encoding, encoded_message_definition'
            rows = database.execute(f'{query} FROM message_definitions')
            definitions = {name: (encoding, text) for name, encoding, text in rows}
        topics = {}
        query = "SELECT id, name, type FROM topics WHERE serialization_format = 'cdr'"
        for number, topic, kind in database.execute(query):
            encoding, text = definitions.get(kind, ('', ''))
            topics[number] = topic, Schema(number, text.encode(), encoding, kind)
        query = 'SELECT topic_id, data, timestamp FROM messages ORDER BY timestamp'
        for number, data, time in database.execute(query):
            if number in topics:
                yield StoredMessage(*topics[number], bytes(data), time, time)
