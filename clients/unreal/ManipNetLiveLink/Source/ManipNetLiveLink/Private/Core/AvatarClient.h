#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <thread>

#include "Client.h"

namespace manipnet {

/// Receives the hands that the server solves on an avatar. It uploads the hand profile on a thread of its own: at first,
/// whenever it has connected again, and while no hands arrive, because the server forgets a profile when it restarts or
/// when nobody has been subscribed for 60 s.
class AvatarClient final : public Client {
public:
    /// `name` is the name in the profile, and `profile` all of it in JSON.
    AvatarClient(const Connection& to, const std::string& name, const std::string& profile, OnFrame arrived = {});
    ~AvatarClient() override;

    void Stop() override;
    bool HasStopped() const override { return UploadingEnded && Client::HasStopped(); }

    /// The counters of the stream; the state tells why the profile could not be uploaded, if so.
    Stats GetStats() const override;

private:
    void Upload();
    void Run();

    const Connection To;
    const std::string Request;
    std::atomic<bool> Ending{false};
    std::atomic<bool> UploadingEnded{false};
    mutable std::mutex ProblemLock;
    std::string Problem;
    std::thread Uploading;
};

}  // namespace manipnet
