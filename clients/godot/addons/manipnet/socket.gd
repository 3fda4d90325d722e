# One WebSocket connection, in Godot 3 (WebSocketClient) and Godot 4 (WebSocketPeer).

const BUFFER_KIB = 256

var _is_new = Engine.get_version_info()["major"] >= 4
var _socket


# Begins to connect; returns whether that is possible. `protocols` are the names of subprotocols.
func open(url, protocols):
	if _is_new:
		_socket = ClassDB.call("instantiate", "WebSocketPeer")
		_socket.inbound_buffer_size = BUFFER_KIB * 1024
		_socket.supported_protocols = protocols
		return _socket.connect_to_url(url) == OK
	_socket = ClassDB.call("instance", "WebSocketClient")
	_socket.set_buffers(BUFFER_KIB, 1024, BUFFER_KIB, 64)
	return _socket.connect_to_url(url, protocols) == OK


# Does what is due; call this in every frame. Returns "connecting", "open" or "closed".
func poll():
	_socket.poll()
	if _is_new:
		return ["connecting", "open", "closed", "closed"][_socket.get_ready_state()]
	return ["closed", "connecting", "open"][_socket.get_connection_status()]


# The messages that have arrived: texts, and payloads as bytes.
func messages():
	var peer = _peer()
	var found = []
	while peer.get_available_packet_count() > 0:
		var packet = peer.get_packet()
		found.append(packet.get_string_from_utf8() if peer.was_string_packet() else packet)
	return found


# Sends a text.
func send(text):
	if _is_new:
		_socket.send_text(text)
	else:
		_peer().set_write_mode(0)  # WRITE_MODE_TEXT
		_peer().put_packet(text.to_utf8())


# Ends the connection.
func close():
	if _is_new:
		_socket.close()
	else:
		_socket.disconnect_from_host()


func _peer():
	return _socket if _is_new else _socket.get_peer(1)
