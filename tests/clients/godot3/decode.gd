# Decodes every file that the command line names, and prints a line of JSON for each.
extends SceneTree

const Frame = preload("res://addons/manipnet/frame.gd")


func _init():
	for path in OS.get_cmdline_args():
		if path.ends_with(".bin"):
			var file = File.new()
			file.open(path, File.READ)
			var frame = Frame.new()
			var problem = frame.decode(file.get_buffer(file.get_len()))
			var read = {"problem": problem}
			if problem == "":
				read = {
					"problem": problem, "seq": frame.seq, "t_capture": frame.t_capture, "sides": frame.hands.keys(),
					"left": frame.hands.get("left", {}), "bodies": frame.bodies,
				}
			print("JSON ", to_json(read))
	quit()
