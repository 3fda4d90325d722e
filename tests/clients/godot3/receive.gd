# Receives messages at the address on the command line, and prints what it has after each of them.
extends SceneTree

const Receiver = preload("res://addons/manipnet/manipnet_receiver.gd")

var receiver
var prop
var wrist


func _init():
	receiver = Receiver.new()
	prop = Spatial.new()
	wrist = Spatial.new()
	for pair in [[receiver, "receiver"], [prop, "prop"], [wrist, "wrist"]]:
		pair[0].name = pair[1]
		get_root().add_child(pair[0])
	for argument in OS.get_cmdline_args():
		for key in ["address", "token", "hand", "profile"]:
			if argument.begins_with(key + "="):
				receiver.set(key, argument.substr(key.length() + 1))
	receiver.props = {"cube": "/root/prop"}
	receiver.left_wrist = NodePath("/root/wrist")
	receiver.connect("hands_received", self, "_on_hands")
	receiver.connect("profile_answered", self, "_on_answer")


func _on_hands(frame):
	var at = prop.global_transform.origin
	var hand = wrist.global_transform.origin
	print("JSON ", to_json({
		"seq": frame.seq, "session": frame.session, "received": receiver.received, "lost": receiver.lost,
		"refused": receiver.refused, "state": receiver.state, "prop": [at.x, at.y, at.z],
		"wrist": [hand.x, hand.y, hand.z], "joints": frame.hands["left"]["joints"],
	}))


func _on_answer(text):
	print("ANSWER ", text)
