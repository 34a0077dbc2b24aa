# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of motions renders, and its axes say what they show."""

from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip('matplotlib')

from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: E402
from matplotlib.colors import to_rgb  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from mpl_toolkits.mplot3d.proj3d import proj_transform  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.model.arm import forward_kinematics, tool_pose  # noqa: E402
from rrth_planner.model.scene import Box, Scene  # noqa: E402
from rrth_planner.model.trajectory import MotionLimits, Trajectory  # noqa: E402
from rrth_planner.visualization import arm_view  # noqa: E402
from rrth_planner.visualization.arm_view import arm_points, draw_configurations  # noqa: E402
from rrth_planner.visualization.motion_figure import (  # noqa: E402
    draw_limits,
    JOINT_COLOURS,
    LIMIT,
    Motion,
    motion_figure,
)

ARM = load_arm()
LIMITS = MotionLimits(velocity=[1.5] * 4, acceleration=[4.0] * 4, jerk=[40.0] * 4)
SCENE = Scene(
    (
        Box('torso', [0.0, 0.0, 0.0], [0.3, 0.46, 0.6], np.eye(3)),
        Box('head', [0.02, 0.0, 0.45], [0.26, 0.24, 0.3], np.eye(3)),
    )
)
FOLDED = np.array([0.0, -0.35, np.pi / 2, np.pi / 2])


def picture(n_motions, beside=None):
    """Return a figure of some motions, and of what was seen beside a person, drawn."""
    T = tool_pose(ARM, FOLDED - 0.4)
    trajectory = Trajectory(
        times=[0.0, 1.0],
        positions=[FOLDED, FOLDED - 0.4],
        velocities=np.zeros((2, 4)),
        accelerations=np.zeros((2, 4)),
    )
    motion = Motion(
        label='lamp',
        trajectory=trajectory,
        target=T[:3, 3] + T[:3, 2],
        caption='0.80 rad in 1.00 s',
    )
    figure = motion_figure(ARM, SCENE, [motion] * n_motions, LIMITS, 1.0, beside)
    figure.canvas.draw()
    return figure


@pytest.mark.parametrize('n_motions', [1, 3])
def test_each_motion_has_a_view_and_two_plots_whose_axes_carry_units(n_motions):
    axes = picture(n_motions).axes
    assert len(axes) == 3 * n_motions
    for row in range(n_motions):
        view, position, velocity = axes[3 * row :][:3]
        for label in (view.get_xlabel(), view.get_ylabel(), view.get_zlabel()):
            assert label.endswith('[m]')
        assert position.get_ylabel() == 'position [rad]'
        assert velocity.get_ylabel() == 'velocity [rad/s]'
        assert velocity.get_xlabel() == 'time [s]'
        assert 'lamp' in position.get_title(loc='left')
        names = [text.get_text() for text in position.get_legend().get_texts()]
        assert names == ['joint 1', 'joint 2', 'joint 3', 'joint 4', 'limits']


def test_limits_have_the_colours_of_their_joints():
    axes = Figure().add_subplot()
    draw_limits(axes, np.array([[-1.0, -2.0, -2.0], [3.0, 3.0, 3.0]]))
    found = {}
    for line in axes.lines:
        found.setdefault(line.get_ydata()[0], []).append(line.get_color())
    one, two, three = JOINT_COLOURS[:3]
    assert found == {-2.0: [two, three], -1.0: [one], 3.0: [LIMIT]}


def test_dashes_of_joints_with_the_same_limit_take_turns():
    figure = Figure(figsize=(5.0, 1.0), dpi=300)
    canvas, axes = FigureCanvasAgg(figure), figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_ylim(-1.0, 3.0)
    draw_limits(axes, np.array([[1.0, 2.0, 2.0], [0.0, 2.0, 2.0]]))
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3] / 255.0
    for colour in JOINT_COLOURS[:3]:
        assert (np.abs(pixels - to_rgb(colour)).max(axis=2) < 0.2).sum() > 50, colour


