# Makes a skeleton from a file of JSON, shows a message on it, and prints where its bones are.
extends SceneTree

const Frame = preload("res://addons/manipnet/frame.gd")
const HandDriver = preload("res://addons/manipnet/hand_driver.gd")


func _init():
	var arguments = OS.get_cmdline_args()
	var rig = JSON.parse(_read(arguments[arguments.size() - 2]).get_string_from_utf8()).result
	var skeleton = Skeleton.new()
	get_root().add_child(skeleton)
	for bone in rig["bones"]:
		skeleton.add_bone(bone["name"])
		var index = skeleton.get_bone_count() - 1
		skeleton.set_bone_parent(index, int(bone["parent"]))
		var rows = bone["basis"]
		var basis = Basis(_vector(rows[0]), _vector(rows[1]), _vector(rows[2]))
		skeleton.set_bone_rest(index, Transform(basis, _vector(bone["origin"])))
	var frame = Frame.new()
	var problem = frame.decode(_read(arguments[arguments.size() - 1]))
	var counts = {}
	for side in frame.hands:
		var driver = HandDriver.new(skeleton, side, rig["map"])
		counts[side] = driver.bone_count
		if driver.bone_count > 0:
			driver.show_hand(frame.hands[side])
	var places = {}
	for bone in range(skeleton.get_bone_count()):
		var origin = skeleton.get_bone_global_pose(bone).origin
		places[skeleton.get_bone_name(bone)] = [origin.x, origin.y, origin.z]
	print("JSON ", to_json({"problem": problem, "counts": counts, "places": places}))
	quit()


func _read(path):
	var file = File.new()
	file.open(path, File.READ)
	return file.get_buffer(file.get_len())


func _vector(numbers):
	return Vector3(numbers[0], numbers[1], numbers[2])
