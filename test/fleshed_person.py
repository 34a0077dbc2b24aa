# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
A person with flesh: random bones and postures, points of the skin, and what trackers report.

Bones are between the 5th percentile of women and the 95th of men, girths those of the 95th
percentile of either (DIN 33402-2:2020; girths of limbs ANSUR II), without clothes. All frames
stand alike, x forward, y left, z up, where the person stands with arms spread (T-pose).
"""

from dataclasses import dataclass, field

import numpy as np
from rrth_planner.wearer.posture import Posture

X, Y, Z = np.eye(3)
SIDES = (('left', 1.0), ('right', -1.0))


def turn(axis, degrees):
    """Return a rotation about an axis (Rodrigues)."""
    k, t = np.asarray(axis) / np.linalg.norm(axis), np.radians(degrees)
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(t) * cross + (1 - np.cos(t)) * cross @ cross


@dataclass
class Person:
    """
    Joints and frames in the frame of the tracker, points of the skin by part, flesh [m^3].

    `frames` are (rotation, origin) by name.
    """

    frames: dict = field(default_factory=dict)
    skin: dict = field(default_factory=dict)
    volume: dict = field(default_factory=dict)

    def at(self, name, offset=(0.0, 0.0, 0.0)):
        """Return a place in a frame, as the tracker sees it."""
        rotation, origin = self.frames[name]
        return origin + rotation @ np.asarray(offset)

    def add(self, part, points, volume):
        """Add points of the skin."""
        self.skin.setdefault(part, []).append(points)
        self.volume[part] = self.volume.get(part, 0.0) + volume


def directions(rng, n):
    """Return unit vectors, (n, 3), those of the axes among them."""
    random = rng.standard_normal((n, 3))
    random /= np.linalg.norm(random, axis=1)[:, None]
    return np.concatenate([np.eye(3), -np.eye(3), random])


def ellipsoid(person, rng, part, frame, center, semi):
    """Add an ellipsoid in a frame."""
    rotation, origin = person.frames[frame]
    points = np.asarray(center) + directions(rng, 60) * semi
    person.add(part, origin + points @ rotation.T, 4 / 3 * np.pi * np.prod(semi))


def round_cone(person, rng, part, ends, radii):
    """Add what two balls and all between them make."""
    a, b = (np.asarray(end) for end in ends)
    share = rng.uniform(size=(40, 1))
    around = directions(rng, 34)
    middle = a + share * (b - a) + (radii[0] + share * (radii[1] - radii[0])) * around
    points = [end + r * directions(rng, 20) for end, r in ((a, radii[0]), (b, radii[1]))]
    length, (r, s) = np.linalg.norm(b - a), radii
    volume = np.pi * length * (r * r + r * s + s * s) / 3 + 2 / 3 * np.pi * (r**3 + s**3)
    person.add(part, np.concatenate([middle, *points]), volume)


def make_person(rng, is_upright=False):
    """
    Return a person of random bones in a random posture; upright: standing, with hanging arms.

    Angles are within what adults reach: the trunk bends 75 degrees forward, 30 sideways and 40
    round, arms rise overhead, shoulders shrug.
    """

    def angle(low, high, straight=0.0):
        return straight if is_upright else rng.uniform(low, high)

    person = Person()
    frames = person.frames
    # Anywhere before the tracker.
    world = turn(rng.standard_normal(3), rng.uniform(0, 180)), rng.uniform(-2.0, 2.0, 3)
    size = rng.uniform(0.88, 1.1)
    frames['pelvis'] = world
    bend = [angle(-10, 40), angle(-15, 15), angle(-15, 15)]
    lumbar = turn(Z, bend[2]) @ turn(X, bend[1]) @ turn(Y, bend[0])
    add_frame(frames, 'lumbar', 'pelvis', [0.0, 0.0, 0.11 * size], lumbar)
    bend = [angle(-10, 35), angle(-15, 15), angle(-25, 25)]
    thorax = turn(Z, bend[2]) @ turn(X, bend[1]) @ turn(Y, bend[0])
    add_frame(frames, 'thorax', 'lumbar', [0.0, 0.0, 0.21 * size], thorax)
    # The middle of the chest: what the arm is worn on.
    add_frame(frames, 'base', 'thorax', [0.0, 0.0, -0.05], np.eye(3))
    nod = turn(Z, angle(-35, 35)) @ turn(X, angle(-20, 20)) @ turn(Y, angle(-30, 25))
    add_frame(frames, 'neck', 'thorax', [-0.035, 0.0, 0.22 * size], nod)
    nod = turn(Z, angle(-40, 40)) @ turn(X, angle(-15, 15)) @ turn(Y, angle(-20, 25))
    add_frame(frames, 'head', 'neck', [0.015, 0.0, rng.uniform(0.10, 0.125)], nod)
    trunk(person, rng, size)
    for side, sign in SIDES:
        arm(person, rng, side, sign, size, angle)
        leg(person, rng, side, sign, angle)
    person.skin = {part: np.concatenate(points) for part, points in person.skin.items()}
    return person


def add_frame(frames, name, parent, offset, rotation):
    """Add a frame by its place and rotation in another one."""
    R, p = frames[parent]
    frames[name] = R @ rotation, p + R @ np.asarray(offset)


def trunk(person, rng, size):
    """Add torso, pelvis, neck and head."""
    ellipsoid(person, rng, 'torso', 'base', [0.0, 0.0, 0.06], [0.15, 0.175, 0.19])
    for _, sign in SIDES:
        ellipsoid(person, rng, 'torso', 'base', [0.09, 0.08 * sign, 0.06], [0.075] * 3)
    ellipsoid(person, rng, 'pelvis', 'pelvis', [-0.01, 0.0, 0.02], [0.155, 0.23, 0.15])
    ellipsoid(person, rng, 'pelvis', 'lumbar', [0.02, 0.0, 0.05], [0.18, 0.185, 0.13])
    ends = person.at('neck', [0.03, 0.0, 0.0]), person.at('head', [0.01, 0.0, 0.0])
    round_cone(person, rng, 'neck', ends, (0.07, 0.07))
    ellipsoid(person, rng, 'head', 'head', [0.015, 0.0, 0.065], [0.105, 0.0825, 0.105])
    ellipsoid(person, rng, 'head', 'head', [0.045, 0.0, -0.03], [0.065, 0.065, 0.075])
    ellipsoid(person, rng, 'head', 'head', [0.11, 0.0, 0.005], [0.015] * 3)
    for _, sign in SIDES:
        ellipsoid(person, rng, 'head', 'head', [0.0, 0.07 * sign, 0.015], [0.02] * 3)


def arm(person, rng, side, sign, size, angle):
    """Add a shoulder, an arm and a hand with fingers that may be curled."""
    frames, lengths = person.frames, (rng.uniform(0.26, 0.35), rng.uniform(0.22, 0.285))
    moved = [angle(-0.03, 0.05), sign * angle(-0.03, 0.01), angle(-0.02, 0.07)]
    neutral = np.array([-0.03, sign * rng.uniform(0.165, 0.195), 0.22 * size - 0.05])
    # Rotations about y turn the arm about itself; the others are mirrored.
    swing = turn(Z, -sign * angle(-40, 125)) @ turn(X, sign * angle(-85, 85, -85))
    swing = swing @ turn(Y, angle(-70, 70))
    add_frame(frames, f'{side} upper arm', 'thorax', neutral + moved, swing)
    along = np.array([0.0, sign, 0.0])
    bent = turn(Z, -sign * angle(0, 145)) @ turn(Y, angle(-75, 75))
    add_frame(frames, f'{side} forearm', f'{side} upper arm', lengths[0] * along, bent)
    bent = turn(X, sign * angle(-75, 65)) @ turn(Z, sign * angle(-28, 20))
    add_frame(frames, f'{side} hand', f'{side} forearm', lengths[1] * along, bent)
    shoulder, elbow, wrist = (
        person.at(f'{side} {name}') for name in ('upper arm', 'forearm', 'hand')
    )
    root = person.at('neck', [0.0, 0.0, -0.03])
    round_cone(person, rng, 'torso', (root, shoulder), (0.05, 0.05))
    round_cone(person, rng, f'{side} upper arm', (shoulder, elbow), (0.07, 0.055))
    biceps = person.at(f'{side} upper arm', 0.5 * lengths[0] * along)
    person.add(f'{side} upper arm', biceps + 0.066 * directions(rng, 20), 0.0)
    round_cone(person, rng, f'{side} forearm', (elbow, wrist), (0.055, 0.04))
    hand(person, rng, side, along, angle)


def hand(person, rng, side, along, angle):
    """Add palm, fingers and thumb; x is the side of the thumb, z the back of the hand."""
    name, length = f'{side} hand', rng.uniform(0.165, 0.207)
    palm, finger = 0.012 + 0.55 * length, 0.45 * length
    semi = np.array([0.045, 0.5 * palm, 0.02])
    ellipsoid(person, rng, name, name, 0.5 * palm * along, semi)
    down = np.cross(X, along)
    down *= -np.sign(down[2])
    curls = angle(0, 90), angle(0, 100)
    fingers = {'pinky': -0.033, 'ring': -0.011, 'middle': 0.011, 'index': 0.033}
    for finger_name, across in fingers.items():
        root = palm * along + across * X
        at, pointing, total, bends = root, along, 0.0, [root]
        for curl in curls:
            total += np.radians(curl)
            pointing = np.cos(total) * along + np.sin(total) * down
            tip = at + (0.5 * finger - 0.005) * pointing
            ends = person.at(name, at), person.at(name, tip)
            round_cone(person, rng, name, ends, (0.01, 0.01))
            bends.append(tip)
            at = tip
        knuckles(person, side, finger_name, [*bends[:2], 0.5 * (bends[1] + at), at])
    thumb = 0.03 * along + 0.025 * X
    tip = thumb + 0.062 * (0.7 * along + 0.7 * X)
    ends = person.at(name, thumb), person.at(name, tip)
    round_cone(person, rng, name, ends, (0.013, 0.012))
    share = np.linspace(0.0, 1.0, 4)[:, None]
    knuckles(person, side, 'thumb', thumb + share * (tip - thumb))
    # What trackers call the hand, and the knuckles of the index and the little finger.
    add_frame(person.frames, f'{side} palm', name, 0.8 * palm * along, np.eye(3))
    add_frame(person.frames, f'{side} index', name, palm * along + 0.033 * X, np.eye(3))
    add_frame(person.frames, f'{side} pinky', name, 0.95 * palm * along - 0.033 * X, np.eye(3))


def knuckles(person, side, finger, places):
    """Add the four points that trackers report of a finger, from its root to its tip."""
    for k, place in enumerate(places, 1):
        add_frame(person.frames, f'{side} {finger} {k}', f'{side} hand', place, np.eye(3))


def leg(person, rng, side, sign, angle):
    """Add a leg and a foot."""
    frames, lengths = person.frames, (rng.uniform(0.37, 0.47), rng.uniform(0.35, 0.45))
    swing = turn(Z, angle(-35, 35)) @ turn(X, sign * angle(-20, 40)) @ turn(Y, -angle(-20, 110))
    hip = [0.0, sign * rng.uniform(0.075, 0.1), 0.0]
    add_frame(frames, f'{side} thigh', 'pelvis', hip, swing)
    knee = turn(Y, angle(0, 135)) @ turn(Z, angle(-10, 10))
    add_frame(frames, f'{side} shin', f'{side} thigh', -lengths[0] * Z, knee)
    ankle = turn(Y, angle(-20, 45)) @ turn(X, angle(-12, 12)) @ turn(Z, angle(-12, 12))
    add_frame(frames, f'{side} foot', f'{side} shin', -lengths[1] * Z, ankle)
    ends = person.at(f'{side} thigh', [0.0, 0.0, -0.05]), person.at(f'{side} shin')
    round_cone(person, rng, f'{side} thigh', ends, (0.115, 0.07))
    ends = person.at(f'{side} shin'), person.at(f'{side} foot')
    round_cone(person, rng, f'{side} shin', ends, (0.07, 0.04))
    calf = [-0.02, 0.0, -0.3 * lengths[1]]
    ellipsoid(person, rng, f'{side} shin', f'{side} shin', calf, [0.07, 0.07, 0.1])
    length, sole = rng.uniform(0.22, 0.285), rng.uniform(0.075, 0.09)
    name = f'{side} foot'
    # A heel, a ball and toes on the sole.
    for x, r in ((-0.23, 0.035), (0.55, 0.03), (0.77, 0.02)):
        width = 0.033 if x < 0 else 0.055
        center = [x * length + (r if x < 0 else -r), 0.0, r - sole]
        ellipsoid(person, rng, name, name, center, [r, width, r])
    ends = person.at(name), person.at(name, [0.5 * length, 0.0, 0.035 - sole])
    round_cone(person, rng, name, ends, (0.04, 0.035))
    add_frame(frames, f'{side} toes', name, [0.52 * length, 0.0, 0.025 - sole], np.eye(3))


def towards(start, end, left):
    """Return a frame whose z leads from a point to another one and whose y is close to left."""
    z = (end - start) / np.linalg.norm(end - start)
    y = left - left @ z * z
    y /= np.linalg.norm(y)
    return np.column_stack([np.cross(y, z), y, z])


def seen_by(tracker, person):
    """Return what a tracker reports of a person."""
    return posture_of(SEEN[tracker](person), tracker not in POINTS)


def posture_of(seen, has_rotations=True):
    """Return places and rotations by name as a posture."""
    return Posture(
        names=tuple(seen),
        positions=np.array([position for position, _ in seen.values()]),
        rotations=np.array([rotation for _, rotation in seen.values()]) if has_rotations else None,
    )


def azure_kinect(person):
    """Return points by the names of the SDK."""
    seen = {'PELVIS': person.at('pelvis')}
    seen['SPINE_CHEST'] = person.at('thorax', [-0.035, 0.0, 0.0])
    seen['NECK'] = person.at('neck')
    seen['NOSE'] = person.at('head', [0.12, 0.0, 0.0])
    joints = {'SHOULDER': 'upper arm', 'ELBOW': 'forearm', 'WRIST': 'hand', 'HAND': 'palm'}
    joints |= {'HIP': 'thigh', 'KNEE': 'shin', 'ANKLE': 'foot', 'FOOT': 'toes'}
    for side, sign in SIDES:
        seen[f'EAR_{side.upper()}'] = person.at('head', [0.0, 0.075 * sign, 0.015])
        for name, frame in joints.items():
            seen[f'{name}_{side.upper()}'] = person.at(f'{side} {frame}')
    return {name: (position, None) for name, position in seen.items()}


def mediapipe(person):
    """Return points by the names of the landmarks."""
    seen = {'nose': person.at('head', [0.12, 0.0, 0.0])}
    joints = {'shoulder': 'upper arm', 'elbow': 'forearm', 'wrist': 'hand', 'hip': 'thigh'}
    joints |= {'knee': 'shin', 'ankle': 'foot', 'foot_index': 'toes'}
    joints |= {'index': 'index', 'pinky': 'pinky'}
    for side, sign in SIDES:
        seen[f'{side}_ear'] = person.at('head', [0.0, 0.075 * sign, 0.015])
        for name, frame in joints.items():
            seen[f'{side}_{name}'] = person.at(f'{side} {frame}')
    return {name: (position, None) for name, position in seen.items()}


def zed_body(n):
    """Return what makes points by the names of a body format of the ZED SDK that has a spine."""

    def seen_by_zed(person):
        seen = {}
        for name, (position, _) in azure_kinect(person).items():
            words = name.split('_')
            if words[-1] in ('LEFT', 'RIGHT'):
                words = [words[-1], words[0]]
            seen['_'.join(words)] = position, None
        seen['CHEST_SPINE' if n == 34 else 'SPINE_3'] = seen.pop('SPINE_CHEST')
        for side in ('LEFT', 'RIGHT') if n != 34 else ():
            for frame in ('index', 'pinky'):
                place = person.at(f'{side.lower()} {frame}')
                seen[f'{side}_HAND_{frame.upper()}_1'] = place, None
            for finger in ('thumb', 'index', 'middle', 'ring', 'pinky') if n == 70 else ():
                for k in range(1, 5):
                    place = person.at(f'{side.lower()} {finger} {k}')
                    seen[f'{side}_HAND_{finger.upper()}_{k}'] = place, None
            toes = seen.pop(f'{side}_FOOT')
            seen |= {f'{side}_BIG_TOE': toes, f'{side}_SMALL_TOE': toes}
            del seen[f'{side}_HAND']
        return seen

    return seen_by_zed


def coco_17(person):
    """Return points by the names of COCO: no hands, no toes."""
    beyond = ('index', 'pinky')
    return {name: at for name, at in mediapipe(person).items() if not name.endswith(beyond)}


def halpe_26(person):
    """Return those of COCO, and toes."""
    seen = {name: at for name, at in coco_17(person).items() if 'foot' not in name}
    for side, _ in SIDES:
        toes = person.at(f'{side} toes'), None
        seen |= {f'{side}_big_toe': toes, f'{side}_small_toe': toes}
    return seen


def zed_body_18(person):
    """Return those of COCO in capitals, and the middle of the shoulders."""
    seen = {name.upper(): at for name, at in coco_17(person).items()}
    neck = 0.5 * (seen['LEFT_SHOULDER'][0] + seen['RIGHT_SHOULDER'][0])
    return {**seen, 'NECK': (neck, None)}


def xsens(person):
    """Return segments: frames that stand as those of the person, T8 in his spine."""
    segments = {'Pelvis': 'pelvis', 'Neck': 'neck', 'Head': 'head'}
    joints = {'UpperArm': 'upper arm', 'ForeArm': 'forearm', 'Hand': 'hand', 'Toe': 'toes'}
    joints |= {'UpperLeg': 'thigh', 'LowerLeg': 'shin', 'Foot': 'foot'}
    for side, _ in SIDES:
        segments |= {f'{side.title()}{name}': f'{side} {frame}' for name, frame in joints.items()}
    seen = {name: (person.at(frame), person.frames[frame][0]) for name, frame in segments.items()}
    return {**seen, 'T8': (person.at('thorax', [-0.06, 0.0, 0.0]), person.frames['thorax'][0])}


def xsens_bvh(person):
    """Return the same as joints in frames with x left, y up and z forward, by other names."""
    turned, seen = np.column_stack([Y, Z, X]), {}
    names = {'UpperArm': 'Shoulder', 'ForeArm': 'Elbow', 'Hand': 'Wrist', 'Foot': 'Ankle'}
    names |= {'UpperLeg': 'Hip', 'LowerLeg': 'Knee', 'Pelvis': 'Hips', 'T8': 'Chest4'}
    for segment, (place, rotation) in xsens(person).items():
        side = next((side for side in ('Left', 'Right') if segment.startswith(side)), '')
        name = segment.removeprefix(side)
        seen[side + names.get(name, name)] = place, rotation @ turned
    return seen


def plates(person):
    """Return rigid bodies on chest, upper arms and hands, placed as docs/trackers.md advises."""
    seen = {'chest': (person.at('base', [-0.1, 0.0, 0.0]), person.frames['base'][0])}
    for side, sign in SIDES:
        hanging = turn(X, 90 * sign)
        upper, hand = (person.frames[f'{side} {p}'][0] @ hanging for p in ('upper arm', 'hand'))
        middle = 0.5 * (person.at(f'{side} upper arm') + person.at(f'{side} forearm'))
        seen[f'{side}_arm'] = middle + upper @ [0.0, 0.05 * sign, 0.0], upper
        seen[f'{side}_hand'] = person.at(f'{side} hand') + hand @ [0.0, 0.0, -0.05], hand
    return seen


def cmu_bvh(person):
    """Return joints in frames with x left, y up and z forward."""
    turned = np.column_stack([Y, Z, X])
    segments = {'hip': 'pelvis', 'chest': 'thorax', 'neck': 'neck', 'head': 'head'}
    joints = {
        'ForeArm': 'forearm',
        'Hand': 'hand',
        'Thigh': 'thigh',
        'Shin': 'shin',
        'Foot': 'foot',
    }
    for side, _ in SIDES:
        segments |= {f'{side[0]}{name}': f'{side} {frame}' for name, frame in joints.items()}
    seen = {}
    for name, frame in segments.items():
        below = [0.0, 0.0, -0.04] if name == 'head' else [0.0, 0.0, 0.0]
        seen[name] = person.at(frame, below), person.frames[frame][0] @ turned
    rotation, _ = person.frames['thorax']
    for side, sign in SIDES:
        collar = person.at(f'{side} upper arm') - rotation @ [0.015, 0.155 * sign, -0.02]
        seen[f'{side[0]}Collar'] = collar, rotation @ turned
    return seen


def straight_torso(person):
    """Return the middle of the shoulders and a frame there that leans with the line to it."""
    middle = 0.5 * (person.at('left upper arm') + person.at('right upper arm'))
    left = person.at('left upper arm') - person.at('right upper arm')
    return middle, towards(person.at('pelvis'), middle, left)


def ros4hri(person):
    """Return links: arms and legs hang in their frames."""
    middle, torso = straight_torso(person)
    head, _ = person.frames['head']
    seen = {
        'body': (person.at('pelvis'), person.frames['pelvis'][0]),
        'torso': (middle, torso),
        'p_head': (person.at('neck'), head),
        'head': (person.at('head', [0.05, 0.0, 0.0]), head),
    }
    for side, sign in SIDES:
        hanging = turn(X, 90 * sign)
        upper, fore = (person.frames[f'{side} {p}'][0] @ hanging for p in ('upper arm', 'forearm'))
        thigh, shin = (person.frames[f'{side} {p}'][0] for p in ('thigh', 'shin'))
        links = {
            'shoulder': ('upper arm', upper),
            'elbow': ('forearm', fore),
            'wrist': ('hand', fore),
            'hip': ('thigh', thigh),
            'knee': ('shin', shin),
            'ankle': ('foot', shin),
        }
        for link, (frame, rotation) in links.items():
            seen[f'{side[0]}_{link}'] = person.at(f'{side} {frame}'), rotation
    return seen


def tum_bvh(person):
    """Return the upper body, mirrored names, z forward and y up."""
    turned = np.column_stack([Y, Z, X])
    middle, torso = straight_torso(person)
    hips = person.at('pelvis')
    # A torso as stiff as that of the recordings: its neck is where they have it.
    seen = {
        'hip': (hips, torso @ turned),
        'torso': (middle - torso @ [0.05, 0.0, 0.32], torso @ turned),
        'neck': (middle, torso @ turned),
        'head': (person.at('head', [0.015, 0.0, 0.17]), torso @ turned),
    }
    for side, _ in SIDES:
        other = 'right' if side == 'left' else 'left'
        for name, frame in {
            'upper_arm': 'upper arm',
            'forearm': 'forearm',
            'hand': 'hand',
        }.items():
            rotation = person.frames[f'{side} {frame}'][0] @ turned
            seen[f'{other}_{name}'] = person.at(f'{side} {frame}'), rotation
    return seen


SEEN = {
    'azure_kinect': azure_kinect,
    'mediapipe': mediapipe,
    'xsens': xsens,
    'xsens_bvh': xsens_bvh,
    'cmu_bvh': cmu_bvh,
    'ros4hri': ros4hri,
    'tum_bvh': tum_bvh,
    'zed_body_18': zed_body_18,
    'zed_body_34': zed_body(34),
    'zed_body_38': zed_body(38),
    'zed_body_70': zed_body(70),
    'coco_17': coco_17,
    'halpe_26': halpe_26,
}
# What reports points without rotations.
ZED = ('zed_body_18', 'zed_body_34', 'zed_body_38', 'zed_body_70')
POINTS = ('azure_kinect', 'mediapipe', *ZED, 'coco_17', 'halpe_26')
