# Turns the finger bones of one hand of a skeleton. The directions of its bones become those of the hand in the message,
# whatever their lengths and axes are. The hand bone itself stays as it is.

const Bones = preload("bones.gd")
const Layout = preload("layout.gd")
const Rotations = preload("rotations.gd")
const WRIST = 1
# The OpenXR joint of each of the 15 finger bones.
const JOINTS = [2, 3, 4, 7, 8, 9, 12, 13, 14, 17, 18, 19, 22, 23, 24]

var bone_count = 0
var _skeleton
# Maps with bone, joint, above (the number of the driven bone above, or -1), and in the frame of the hand bone: rest,
# parent_rest, and the turn to the rest pose of the model.
var _bones = []
# From the frame of the wrist in a message to that of the hand bone.
var _align = Basis()
var _model_rest = []


# `skeleton` is a Skeleton of Godot 3 or a Skeleton3D of Godot 4.
func _init(skeleton, side, bone_map = {}):
	_skeleton = skeleton
	var found = Bones.find(skeleton, side, bone_map)
	var knuckles = []
	var model_knuckles = []
	for pose in Layout.REST_JOINTS:
		_model_rest.append(_mirrored(pose) if side == "left" else pose)
	if found["hand"] < 0:
		return
	var to_hand = _rest_in_skeleton(found["hand"]).affine_inverse()
	for number in [3, 6, 9, 12]:
		if found["fingers"].has(number):
			knuckles.append((to_hand * _rest_in_skeleton(found["fingers"][number])).origin)
			model_knuckles.append(_position(_model_rest[JOINTS[number]]))
	if knuckles.size() < 2:
		return  # the palm of a hand with one finger cannot be found
	_align = Rotations.palm(knuckles) * Rotations.palm(model_knuckles).transposed()
	for finger in range(5):
		_add_finger(found["fingers"], finger, to_hand)
	bone_count = _bones.size()


# Shows one hand of a message, `hands[side]` of a frame.
func show_hand(hand):
	var to_wrist = Rotations.from_quaternion(hand["joints"][WRIST], 3).transposed()
	var turns = []
	for each in _bones:
		var joint = each["joint"]
		var moved = to_wrist * Rotations.from_quaternion(hand["joints"][joint], 3)
		moved = moved * Rotations.from_quaternion(_model_rest[joint], 3).transposed()
		var turn = _align * moved * _align.transposed() * each["straightened"]
		turns.append(turn)
		var above = Basis() if each["above"] < 0 else turns[each["above"]]
		_set_rotation(each["bone"], (above * each["parent_rest"]).transposed() * turn * each["rest"])


func _add_finger(fingers, finger, to_hand):
	var above = -1
	var along = null
	for part in range(3):
		var number = 3 * finger + part
		if not fingers.has(number):
			continue
		var bone = fingers[number]
		var here = to_hand * _rest_in_skeleton(bone)
		var after = _next(fingers, finger, part)
		if after >= 0:
			along = ((to_hand * _rest_in_skeleton(after)).origin - here.origin).normalized()
		if along == null:
			continue
		var wanted = -(_align * Rotations.from_quaternion(_model_rest[JOINTS[number]], 3)).z
		var parent = to_hand
		if _skeleton.get_bone_parent(bone) >= 0:
			parent = to_hand * _rest_in_skeleton(_skeleton.get_bone_parent(bone))
		_bones.append({
			"bone": bone,
			"joint": JOINTS[number],
			"above": above,
			"rest": here.basis.orthonormalized(),
			"parent_rest": parent.basis.orthonormalized(),
			"straightened": Rotations.between(along, wanted),
		})
		above = _bones.size() - 1


# The bone at which a finger bone ends: the next one of the finger, or else a child; -1 if there is none.
func _next(fingers, finger, part):
	for later in range(part + 1, 3):
		if fingers.has(3 * finger + later):
			return fingers[3 * finger + later]
	for bone in range(_skeleton.get_bone_count()):
		if _skeleton.get_bone_parent(bone) == fingers[3 * finger + part]:
			return bone
	return -1


func _rest_in_skeleton(bone):
	var rest = _skeleton.get_bone_rest(bone)
	var parent = _skeleton.get_bone_parent(bone)
	while parent >= 0:
		rest = _skeleton.get_bone_rest(parent) * rest
		parent = _skeleton.get_bone_parent(parent)
	return rest


# Sets the rotation of a bone relative to its parent. Godot 3 wants it relative to the rest pose.
func _set_rotation(bone, basis):
	if Engine.get_version_info()["major"] >= 4:
		_skeleton.set_bone_pose_rotation(bone, basis.orthonormalized().get_rotation_quaternion())
	else:
		var pose = _skeleton.get_bone_pose(bone)
		pose.basis = _skeleton.get_bone_rest(bone).basis.orthonormalized().transposed() * basis.orthonormalized()
		_skeleton.set_bone_pose(bone, pose)


static func _position(pose):
	return Vector3(pose[0], pose[1], pose[2])


static func _mirrored(pose):
	return [-pose[0], pose[1], pose[2], pose[3], -pose[4], -pose[5], pose[6]]
