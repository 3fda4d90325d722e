#include "AvatarClient.h"

#include <chrono>

#include "ControlClient.h"
#include "Json.h"
#include "LocalClock.h"

namespace manipnet {
namespace {

constexpr int kStepMs = 50;
constexpr int kTimeoutMs = 3000;
constexpr double kSilentS = 2.0;
constexpr double kRetryS = 5.0;

std::string RequestOf(const Connection& to, const std::string& profile) {
    const std::string actor = to.Actor.empty() ? std::string() : ", \"actor\": " + QuotedJson(to.Actor);
    return R"({"op": "hand_profile", "profile": )" + profile + actor + "}";
}

}  // namespace

AvatarClient::AvatarClient(const Connection& to, const std::string& name, const std::string& profile, OnFrame arrived)
    : Client(to, std::move(arrived), "hand/" + name + "/bin "), To(to), Request(RequestOf(to, profile)) {
    Uploading = std::thread([this] { Run(); });
}

AvatarClient::~AvatarClient() {
    AvatarClient::Stop();
    Uploading.join();
}

void AvatarClient::Stop() {
    Ending = true;
    Client::Stop();
}

Stats AvatarClient::GetStats() const {
    Stats stats = Client::GetStats();
    const std::lock_guard<std::mutex> guard(ProblemLock);
    if (!Problem.empty()) stats.State = Problem;
    return stats;
}

void AvatarClient::Run() {
    int uploaded = 0;
    double tried = -kRetryS;
    bool refused = false;
    while (!Ending) {
        const Stats stats = Client::GetStats();
        const bool silent = stats.AgeS < 0.0 || stats.AgeS > kSilentS;
        const bool due = stats.Connections > 0 && silent && LocalNow() - tried > kRetryS;
        if (due || (stats.Connections > uploaded && !refused)) {
            tried = LocalNow();
            Upload();
            const std::lock_guard<std::mutex> guard(ProblemLock);
            refused = !Problem.empty();
            if (!refused) uploaded = stats.Connections;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(kStepMs));
    }
    UploadingEnded = true;
}

void AvatarClient::Upload() {
    const Answer answer = ControlClient(To.Host, To.ControlPort, Ending, kTimeoutMs).Ask(Request);
    const std::lock_guard<std::mutex> guard(ProblemLock);
    if (answer.Problem.empty()) {
        Problem.clear();
    } else {
        const char* what = answer.Refused ? "the server refused the hand profile: " : "the hand profile could not be uploaded: ";
        Problem = what + answer.Problem;
    }
}

}  // namespace manipnet
