# Receives hands from ManipNet Live and shows them on a skeleton. This file runs in Godot 3 and 4.
extends Node

# A message has been shown; the frame has its hands and bodies.
signal hands_received(frame)
# The server has answered the upload of the profile: the text is its JSON, with an "error" if it was refused.
signal profile_answered(text)

const Frame = preload("frame.gd")
const HandDriver = preload("hand_driver.gd")
const Rotations = preload("rotations.gd")
const Socket = preload("socket.gd")
const FIRST_PAUSE_S = 0.1
const LONGEST_PAUSE_S = 1.0
const SILENCE_S = 5.0

# The address of the server's WebSocket, from its line `ready`.
var address = "ws://127.0.0.1:8081"
# The token of the server's --web-token; empty without one.
var token = ""
# The actor to show; the first one received if this is empty.
var actor = ""
# The name of a hand profile: its hands are shown in place of the model's.
var hand = ""
# The JSON text of that profile, which is uploaded on each connection; empty if the server has it from --hand.
var profile = ""
# The skeleton (Skeleton, or Skeleton3D in Godot 4) whose finger bones are turned.
var skeleton = NodePath()
# Names of the skeleton's bones by names that are known, as {"LeftHand": "palm_left"}.
var bone_map = {}
# Spatial nodes (Node3D in Godot 4) that follow the wrists, for example as targets of inverse kinematics.
var left_wrist = NodePath()
var right_wrist = NodePath()
# Spatial nodes (Node3D) that follow tracked bodies, by the names of the bodies.
var props = {}

# "connecting", "connected" or "reconnecting".
var state = "connecting"
# Messages shown, messages that were lost before they arrived, and messages that could not be read.
var received = 0
var lost = 0
var refused = 0
# Why the last message that could not be read was refused.
var problem = ""

var _socket = null
var _drivers = {}
var _frame = Frame.new()
var _session = ""
var _seq = -1
var _shown_actor = ""
var _quiet_s = 0.0
var _pause_s = FIRST_PAUSE_S
var _wait_s = 0.0


func _get_property_list():
	var shown = []
	for key in ["address", "token", "actor", "hand"]:
		shown.append({"name": key, "type": TYPE_STRING})
	shown.append({"name": "profile", "type": TYPE_STRING, "hint": PROPERTY_HINT_MULTILINE_TEXT})
	for key in ["skeleton", "left_wrist", "right_wrist"]:
		shown.append({"name": key, "type": TYPE_NODE_PATH})
	for key in ["bone_map", "props"]:
		shown.append({"name": key, "type": TYPE_DICTIONARY})
	return shown


func _ready():
	var node = _node(skeleton)
	if node != null:
		for side in ["left", "right"]:
			var driver = HandDriver.new(node, side, bone_map)
			if driver.bone_count > 0:
				_drivers[side] = driver
	if node != null and _drivers.size() == 0:
		push_warning("ManipNet: no fingers were found in %s; fill in bone_map" % skeleton)


func _process(delta):
	if _socket == null:
		_wait_s -= delta
		if _wait_s <= 0.0:
			_connect()
		return
	var now = _socket.poll()
	_quiet_s += delta
	if now == "closed" or _quiet_s > SILENCE_S:
		_retry()
	elif now == "open":
		if state != "connected":
			_connected()
		for message in _socket.messages():
			_take(message)


func _exit_tree():
	if _socket != null:
		_socket.close()


func _connect():
	var protocols = [] if token == "" else ["manipnet", "manipnet.token." + token]
	var path = "/" if hand == "" else "/hand/" + _encoded(hand)
	_socket = Socket.new()
	_quiet_s = 0.0
	if not _socket.open(address + path, protocols):
		_retry()


func _connected():
	state = "connected"
	_quiet_s = 0.0
	if profile != "":
		_socket.send('{"op": "hand_profile", "profile": ' + profile + "}")


func _retry():
	_socket.close()
	_socket = null
	state = "reconnecting"
	_wait_s = _pause_s
	_pause_s = min(2.0 * _pause_s, LONGEST_PAUSE_S)


func _take(message):
	if typeof(message) == TYPE_STRING:
		emit_signal("profile_answered", message)
		return
	var wrong = _frame.decode(message)
	if wrong != "":
		refused += 1
		problem = wrong
		return
	_quiet_s = 0.0
	_pause_s = FIRST_PAUSE_S
	if _frame.session != _session:
		_session = _frame.session
		_seq = -1
		_shown_actor = actor
	if _shown_actor == "":
		_shown_actor = _frame.actor
	if _frame.actor != _shown_actor or _frame.seq <= _seq:
		return
	if _seq >= 0:
		lost += _frame.seq - _seq - 1
	_seq = _frame.seq
	received += 1
	_show()
	emit_signal("hands_received", _frame)


func _show():
	var wrists = {"left": left_wrist, "right": right_wrist}
	for side in _frame.hands:
		if _drivers.has(side):
			_drivers[side].show_hand(_frame.hands[side])
		_place(wrists[side], _frame.hands[side]["joints"][HandDriver.WRIST])
	for body in _frame.bodies:
		if body["tracked"] and props.has(body["name"]):
			_place(props[body["name"]], body["pose"])


func _place(path, pose):
	var node = _node(path)
	if node != null:
		node.global_transform = Rotations.transform_of(pose, node.global_transform)


func _node(path):
	return null if str(path) == "" else get_node_or_null(NodePath(str(path)))


# The name as part of an address.
static func _encoded(name):
	if Engine.get_version_info()["major"] >= 4:
		return name.uri_encode()
	return name.http_escape()
