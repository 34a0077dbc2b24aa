# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A person as REP 155 has him: a URDF with the names and axes of its links and joints."""

# Link, parent, joint type, axis, origin [m]; in the proportions of an adult of 1.7 m.
LINKS = [
    ('waist', 'body', 'revolute', '0 1 0', '0 0 0'),
    ('torso', 'waist', 'fixed', '', '0 0 0.5'),
    ('r_head', 'torso', 'revolute', '1 0 0', '0 0 0.06'),
    ('y_head', 'r_head', 'revolute', '0 0 1', '0 0 0'),
    ('p_head', 'y_head', 'revolute', '0 -1 0', '0 0 0'),
    ('head', 'p_head', 'fixed', '', '0.06 0 0.11'),
]
for side, sign in (('l', 1), ('r', -1)):
    LINKS += [
        (f'{side}_y_shoulder', 'torso', 'revolute', f'0 0 {-sign}', f'0 {0.18 * sign} 0'),
        (f'{side}_p_shoulder', f'{side}_y_shoulder', 'revolute', f'{sign} 0 0', '0 0 0'),
        (f'{side}_shoulder', f'{side}_p_shoulder', 'revolute', f'0 0 {sign}', '0 0 0'),
        (f'{side}_elbow', f'{side}_shoulder', 'revolute', '0 -1 0', '0 0 -0.3'),
        (f'{side}_wrist', f'{side}_elbow', 'fixed', '', '0 0 -0.25'),
        (f'{side}_y_hip', 'body', 'revolute', '0 0 -1', f'0 {0.1 * sign} 0'),
        (f'{side}_p_hip', f'{side}_y_hip', 'revolute', f'{sign} 0 0', '0 0 0'),
        (f'{side}_hip', f'{side}_p_hip', 'revolute', '0 -1 0', '0 0 0'),
        (f'{side}_knee', f'{side}_hip', 'revolute', '0 -1 0', '0 0 -0.42'),
        (f'{side}_ankle', f'{side}_knee', 'fixed', '', '0 0 -0.4'),
    ]
# The joints that move lead to the link of their name, but for those that end in it.
MOVING = [link for link, _, kind, _, _ in LINKS if kind != 'fixed']


def joint_of(link):
    """Return the name of the joint that leads to a link."""
    side, _, rest = link.partition('_')
    return f'{side}_r_{rest}' if rest in ('shoulder', 'hip') else link


def human_urdf(identity='_ab3de'):
    """Return the URDF of a person whose links and joints end in an id."""
    names = ['body', *(link for link, *_ in LINKS)]
    parts = [f'<link name="{name}{identity}"/>' for name in names]
    for link, parent, kind, axis, origin in LINKS:
        moves = f'<axis xyz="{axis}"/><limit effort="1" velocity="1" lower="-4" upper="4"/>'
        parts.append(
            f'<joint name="{joint_of(link)}{identity}" type="{kind}">'
            f'<parent link="{parent}{identity}"/><child link="{link}{identity}"/>'
            f'<origin xyz="{origin}" rpy="0 0 0"/>{moves if axis else ""}</joint>'
        )
    return f'<robot name="human">{"".join(parts)}</robot>'
