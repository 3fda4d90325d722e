# One hands message. Axes are Godot's own: right-handed with Y up; metres. Quaternions are x, y, z, w.
# This file runs in Godot 3 and 4, so it has no types.

const Layout = preload("layout.gd")

var session = ""
var actor = ""
var seq = 0
var t_capture = 0.0
# By "left" and "right", as far as they are there: maps with state, object (or null), scale, wrist and joints.
# The wrist is a list of 7 numbers, and joints is a list of 26 of them, in the order of Layout.JOINT_NAMES.
var hands = {}
# A list of maps with name, tracked and pose, a list of 7 numbers.
var bodies = []


# What is wrong with a value of the message that is being read; empty if nothing is.
var _problem = ""


# Reads the payload of pose/bin. Returns an empty text, or what is wrong with it. Of the numbers of a hand, only those
# that are kept are checked.
func decode(payload):
	_problem = ""
	var data = StreamPeerBuffer.new()
	data.data_array = payload
	if payload.size() < Layout.HEADER_BYTES or data.get_u32() != Layout.MAGIC:
		return "the message is too short, or it is not pose/bin"
	var version = data.get_u16()
	if version != Layout.VERSION:
		return "message is of version %d; this reader understands version %d" % [version, Layout.VERSION]
	var header_size = data.get_u16()
	var total_size = data.get_u32()
	var hand_size = data.get_u16()
	var body_size = data.get_u16()
	var hand_count = data.get_u16()
	var body_count = data.get_u16()
	var expected = header_size + hand_count * hand_size + body_count * body_size
	if total_size != expected or payload.size() != expected:
		return "the message has %d bytes, but its header says %d" % [payload.size(), expected]
	if header_size < Layout.HEADER_BYTES or hand_size < Layout.HAND_BYTES or body_size < Layout.BODY_BYTES:
		return "the records of the message are too short"
	if hand_count > 2 or body_count > Layout.MAX_BODIES:
		return "the message has %d hands and %d bodies" % [hand_count, body_count]
	session = _name(data, Layout.HEADER_SESSION)
	actor = _name(data, Layout.HEADER_ACTOR)
	data.seek(Layout.HEADER_SEQ)
	seq = data.get_u64()
	data.seek(Layout.HEADER_T_CAPTURE)
	t_capture = _finite(data.get_double())
	hands = {}
	for i in range(hand_count):
		var at = header_size + i * hand_size
		data.seek(at)
		var side = data.get_u8()
		var has_object = data.get_u8()
		var state = data.get_u8()
		if side > 1 or state >= Layout.STATES.size():
			return "a hand has the side %d and the state %d" % [side, state]
		var hand = {"state": Layout.STATES[state], "object": null}
		if has_object != 0:
			hand["object"] = _name(data, at + Layout.HAND_OBJECT)
		data.seek(at + Layout.HAND_SCALE)
		hand["scale"] = _finite(data.get_float())
		hand["wrist"] = _pose(data, at + Layout.HAND_WRIST)
		hand["joints"] = []
		for joint in range(Layout.JOINT_COUNT):
			hand["joints"].append(_pose(data, at + Layout.HAND_JOINTS + 28 * joint))
		if hands.has(["left", "right"][side]):
			return "a hand occurs twice"
		hands[["left", "right"][side]] = hand
	bodies = []
	for i in range(body_count):
		var at = header_size + hand_count * hand_size + i * body_size
		data.seek(at)
		var tracked = data.get_u8() != 0
		var name = _name(data, at + Layout.BODY_NAME)
		bodies.append({"name": name, "tracked": tracked, "pose": _pose(data, at + Layout.BODY_POSE)})
	return _problem


func _name(data, at):
	data.seek(at)
	var length = data.get_u8()
	if length > Layout.NAME_BYTES:
		_problem = "a name has %d bytes; at most %d are allowed" % [length, Layout.NAME_BYTES]
	if length == 0 or _problem != "":
		return ""
	var text = data.get_data(length)[1].get_string_from_utf8()
	if text == "":
		_problem = "a name is not UTF-8"
	return text


func _pose(data, at):
	data.seek(at)
	var pose = []
	for _i in range(7):
		pose.append(_finite(data.get_float()))
	return pose


func _finite(number):
	if is_nan(number) or is_inf(number):
		_problem = "a number is not finite"
	return number
