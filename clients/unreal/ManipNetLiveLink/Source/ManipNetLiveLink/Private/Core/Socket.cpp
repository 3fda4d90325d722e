#include "Socket.h"

#include <algorithm>
#include <cstring>

#include "LocalClock.h"

#ifdef _WIN32
#ifdef MANIPNET_UNREAL
#include "Windows/AllowWindowsPlatformTypes.h"
#endif
#include <winsock2.h>
#include <ws2tcpip.h>
#ifdef MANIPNET_UNREAL
#include "Windows/HideWindowsPlatformTypes.h"
#endif
#else
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#endif

namespace manipnet {
namespace {

constexpr int kSliceMs = 50;  // how often a wait checks whether it should end

#ifdef _WIN32
using Native = SOCKET;
constexpr int kSendFlags = 0;
int PollOne(WSAPOLLFD* one, int ms) { return WSAPoll(one, 1, ms); }
using PollItem = WSAPOLLFD;
void CloseNative(Native handle) { closesocket(handle); }
bool WouldBlock() { return WSAGetLastError() == WSAEWOULDBLOCK; }
void MakeNonBlocking(Native handle) {
    u_long on = 1;
    ioctlsocket(handle, FIONBIO, &on);
}
struct Startup {
    Startup() {
        WSADATA data;
        WSAStartup(MAKEWORD(2, 2), &data);
    }
} const kStartup;
#else
using Native = int;
constexpr int kSendFlags = MSG_NOSIGNAL;
using PollItem = pollfd;
int PollOne(pollfd* one, int ms) { return poll(one, 1, ms); }
void CloseNative(Native handle) { close(handle); }
bool WouldBlock() { return errno == EINPROGRESS || errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR; }
void MakeNonBlocking(Native handle) { fcntl(handle, F_SETFL, fcntl(handle, F_GETFL, 0) | O_NONBLOCK); }
#endif

}  // namespace

std::string Socket::Connect(const std::string& host, std::uint16_t port, int timeoutMs) {
    Close();
    addrinfo hints{};
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    const int result = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found);
    if (result != 0) return "the host " + host + " is unknown";
    std::string error = "the host " + host + " has no address";
    for (const addrinfo* a = found; a != nullptr && !error.empty(); a = a->ai_next) {
        Handle = static_cast<std::intptr_t>(socket(a->ai_family, a->ai_socktype, a->ai_protocol));
        if (Handle < 0) continue;
        const auto native = static_cast<Native>(Handle);
        MakeNonBlocking(native);
        const int on = 1;
        setsockopt(native, IPPROTO_TCP, TCP_NODELAY, reinterpret_cast<const char*>(&on), sizeof on);
        int failed = connect(native, a->ai_addr, static_cast<socklen_t>(a->ai_addrlen)) != 0 && !WouldBlock() ? 1 : 0;
        if (failed == 0 && Wait(true, timeoutMs)) {
            socklen_t size = sizeof failed;
            getsockopt(native, SOL_SOCKET, SO_ERROR, reinterpret_cast<char*>(&failed), &size);
        } else {
            failed = 1;
        }
        error = failed == 0 ? std::string() : "no server answers at " + host + ":" + std::to_string(port);
        if (failed != 0) Close();
    }
    freeaddrinfo(found);
    return error;
}

void Socket::Close() {
    if (Handle >= 0) CloseNative(static_cast<Native>(Handle));
    Handle = -1;
}

std::string Socket::Send(const std::uint8_t* data, std::size_t length) {
    while (length > 0) {
        const auto sent = send(static_cast<Native>(Handle), reinterpret_cast<const char*>(data),
#ifdef _WIN32
                               static_cast<int>(length),
#else
                               length,
#endif
                               kSendFlags);
        if (sent < 0 && !(WouldBlock() && Wait(true, 1000))) return "the connection is lost";
        const std::size_t done = sent > 0 ? static_cast<std::size_t>(sent) : 0;
        data += done;
        length -= done;
    }
    return {};
}

long Socket::Receive(std::uint8_t* data, std::size_t capacity, int timeoutMs) {
    if (!Wait(false, timeoutMs)) return 0;
    const auto got = recv(static_cast<Native>(Handle), reinterpret_cast<char*>(data),
#ifdef _WIN32
                          static_cast<int>(capacity),
#else
                          capacity,
#endif
                          0);
    if (got < 0) return WouldBlock() ? 0 : -1;
    return got == 0 ? -1 : static_cast<long>(got);
}

bool Socket::Wait(bool toWrite, int timeoutMs) const {
    const double until = LocalNow() + 0.001 * timeoutMs;  // a slice takes longer on a busy machine
    while (!Stop) {
        PollItem one{};
        one.fd = static_cast<Native>(Handle);
        one.events = static_cast<short>(toWrite ? POLLOUT : POLLIN);
        if (PollOne(&one, std::min(timeoutMs, kSliceMs)) > 0) return true;
        if (LocalNow() >= until) return false;
    }
    return false;
}

}  // namespace manipnet
