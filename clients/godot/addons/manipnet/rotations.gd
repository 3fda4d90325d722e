# Rotations as Basis, which has the same constructors in Godot 3 and 4.


# The rotation of a quaternion x, y, z, w, which is four numbers of a list from `at` on.
static func from_quaternion(numbers, at):
	var x = numbers[at]
	var y = numbers[at + 1]
	var z = numbers[at + 2]
	var w = numbers[at + 3]
	return Basis(
		Vector3(1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)),
		Vector3(2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)),
		Vector3(2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y))
	)


# The rotation about the shortest way from one direction to another.
static func between(start, end):
	var axis = start.cross(end)
	if axis.length() < 1e-6:
		return Basis()
	return Basis(axis.normalized(), start.angle_to(end))


# The frame of a palm: -z from the wrist to the knuckles, and x from the little finger to the index finger.
static func palm(knuckles):
	var middle = Vector3()
	for point in knuckles:
		middle += point
	var z = -middle.normalized()
	var x = (knuckles[0] - knuckles[knuckles.size() - 1]).normalized()
	x = (x - z * z.dot(x)).normalized()
	return Basis(x, z.cross(x), z)


# The pose of a message as the transform of a node, `like` whose type it gets.
static func transform_of(pose, like):
	like.basis = from_quaternion(pose, 3)
	like.origin = Vector3(pose[0], pose[1], pose[2])
	return like
