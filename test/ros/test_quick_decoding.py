# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What is decoded quickly is what rclpy decodes, field by field, whatever comes."""

import sys

from hypothesis import given, strategies as st
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('rosbags')

from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402
from rrth_planner.model.errors import MessageError  # noqa: E402
from rrth_planner.ros.messages import definitions  # noqa: E402
from rrth_planner.ros.messages.definitions import fast_decoder  # noqa: E402
from rrth_planner.ros.messages.marker_edits import read_edits  # noqa: E402
from rrth_planner.ros.middleware.open_subscription import decoded  # noqa: E402
from samples import array, box, wearer  # noqa: E402
from sensor_msgs.msg import CompressedImage  # noqa: E402
from std_msgs.msg import ColorRGBA  # noqa: E402
from test_under_fire import HEADERS, LIFETIMES, MARKERS, TEXTS  # noqa: E402
from visualization_msgs.msg import (  # noqa: E402
    Marker,
    MarkerArray,
    MeshFile,
    UVCoordinate,
)
import worlds  # noqa: E402

DECODE = fast_decoder(MarkerArray)
COLORS = st.builds(ColorRGBA, r=st.floats(width=32), a=st.floats(width=32))
BYTES = st.binary(max_size=5).map(list)


@st.composite
def _full_markers(draw):
    """Give a marker in which all is set that a body does not need, too."""
    marker = draw(MARKERS)
    marker.lifetime, marker.color = draw(LIFETIMES), draw(COLORS)
    marker.frame_locked, marker.mesh_use_embedded_materials = draw(st.tuples(*[st.booleans()] * 2))
    marker.colors = draw(st.lists(COLORS, max_size=2))
    marker.texture_resource, marker.mesh_resource = draw(st.tuples(TEXTS, TEXTS))
    marker.texture = CompressedImage(header=draw(HEADERS), format=draw(TEXTS), data=draw(BYTES))
    marker.uv_coordinates = [UVCoordinate(u=0.5, v=0.25)] * draw(st.integers(0, 2))
    marker.mesh_file = MeshFile(filename=draw(TEXTS), data=draw(BYTES))
    return marker


ARRAYS = st.builds(MarkerArray, markers=st.lists(_full_markers(), max_size=3))


def values_of(value, like):
    """Return the values of a message in all fields of a message of ROS, in numbers and texts."""
    if hasattr(like, 'get_fields_and_field_types'):
        names = like.get_fields_and_field_types()
        return {name: values_of(getattr(value, name), getattr(like, name)) for name in names}
    if isinstance(like, list):
        assert len(value) == len(like)
        return [values_of(*pair) for pair in zip(value, like, strict=True)]
    if isinstance(like, str | bool):
        assert type(value) is type(like)
        return value
    # Numbers, and arrays of them; NaN included.
    return repr([int(v) for v in value]) if hasattr(like, '__len__') else repr(value)


@worlds.examples(100)
@given(msg=ARRAYS)
def test_every_field_comes_through(msg):
    data = serialize_message(msg)
    expected = deserialize_message(data, MarkerArray)
    found = DECODE(data)
    assert not isinstance(found, MarkerArray)
    assert values_of(found, expected) == values_of(expected, expected)


@worlds.examples(200)
@given(msg=ARRAYS, data=st.data())
def test_what_is_no_message_is_rejected_as_by_rclpy(msg, data):
    whole = bytearray(serialize_message(msg))
    for _ in range(data.draw(st.integers(0, 3))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    broken = bytes(whole[: data.draw(st.integers(0, len(whole)))])
    try:
        decoded(broken, MarkerArray)
    except MessageError as problem:
        # It may know an end where the other reads on, never the other way round.
        with pytest.raises(MessageError) as raised:
            decoded(broken, MarkerArray, decode=DECODE)
        assert str(raised.value) == str(problem)
    else:
        assert hasattr(decoded(broken, MarkerArray, decode=DECODE), 'markers')


def test_what_is_less_strict_than_it_should_be_is_taken_as_by_rclpy():
    data = serialize_message(wearer()) + b'\0' * 40
    assert isinstance(DECODE(data), MarkerArray)
    assert DECODE(data) == deserialize_message(data, MarkerArray)


def test_boxes_are_read_from_it_bit_by_bit():
    msg = array(box('hat', 3, center=(0.1, 0.2, 1 / 3), text='a hat'), *wearer().markers)
    one, two = (
        read_edits(d(serialize_message(msg)), 7.0, 'torso')
        for d in (DECODE, lambda data: deserialize_message(data, MarkerArray))
    )
    assert [e.key for e in one] == [e.key for e in two]
    assert [e.action for e in one] == [e.action for e in two]
    for a, b in zip(one, two, strict=True):
        assert a.part is b.part is None or all(
            (p.center == q.center).all() and (p.size == q.size).all() and p.name == q.name
            for p, q in zip(a.part.boxes, b.part.boxes, strict=True)
        )
    assert any(e.part is not None for e in one)


@pytest.mark.parametrize('missing', ['rosbags', 'definition'])
def test_without_rosbags_or_the_definition_rclpy_decodes(monkeypatch, missing):
    def not_found(_):
        raise MessageError('not found')

    if missing == 'rosbags':
        monkeypatch.setitem(sys.modules, 'rosbags.typesys', None)
    else:
        monkeypatch.setattr(definitions, 'definition_of', not_found)
    # Anew: one that was made before is kept.
    found = fast_decoder.__wrapped__(MarkerArray)(serialize_message(wearer()))
    assert found == wearer()
    assert isinstance(found.markers[0], Marker)