def test_the_picture_is_not_blank():
    pixels = np.asarray(picture(1).canvas.buffer_rgba())[..., :3]
    assert (pixels < 250).any(axis=2).mean() > 0.02
    left, right = np.array_split(pixels, 2, axis=1)
    assert left.std() > 5.0
    assert right.std() > 5.0


@pytest.mark.parametrize('n', [2, 3, 40])
def test_a_motion_is_drawn_by_as_many_configurations_as_are_given(n):
    axes = Figure().add_subplot(projection='3d')
    q = np.linspace(FOLDED, FOLDED - 0.4, n)
    draw_configurations(axes, ARM, Scene(()), q, q, None, 1.0)
    # Nothing hides a piece of a line; the path of the tool, and two rays, are lines too.
    assert len(axes.collections) == n + 3
    colours = [lines.get_edgecolor()[0, :3] for lines in axes.collections[: n - 2]]
    assert all(a[0] < b[0] for a, b in pairwise(colours))


@pytest.mark.parametrize(('passes_by', 'is_aimed'), [(0.0, True), (0.005, True), (0.05, False)])
def test_a_ray_goes_to_the_target_only_where_it_points_there(monkeypatch, passes_by, is_aimed):
    T = tool_pose(ARM, FOLDED - 0.4)
    target = T[:3, 3] + 1.7 * T[:3, 2] + passes_by * T[:3, 0]
    drawn = []
    monkeypatch.setattr(arm_view, '_draw_line', lambda *line: drawn.append(line[3]))
    axes = Figure().add_subplot(projection='3d')
    q = np.array([FOLDED, FOLDED - 0.4])
    draw_configurations(axes, ARM, SCENE, q, q, target, 1.2)
    (ray,) = (line for line in drawn if len(line) == 2 and (line[0] == T[:3, 3]).all())
    np.testing.assert_allclose(ray[1], target if is_aimed else T[:3, 3] + 1.2 * T[:3, 2])
    # There is room for it in any case.
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    assert ((low <= target) & (target <= high)).all()


def test_the_drawn_arm_goes_from_the_mount_through_all_frames():
    points, poses = arm_points(ARM, FOLDED), forward_kinematics(ARM, FOLDED)
    np.testing.assert_array_equal(points[0], ARM.T_base_mount[:3, 3])
    np.testing.assert_array_equal(points[2::2], poses[:, :3, 3])
    corners = points[1::2]
    lengths = np.linalg.norm(points[2::2] - corners, axis=1)
    np.testing.assert_allclose(lengths, np.abs(ARM.dh[:, 3]), atol=1e-12)


def seen_place(text, axes):
    """Return where a label in space is in the picture [pixel]."""
    x, y, _ = proj_transform(*text.get_position_3d(), axes.get_proj())
    text.set_position((x, y))
    return text.get_window_extent()


@pytest.mark.parametrize('seed', range(6))
def test_the_labels_of_start_and_goal_never_overlap(seed):
    rng = np.random.default_rng(seed)
    # Near one another, in height too, as where the arm turns a little: at the same place at worst.
    q_end = FOLDED + rng.normal(size=4) * seed / 10.0
    figure = Figure()
    canvas, axes = FigureCanvasAgg(figure), figure.add_subplot(projection='3d')
    q = np.array([FOLDED, q_end])
    draw_configurations(axes, ARM, SCENE, q, q, None, 1.0, names=('first', 'last'))
    canvas.draw()
    first, last = (seen_place(text, axes) for text in axes.texts)
    assert [text.get_text() for text in axes.texts] == ['first', 'last']
    for place in (first, last):
        assert figure.bbox.containsx(place.x0) and figure.bbox.containsy(place.y0)
        assert place.width > 10.0 and place.height > 5.0
    assert not first.overlaps(last)
