# Finds the bones of the fingers of a skeleton by their names, as all clients do.

const Names = preload("rig_names.gd")
const PUNCTUATION = " _-.,#()[]{}+~^&$!?'*@=<>/\\|"
const FULL_WIDTH_DIGITS = "０１２３４５６７８９"


# The bones of one hand, {"hand": int, "fingers": {number: int}}; the numbers, 0 to 14, count from the thumb's first bone
# to the little finger's last. The hand is -1 if it is not found. `bone_map` has names of the skeleton by known names.
static func find(skeleton, side, bone_map):
	var by_plain = {}
	for bone in range(skeleton.get_bone_count()):
		var name = plain(skeleton.get_bone_name(bone))
		if not by_plain.has(name):
			by_plain[name] = bone
	for known in bone_map:
		var bone = skeleton.find_bone(bone_map[known])
		if bone >= 0:
			by_plain[plain(known)] = bone
	var fingers = {}
	for number in range(15):
		var bone = _first(by_plain, Names.FINGER_BONES[side][number])
		if bone >= 0:
			fingers[number] = bone
	var metacarpal = _first(by_plain, Names.THUMB_METACARPALS[side][0])
	if metacarpal >= 0 and fingers.has(0):  # VRM 1 and Godot: what others call proximal is the second bone
		fingers[1] = fingers[0]
		fingers[0] = metacarpal
	return {"hand": _first(by_plain, Names.HAND_BONES[side][0]), "fingers": fingers}


# A name in lower case, without its namespace and punctuation.
static func plain(name):
	var parts = name.split(":")
	var text = parts[parts.size() - 1].to_lower()
	for character in PUNCTUATION:
		text = text.replace(character, "")
	for digit in range(10):
		text = text.replace(FULL_WIDTH_DIGITS[digit], str(digit))
	return text


static func _first(by_plain, names):
	for name in names.split(" "):
		if by_plain.has(name):
			return by_plain[name]
	return -1
